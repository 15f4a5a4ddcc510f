"""Second recordings of a world for plans: what is usually played beside the plan, and which of them decides."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis.fitting import fit
from gpsim.diagnosis.setup import prepare
from gpsim.files import read_object
from gpsim.posterior import LeftOpen, left_open_from
from gpsim.recordings import Episode, HeldOut, Recording, read_recording
from gpsim.simulators import make_simulator
from gpsim.trials.blinding import DIAGNOSES, DIAGNOSIS, PLAN, PUBLIC, Answer
from gpsim.trials.concealing import played
from gpsim.trials.worlds import World

PLANNED, REPEATED = "plan", "repeat"
Json = Mapping[str, Any]
PARTS = tuple(2.0**-k for k in range(6, -1, -1))  # of a second recording, after which odds may be asked for
DECIDED = math.log(10.0)  # nats
SLOWEST, FASTEST, HELD = 0.1, 5.0, 0.2  # Hz of a chirp; s of a level of a binary sequence
ROUNDS = 12


@dataclass(frozen=True)
class Decided:
    """part: after which of PARTS the best right explanation leads the best other one by odds above ten, None: never.

    nats: by which it leads at the end; left: whether the machine left the box, where somebody stops it.
    """

    part: float | None
    nats: float
    left: bool


@dataclass(frozen=True)
class Second:
    """seconds: of each second recording; listed: whether some explanations hold all of the truth, and others not."""

    seconds: float
    listed: bool
    kinds: Mapping[str, Decided]


def second_recordings(
    out: Path, name: str, answer: Answer, outcome: Json, report: Json | None
) -> Second | None:
    """Of a world whose first diagnosis has rivals; None of another, which left nothing open."""
    if report is None or not report["alternatives"]:
        return None
    folder, recording = out / DIAGNOSES / name, read_recording(out / PUBLIC / name)
    planned = None
    if (folder / PLAN).is_dir():
        table = pd.read_csv(folder / PLAN / "plan.csv")
        planned = table[list(recording.action.names)].to_numpy(dtype=np.float64)
    open_still = left_open_from(read_object(folder / DIAGNOSIS / "posterior.json"), str(folder))
    return compared(answer.world, answer.content["plan"], recording, open_still, planned)


def compared(
    world: World, limits: Json, recording: Recording, open_still: LeftOpen, planned: FloatArray | None
) -> Second:
    """The plan (K, A), None where none was found, beside what is usually played, all as long."""
    count = round(limits["minutes"] * 60.0 / recording.dt) if planned is None else len(planned)
    claims = {(e.family, e.on) for e in world.main}
    right = np.array([e.hypothesis.claims >= claims for e in open_still.explanations])
    if right.all() or not right.any():
        return Second(count * recording.dt, False, {})
    usual = usual_commands(recording, count, world.generator(6))
    nothing = np.zeros((count, len(recording.action)))
    kinds = {PLANNED: nothing if planned is None else planned, **usual}
    # Cut, or filled by nothing commanded.
    as_long = [np.vstack([rows[:count], nothing[len(rows) :]]) for rows in kinds.values()]
    second, left = played(world, np.stack(as_long, axis=1), limits["box"])
    found = {
        kind: _decided(recording, second.episodes[e], int(left[e]), open_still, right)
        for e, kind in enumerate(kinds)
    }
    return Second(count * recording.dt, True, found)


def _decided(first: Recording, new: Episode, stopped: int, open_still: LeftOpen, right: BoolArray) -> Decided:
    """stopped: after how many steps the machine left the box, all of them where it never did."""
    count = len(new)
    ends = [end for end in (round(part * count) for part in PARTS) if end <= stopped] or [max(stopped, 1)]

    def nats(end: int) -> float:
        cut = replace(
            new, name="second", t=new.t[: end + 1], states=new.states[: end + 1], actions=new.actions[:end]
        )
        return _nats(first, cut, open_still, right)

    last = nats(ends[-1])
    if last <= DECIDED:
        return Decided(None, last, stopped < count)
    low, high = 0, len(ends) - 1
    while low < high:  # what is decided stays so
        middle = (low + high) // 2
        low, high = (low, middle) if nats(ends[middle]) > DECIDED else (middle + 1, high)
    return Decided(ends[low] / count, last, stopped < count)


def usual_commands(recording: Recording, count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    """(count, A) of each kind that is usually played, as large as the first recording's largest commands."""
    first = recording.episodes[0].actions
    largest, t = np.abs(first).max(axis=0), recording.dt * np.arange(count)
    fade = np.clip(np.minimum(t, t[-1] - t), 0.0, 1.0)[:, None]
    growth = math.log(FASTEST / SLOWEST)
    chirp = np.sin(2 * np.pi * SLOWEST * t[-1] / growth * (np.exp(growth * t / t[-1]) - 1.0))
    held = round(HELD / recording.dt)
    levels = np.repeat(rng.choice((-1.0, 1.0), count // held + 1), held)[:count]
    walk = np.cumsum(rng.standard_normal(count))
    shapes = {"chirp": chirp, "PRBS": levels, "random walk": walk / np.abs(walk).max()}
    found = {kind: largest * fade * shape[:, None] for kind, shape in shapes.items()}
    return {**found, REPEATED: first[:count]}


def _nats(first: Recording, new: Episode, open_still: LeftOpen, right: BoolArray) -> float:
    """How far the right explanation is ahead, every one refitted to the first recording and a new episode."""
    both = replace(first, episodes=(*first.episodes, new), held_out=HeldOut(share=0.0))
    simulator = make_simulator(first.system)
    problem = prepare(both, simulator, simulator.defaults(first.parameters)).everything
    fits = [fit(problem, e.hypothesis, rounds=ROUNDS) for e in open_still.explanations]
    noise = min(fits, key=lambda f: float((f.residuals**2 / problem.floor**2).sum())).noise
    fits = [fit(problem, f.hypothesis, f.starts, ROUNDS, noise) for f in fits]
    nats = np.array([-f.cost - 0.5 * len(f.z) * math.log(noise.effective) for f in fits])
    return float(nats[right].max() - nats[~right].max())
