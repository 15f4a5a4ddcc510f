"""The scoreboard's six robots: what each peer makes of a log, and how far its motion is off in what the log holds out.

Peers: the model as it is; mujoco.sysid told by hand what is missing (the numbers that the scoreboard's references
name, those that are optional too, and nothing else is free); mujoco.sysid with dry friction, damping and rotor of
every joint, the mass of every body and every gain free; gpsim, told nothing. All see the training part of a log alone
and are judged by motion from the same starts in the part that the log itself holds out.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import mujoco

from peer_grounds.arms import (
    Free,
    Log,
    body_numbers,
    corrected,
    cut,
    diagnosed,
    drive_numbers,
    fit,
    joint_numbers,
    left,
    model_of,
    motion,
    offset_numbers,
    rolled,
    told,
)
from peer_grounds.contract import Answer, Parameter, Score

CASES = ("dfki_c1-1", "panda-1", "so101-1", "tx40-1", "ur10e-3", "xl330-1")
ELSE = {"parameter_offset on goal.kp": "kp of goal", "parameter_offset on goal.kv": "kv of goal"}
"""What the scoreboard's references name, and what mujoco.sysid has for it. A delay it has no word for in a model."""


def scoreboard() -> Path:
    """The scoreboard's cases."""
    return Path(os.environ["GPSIM_SCOREBOARD"]) / "cases"


def log_of(case: str, work: Path) -> Log:
    """A case in its two parts."""
    folder = scoreboard() / f"robot-{case}"
    return cut(case, folder, folder / "robot.xml", work / case / "train")


def everything(log: Log) -> dict[str, Free]:
    """All that mujoco.sysid may change."""
    spec = mujoco.MjSpec.from_file(str(log.model))
    return joint_numbers(log, spec) | body_numbers(spec) | drive_numbers(spec)


def what_is_missing(log: Log, case: str) -> tuple[dict[str, Free], list[str]]:
    """What the references name, and what of it cannot be said to mujoco.sysid."""
    spec = mujoco.MjSpec.from_file(str(log.model))
    known = everything(log) | offset_numbers(log, spec)
    wanted = json.loads((scoreboard() / f"robot-{case}" / "expected.json").read_text(encoding="utf-8"))[
        "effects"
    ]
    names = [f"{e['family']} on {e['on']}" for e in wanted]
    names = [ELSE.get(name, name) for name in names]
    return {n: known[n] for n in names if n in known}, [n for n in names if n not in known]


def asked(peer: str, seed: int, folder: Path) -> Answer:
    """What a peer says of a robot, and how far its motion is off."""
    case = CASES[seed]
    log = log_of(case, folder)
    base = model_of(mujoco.MjSpec.from_file(str(log.model)), log.dt)
    before = motion(log, rolled(base, log.dt))
    if peer == "as-it-is":
        return answer(case, before, before, {})
    if peer == "gpsim-effects":
        found = folder / "found"
        diagnosed(log, found)
        with_gp = motion(log, corrected(found, gp=True))
        said = told(found)
        about = {"verdict": said["verdict"], "left, with the Gaussian process": left(with_gp, before)}
        return answer(case, motion(log, corrected(found)), before, about, *named(said))
    free, not_said = what_is_missing(log, case) if peer == "mujoco-sysid-told" else (everything(log), [])
    fitted = fit(log, free)
    about = {
        "window, s": fitted.window,
        "tried": fitted.tried,
        "seconds of the chosen fit": fitted.seconds,
        "not said": not_said,
    }
    numbers = tuple(Parameter(name, *value) for name, value in fitted.values.items())
    return answer(case, motion(log, rolled(fitted.model, log.dt)), before, about, numbers=numbers)


def named(said: dict[str, Any]) -> tuple[tuple[str, ...], tuple[Parameter, ...]]:
    """What gpsim names, and its numbers with their 90 % intervals."""
    claims = [e for e in said["effects"] if e["role"] == "headline"]
    numbers = [
        Parameter(f"{e['name']}: {key}", p["value"], p["unit"], p["low"], p["high"])
        for e in said["effects"]
        for key, p in e["parameters"].items()
    ]
    return tuple(e["name"] for e in claims), tuple(numbers)


def answer(
    case: str,
    moved: dict[str, Any],
    before: dict[str, Any],
    about: dict[str, Any],
    names: tuple[str, ...] = (),
    numbers: tuple[Parameter, ...] = (),
) -> Answer:
    """The cell of a robot."""
    shares = left(moved, before)
    both = (shares["0.2 s"] * shares["1 s"]) ** 0.5
    scores = {"left": Score(both), **{f"left, {horizon}": Score(share) for horizon, share in shares.items()}}
    return Answer(scores, names, numbers, details={"robot": case, "motion": moved, **about})
