"""Second recordings of a world for plans: what is usually played beside the plan, and which of them decides."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis import LeftOpen, left_open_from
from gpsim.diagnosis.fitting import fit, scores
from gpsim.diagnosis.setup import prepare
from gpsim.files import read_object
from gpsim.recordings import HeldOut, Recording, read_recording
from gpsim.simulators import make_simulator
from gpsim.trials.blinding import DIAGNOSES, DIAGNOSIS, PLAN, PUBLIC, Answer, played

PLANNED, REPEATED = "plan", "repeat"
PARTS = (0.125, 0.25, 0.5, 1.0)  # of a second recording, after which the odds are asked for
SLOWEST, FASTEST, HELD = 0.1, 5.0, 0.2  # Hz of a chirp; s of a level of a binary sequence
ITERATIONS = 20


@dataclass(frozen=True)
class Decided:
    """nats: after each of PARTS, by how much the best right explanation leads the best other one; left: the box."""

    nats: tuple[float, ...]
    left: bool


@dataclass(frozen=True)
class Second:
    """seconds: of each second recording; listed: whether some explanations hold all of the truth, and others not."""

    seconds: float
    listed: bool
    kinds: Mapping[str, Decided]


def second_recordings(out: Path, name: str, answer: Answer) -> Second:
    """Of a world whose first diagnosis is ambiguous."""
    folder, recording = out / DIAGNOSES / name, read_recording(out / PUBLIC / name)
    limits, open_still = answer.content["plan"], _left_open(folder / DIAGNOSIS)
    count = round(limits["minutes"] * 60.0 / recording.dt)
    right = np.array([e.hypothesis.claims >= set(answer.claims) for e in open_still.explanations])
    if right.all() or not right.any():
        return Second(count * recording.dt, False, {})
    commands = usual_commands(recording, count, answer.world.generator(6))
    if (folder / PLAN).is_dir():
        table = pd.read_csv(folder / PLAN / "plan.csv")
        commands[PLANNED] = table[list(recording.action.names)].to_numpy(dtype=np.float64)
        count = len(commands[PLANNED])
    kinds = {kind: _as_long(rows, count) for kind, rows in commands.items()}
    second, left = played(answer.world, np.stack(list(kinds.values()), axis=1), limits["box"])
    decided = {
        kind: Decided(
            tuple(_nats(recording, second, e, part, open_still, right) for part in PARTS), bool(left[e])
        )
        for e, kind in enumerate(kinds)
    }
    return Second(count * recording.dt, True, decided)


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
    return {PLANNED: np.zeros((count, len(largest))), **found, REPEATED: first[:count]}


def _as_long(rows: FloatArray, count: int) -> FloatArray:
    """Cut, or filled by nothing commanded."""
    return np.vstack([rows[:count], np.zeros((max(count - len(rows), 0), rows.shape[1]))])


def _nats(
    first: Recording, second: Recording, episode: int, part: float, open_still: LeftOpen, right: BoolArray
) -> float:
    """How far the right explanation is ahead after a part of an episode, every one refitted to both recordings."""
    new = second.episodes[episode]
    rows = round(part * len(new))
    cut = replace(
        new, name="second", t=new.t[: rows + 1], states=new.states[: rows + 1], actions=new.actions[:rows]
    )
    both = replace(first, episodes=(*first.episodes, cut), held_out=HeldOut(share=0.0))
    simulator = make_simulator(first.system)
    problem = prepare(both, simulator, simulator.defaults(first.parameters)).everything
    starts = problem.windows.measured[:, 0]
    fits = [fit(problem, e.hypothesis, starts, iterations=ITERATIONS) for e in open_still.explanations]
    nats = scores(problem, fits)
    return float(nats[right].max() - nats[~right].max())


def _left_open(folder: Path) -> LeftOpen:
    return left_open_from(read_object(folder / "posterior.json"), str(folder))
