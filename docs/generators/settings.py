"""The settings in writing: the reference page, and conf/diagnose/default.yaml. Both are generated, and tested to be."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Iterator
from typing import Any

from gpsim.diagnosis.settings import WHERE, Settings, described

KNOWN = (
    "known:                 # what you know of the base simulator; names in docs/how-to/partial_recordings.md",
    "  fix: null            # parameters, as {cart_mass: 1.2}: taken as they are, and never asked whether they are off",
    "  bounds: null         # as {pole_mass: [0.08, 0.1], coulomb_friction.x.force: [0, 5]}, each in its unit",
    "families:              # of effects, each as `family` or `family on place`",
    "  only: []             # ask for these alone; []: for all",
    "  without: []          # do not ask for these",
    "  require: []          # in the account from the start, and told where they do nothing",
    "  also: []             # ask for these beside the usual ones",
    "  usual: []            # these belong to the usual machine, too",
    "  unusual: []          # these do not, and must bring as much as what a machine seldom has",
)
"""What a user may say beside the settings, which is no threshold."""
NARROW = 60  # columns of a value, beside which its meaning begins
LARGE = 1e6  # what is as large is written with a power of ten


def steps(settings: Settings) -> Iterator[tuple[str, Any]]:
    """Name and settings of every step."""
    for f in dataclasses.fields(settings):
        yield f.name, getattr(settings, f.name)


DECIDE = ("log_facts", "laws", "pushes", "curves", "verdict", "intervals")
EFFORT = ("angles", "most", "knots", "rivals")  # of these, what is no threshold


def _count(settings: Settings) -> int:
    """How many numbers decide."""
    named = [(step, name) for step in DECIDE for name, *_ in described(getattr(settings, step))]
    return sum(name not in EFFORT or step == "pushes" for step, name in named)


def as_page(settings: Settings) -> str:
    """docs/reference/settings.md."""
    lines = [
        "# Settings of the diagnosis",
        "",
        "Made by `python docs/generate.py` from `gpsim/diagnosis/settings`; a test holds it current. Any of them",
        f"is a word on the command line: `gpsim diagnose RECORDING {WHERE}.laws.unusual=12`.",
        "",
        f"What is told is decided by {', '.join(f'`{name}`' for name in DECIDE)}: {_count(settings)} numbers. The",
        "others say how much is computed. Constants beside the code are tolerances, starts of fits and efforts.",
        "",
    ]
    for name, step in steps(settings):
        lines += [f"## {WHERE}.{name}", "", " ".join((inspect.getdoc(type(step)) or "").split()), ""]
        lines += [
            "| setting | default | unit | what it is | where the default comes from |",
            "|---|---|---|---|---|",
        ]
        for setting, default, unit, meaning, origin in described(step):
            cells = (f"`{setting}`", _value(default), unit, meaning, origin)
            lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        lines.append("")
    return "\n".join(lines)


def as_yaml(settings: Settings) -> str:
    """conf/diagnose/default.yaml."""
    lines = [
        "# Every setting of the diagnosis at its default. Made by docs/generate.py, see docs/reference/settings.md.",
        "episodes: null         # of the loop's recording: the first so many only, null for all",
        *KNOWN,
    ]
    for name, step in steps(settings):
        lines.append(f"{name}:")
        for setting, default, unit, meaning, _ in described(step):
            said = f"{meaning} [{unit}]" if unit != "1" else meaning
            lines.append(f"  {f'{setting}: {_value(default)}':<{NARROW - 20}} # {said}")
    return "\n".join(lines) + "\n"


def _value(default: Any) -> str:
    if isinstance(default, tuple):
        return f"[{', '.join(_value(v) for v in default)}]"
    if isinstance(default, bool):
        return str(default).lower()
    if isinstance(default, float):
        if default >= LARGE:
            digits, power = f"{default:e}".split("e")
            return f"{float(digits)}e+{int(power)}"
        text = repr(default)  # YAML 1.1 takes 1e-05 for a text
        return text.replace("e-0", "e-").replace("e", ".0e") if "e" in text and "." not in text else text
    return str(default)
