"""Concealing a world: a public half, which is a recording and nothing else, and a private half with the answer."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from gpsim.channels import Channels, FloatArray, wrap_angle
from gpsim.errors import UsageError
from gpsim.files import file_digest, written_whole
from gpsim.recordings import Episode, HeldOut, Recording
from gpsim.recordings.files import write_recording
from gpsim.trials.drawing import draw
from gpsim.trials.truth import OneStep, Visibility, one_step, run, visibilities
from gpsim.trials.worlds import SYSTEMS, Run, World, effect_json, sound, world_json

SCHEMA = "gpsim.answer/1"
PUBLIC, PRIVATE = "public", "private"
ANSWER, TRUTH = "answer.json", "truth.npz"
HASHES = "answers.sha256"
NAME = re.compile(r"\d{4,}")  # of a trial's folder
FEWEST, ATTEMPTS = 2000, 6
UNFILTERED = range(2026, 2029)  # published seeds: their true model did not know what differentiating does
SHORTEST = 40  # transitions: what an operator would keep of an episode that went wrong


@dataclass(frozen=True)
class Concealed:
    """A world that was run. clean: the recording as perfect sensors would have made it; one_step: of the true model."""

    world: World
    recording: Recording
    clean: Recording
    visible: list[Visibility]
    one_step: OneStep


def conceal(seed: int, number: int) -> Concealed:
    """Draw and run trial `number` of a seed. A world in which too little survives is drawn anew."""
    for attempt in range(ATTEMPTS):
        world = draw(seed, number, attempt)
        truth = run(world, world.effects)
        n = truth.per_sample
        kept = sound(world, truth.fine[::n])
        kept = np.where(kept > SHORTEST, kept, 0)
        if np.maximum(kept - 1, 0).sum() >= FEWEST:
            recording = _recording(world, truth.measured, truth, kept)
            clean = _recording(world, truth.clean, truth, kept)
            known = clean
            if seed in UNFILTERED:
                bare = replace(world, velocities=world.velocities and "measured", wrapped=False)
                known = _recording(bare, truth.clean, truth, kept)
            visible = visibilities(world, _shortened(truth, kept))
            return Concealed(world, recording, clean, visible, one_step(world, truth, recording, known, kept))
    raise UsageError(
        f"seed {seed}, trial {number}: no world could be run in {ATTEMPTS} attempts; take another seed"
    )


def answer_of(concealed: Concealed, truth_digest: str) -> dict[str, Any]:
    """What answer.json says."""
    world = concealed.world
    effects = [
        effect_json(effect)
        | {"share": seen.share, "rollout": min(seen.rollout, 1e6), "visible": seen.visible}
        for effect, seen in zip(world.effects, concealed.visible, strict=True)
    ]
    return {
        "schema": SCHEMA,
        "seed": world.seed,
        "trial": world.number,
        # Nobody can find the answer by hashing guesses of it.
        "nonce": world.generator(4).bytes(16).hex(),
        "stratum": world.stratum,
        "long": world.long,
        "effects": effects,
        "visible": all(seen.visible for seen in concealed.visible),
        "transitions": concealed.recording.transition_count,
        "one_step": {
            rate: {"base": _rms(concealed.one_step.base[:, i]), "own": _rms(concealed.one_step.own[:, i])}
            for i, rate in enumerate(SYSTEMS[world.system].rates)
        },
        "world": world_json(world),
        "truth_sha256": truth_digest,
    }


def write_trial(out: Path, seed: int, number: int) -> str:
    """Write both halves of a trial, each whole or not at all; the answer's SHA-256. What exists is kept."""
    name = trial_name(number)
    private, public = out / PRIVATE / name, out / PUBLIC / name
    if not (private / ANSWER).is_file() or not (public / "recording.yaml").is_file():
        concealed = conceal(seed, number)
        with written_whole(private) as answers, written_whole(public) as recordings:
            answers.mkdir(parents=True)
            _write_truth(answers / TRUTH, concealed)
            text = json.dumps(answer_of(concealed, file_digest(answers / TRUTH)), indent=1) + "\n"
            (answers / ANSWER).write_text(text, encoding="utf-8")
            recordings.mkdir(parents=True)
            write_recording(concealed.recording, recordings, "csv")
            for half in (private, public):
                shutil.rmtree(half, ignore_errors=True)
    return file_digest(private / ANSWER)


def publish_hashes(out: Path, digests: dict[str, str]) -> None:
    """Write the answers' hashes beside the recordings; those of other trials stay, and none is ever replaced.

    Raises UsageError where another hash was published.
    """
    path = out / PUBLIC / HASHES
    if path.is_file():
        known = published(path)
        for name, digest in digests.items():
            if known.get(name, digest) != digest:
                raise UsageError(
                    f"{path}: another answer to trial {name} was published; choose another --out"
                )
        digests = known | digests
    lines = "".join(f"{digest}  {name}\n" for name, digest in sorted(digests.items()))
    with written_whole(path) as made:
        made.write_text(lines, encoding="utf-8")


def published(path: Path) -> dict[str, str]:
    """Trial -> SHA-256 of its answer, from the file beside the recordings; raises UsageError."""
    lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    if any(len(line) != 2 or not NAME.fullmatch(line[1]) for line in lines):
        raise UsageError(f"{path}: expected lines of a SHA-256 and a trial")
    return {name: digest for digest, name in lines}


def trial_name(number: int) -> str:
    """The folder of a trial."""
    return f"{number:04d}"


def _recording(world: World, readings: FloatArray, truth: Run, kept: FloatArray) -> Recording:
    """The readings (K + 1, E, S) as a user would have them."""
    system = SYSTEMS[world.system]
    state = Channels.of(system.state, ("yaw",) if system.vehicle else ())
    episodes: list[Episode] = []
    for e in np.flatnonzero(kept):
        count = int(kept[e])
        states = readings[:count, e].copy()
        if world.velocities == "differentiated":
            states[:, 1::2] = _differentiated(states[:, 0::2], world)
        if system.vehicle and world.wrapped:
            states[:, 2] = wrap_angle(states[:, 2])
        t = world.clock_offsets[e] + world.dt * np.arange(count)
        episodes.append(Episode(str(len(episodes)), np.round(t, 9), states, truth.commands[: count - 1, e]))
    held_out = None
    if world.held_out is not None:
        held_out = HeldOut(episodes_from=round(0.8 * len(episodes)))
    noise = {
        n: sd
        for i, (n, sd) in enumerate(world.noise.items())
        if world.noise_known and not (world.velocities == "differentiated" and i % 2)
    }
    return Recording(
        system=world.system,
        state=state,
        action=Channels.of(system.action),
        episodes=tuple(episodes),
        dt=world.dt,
        parameters=world.parameters,
        integrator=world.integrator,
        velocities=world.velocities,
        clock=world.clock,
        noise=noise,
        held_out=held_out,
    )


def _differentiated(positions: FloatArray, world: World) -> FloatArray:
    """(K + 1, C) velocities as users make them of positions."""
    if world.smoothing == "savgol":
        return np.asarray(savgol_filter(positions, 7, 2, deriv=1, delta=world.dt, axis=0))
    return np.asarray(np.gradient(positions, world.dt, axis=0))


def _shortened(truth: Run, kept: FloatArray) -> Run:
    """The run as far as every episode that was kept lasted."""
    count = int(kept[kept > 0].min())
    rows = kept > 0
    n = truth.per_sample
    return Run(
        truth.fine[: (count - 1) * n + 1, rows],
        truth.h,
        truth.commands[: count - 1, rows],
        truth.clean[:count, rows],
        truth.measured[:count, rows],
        truth.hidden[:count, rows],
        truth.clock[rows],
        truth.wall[rows],
    )


def _write_truth(path: Path, concealed: Concealed) -> None:
    """Readings without noise and the true model's residual rates; equal worlds give equal bytes."""
    clean = np.concatenate([e.states for e in concealed.clean.episodes])
    rows = np.array([len(e.t) for e in concealed.clean.episodes])
    np.savez(path, clean=clean, rows=rows, own=concealed.one_step.own, episode=concealed.one_step.episode)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
