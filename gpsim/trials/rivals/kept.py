"""What is dear to find out about a trial is kept in OUT/equivalents/NAME.json, for what it follows from."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from gpsim.files import plain, write_json, written_whole
from gpsim.trials.rivals.fits import Claims, Rival
from gpsim.trials.worlds import TrueEffect

Json = Mapping[str, Any]


def kept_path(out: Path, name: str) -> Path:
    """Where it is kept."""
    return out / "equivalents" / f"{name}.json"


def read_kept(path: Path) -> dict[str, Any]:
    """What is kept; nothing where it is missing or damaged."""
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return {}
    return content


def write_kept(path: Path, content: Json) -> None:
    """Keep it, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(path) as made:
        write_json(made, plain(content))


def digests_of(outcome: Json) -> dict[str, Any]:
    """The answer and the recording of a diagnosis."""
    return {key: outcome[key] for key in ("answer_sha256", "recording")}


def kept_or_made(
    out: Path, name: str, follows_from: Json, make: Callable[[], dict[str, Any]]
) -> dict[str, Any]:
    """What is kept of a trial, made anew where it follows from something else."""
    path, identity = kept_path(out, name), plain(follows_from)
    kept = read_kept(path)
    if any(kept.get(key) != value for key, value in identity.items()):
        write_kept(path, identity | make())
        kept = read_kept(path)
    return kept


def claims_from(pairs: Sequence[Sequence[str]]) -> Claims:
    """Claims as JSON has them."""
    return tuple((family, on) for family, on in pairs)


def rivals_from(kept: Json) -> list[Rival]:
    """The rivals that are kept."""
    lost = ((r, math.inf if r["nats_lost"] is None else float(r["nats_lost"])) for r in kept["rivals"])
    return [Rival(claims_from(r["claims"]), loss, bool(r["richer"])) for r, loss in lost]


def ratios_from(kept: Json) -> dict[str, float]:
    """The ratios of rollouts that are kept; JSON has no infinity."""
    return {name: math.inf if ratio is None else float(ratio) for name, ratio in kept["rollouts"].items()}


def said_of(report: Json | None) -> list[list[Json]]:
    """The effects of the leader and of every alternative."""
    if report is None:
        return []
    return [list(report["effects"]), *(list(a["effects"]) for a in report["alternatives"])]


def place_of(on: Any) -> str:
    """Several places are joined."""
    return on if isinstance(on, str) else ",".join(map(str, on))


def as_true(effect: Json) -> TrueEffect:
    """An effect as a report has it, as the truth says it."""
    region = {k: (float(low), float(high)) for k, (low, high) in effect["region"].items()}
    values = {n: float(p["value"]) for n, p in effect["parameters"].items()}
    return TrueEffect(str(effect["family"]), place_of(effect["on"]), values, region, effect["since"])


def in_short(effect: Json) -> list[Any]:
    """Family, place and values of an effect that was said."""
    return [effect["family"], effect["on"], {n: p["value"] for n, p in effect["parameters"].items()}]
