"""Hundreds of hostile files, by number: texts made of what breaks readers. (Damaged logs are of the readers' tests.)"""

from dataclasses import dataclass
from pathlib import Path

import attacking  # noqa: F401  # where bags and mutations are
import numpy as np
import pandas as pd
from mjcf_models import DOUBLE, PENDULUM
from mutations import WAYS, damaged

CELLS = ["", "nan", "-inf", "1e999", "0x10", "1,5", '"', "'", "#", "%", "\t", ";", "${oc.env:HOME}", "=cmd|' /C calc'!A0",
         "999999999999999999999", "-9223372036854775808", "\u202e", "𝟙", "true", "1_000", "a" * 5000, "\x00", "\x1b[31m"]  # fmt: skip
YAMLS = ["!!python/object/apply:os.system ['x']", "&a [*a]", "<<: {a: 1}", "? [a]\n: b", "- " * 2000, "{" * 2000,
         "a: !!binary x", "a: 1\na: 2", "\t", "%YAML 9.9", "---\n---", "a: 2020-01-01", "a: .nan", "a: 1e999", "\x00",
         "a: &x [1,2,3]\nb: [*x,*x]", "'", "a: |\n  b\n c", "state: {x: {topic: /p, field: ../..}}", "rate: -1"]  # fmt: skip
NUMBERS = ["0", "-1", "nan", "inf", "1e308", "-1e308", "99999999999", "1 2 3 4 5 6 7 8 9", "", "abc", "0x7fffffff",
           "&#0;"]  # fmt: skip
TAGS = ['<replicate count="{}"><geom size=".1"/></replicate>', '<body pos="{} 0 0"><joint/><geom size=".1"/></body>',
        '<geom size="{}"/>', '<site name="s" rgba="{}"/>', '<body euler="{}"><freejoint/><geom size=".1"/></body>',
        '<composite type="cable" count="{} 1 1" size="1"/>', '<flexcomp name="f" type="grid" count="{} 2 2"/>',
        '<attach model="{}" body="b" prefix="p"/>', '<geom type="mesh" mesh="{}"/>', '<camera resolution="{} 1"/>']  # fmt: skip


@dataclass(frozen=True)
class Variant:
    """A hostile file: what was done, and the command that reads it."""

    name: str
    words: tuple[str, ...]


def _frame() -> pd.DataFrame:
    t = np.arange(200) * 0.02
    return pd.DataFrame(
        {"t": t, "x": np.sin(t), "x_dot": np.cos(t), "theta": t, "theta_dot": t, "force": t, "note": "a"}
    )


def _csv(folder: Path, number: int, rng: np.random.Generator) -> Variant:
    """A table whose cells are strange, and whose rows have too few or too many."""
    rows = [["t", "x", "x_dot", "theta", "theta_dot", "force"]]
    rows += [[f"{0.02 * i + j}" for j in range(6)] for i in range(60)]
    for _ in range(int(rng.integers(1, 6))):
        row = rows[int(rng.integers(0, len(rows)))]
        row[int(rng.integers(0, len(row)))] = str(rng.choice(CELLS))
        row += ["1"] * int(rng.integers(0, 3))
    path = folder / f"{number}.csv"
    path.write_text("\n".join(",".join(row) for row in rows), encoding="utf-8")
    return Variant(
        "cells", ("diagnose", str(path), "--simulator", "cartpole", "--dry-run", "--out", str(folder / "no"))
    )


def _yaml(folder: Path, number: int, rng: np.random.Generator) -> Variant:
    """A mapping, or what stands beside a recording, of strange YAML."""
    text = (
        str(rng.choice(YAMLS)) + "\n" + str(rng.choice(["", "system: cartpole", "dt: 0.02", "state: {x: m}"]))
    )
    if number % 2:
        path = folder / f"{number}.yaml"
        path.write_text(text, encoding="utf-8")
        log = folder / "log.csv"
        _frame().to_csv(log, index=False)
        return Variant(
            "mapping", ("import", str(log), "--mapping", str(path), "--out", str(folder / "no"), "--dry-run")
        )
    recording = folder / f"{number}-recording"
    recording.mkdir()
    _frame().to_csv(recording / "recording.csv", index=False)
    (recording / "recording.yaml").write_text(text, encoding="utf-8")
    return Variant("recording.yaml", ("diagnose", str(recording), "--dry-run", "--out", str(folder / "no")))


def _xml(folder: Path, number: int, rng: np.random.Generator) -> Variant:
    """A model with a strange element, a strange number, or damage."""
    path = folder / f"{number}.xml"
    text, how = str(rng.choice([PENDULUM, DOUBLE])), number % 3
    value = str(rng.choice(NUMBERS))
    if how == 0:
        text = text.replace("</worldbody>", str(rng.choice(TAGS)).format(value) + "</worldbody>")
    elif how == 1:
        places = [i for i, part in enumerate(text.split('"')) if i % 2]
        parts = text.split('"')
        parts[int(rng.choice(places))] = value
        text = '"'.join(parts)
    data = bytearray(text.encode())
    path.write_bytes(damaged(data, WAYS[number % len(WAYS)], rng) if how == 2 else data)
    return Variant("xml", ("simulators", "show", str(path)))


TEXTS = {"csv": _csv, "yaml": _yaml, "xml": _xml}


def variants(folder: Path, kind: str, numbers: range) -> list[Variant]:
    """Hostile files of a kind, made in a folder."""
    return [TEXTS[kind](folder, n, np.random.default_rng([n, 5])) for n in numbers]
