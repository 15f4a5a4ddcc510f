"""What is dear to find out about the diagnosis of a machine, kept in OUT/equivalents beside the others."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.files import plain, write_json, written_whole
from gpsim.mjcf import in_its_columns
from gpsim.recordings import Recording, read_recording
from gpsim.simulators import Simulator, make_simulator
from gpsim.trials.blinding import PUBLIC, Answer, even_recording, recording_folders
from gpsim.trials.rivals.cache import EQUIVALENTS
from gpsim.trials.rivals.held_out_rollouts import rollouts_over_truth
from gpsim.trials.rivals.machine_judge import Identity, MachineJudge, Seen
from gpsim.trials.rivals.robot_rivals import clean_recording, said_of
from gpsim.trials.rivals.rough_rivals import main_world
from gpsim.trials.truth import run
from gpsim.trials.worlds import TrueEffect, World, effect_json, sound

VERSION = 2  # of the rules: raise it whenever something else may come of them
Json = Mapping[str, Any]


@dataclass(frozen=True)
class MachineListing:
    """seen: of every own effect of the machine, in the answer's order; stands: claim -> the effect that it stands for.

    values: the true values of all effects, or, where one stands for another, those that go with it; equivalent: of the
    leader and of every alternative, whether it loses nothing as a whole; rollouts: channel -> error over the truth's.
    """

    seen: tuple[Seen, ...]
    stands: Mapping[Identity, Identity]
    values: tuple[Json, ...]
    equivalent: tuple[bool, ...]
    rollouts: Mapping[str, float]


def machine_listing(
    out: Path, name: str, answer: Answer, outcome: Json, report: Json | None
) -> MachineListing:
    """The listing of a revealed diagnosis, from OUT/equivalents or made now and kept there."""
    said = said_of(report)
    path = out / EQUIVALENTS / f"{name}.json"
    identity: dict[str, Any] = plain(
        {
            "machine_version": VERSION,
            "answer_sha256": outcome["answer_sha256"],
            "recording": outcome["recording"],
            "said": [[_plain(e) for e in effects] for effects in said],
        }
    )
    kept = _read(path)
    if any(kept.get(key) != value for key, value in identity.items()):
        started = time.monotonic()
        kept = identity | _made(out / PUBLIC / name, answer, report, said)
        kept["seconds"] = round(time.monotonic() - started, 2)
        path.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(path) as made:
            write_json(made, plain(kept))
        kept = _read(path)
    return MachineListing(
        tuple(Seen(**s) for s in kept["seen"]),
        {(a, b): (c, d) for (a, b), (c, d) in kept["stands"]},
        tuple(kept["values"]),
        tuple(kept["equivalent"]),
        {k: float("inf") if v is None else v for k, v in kept["rollouts"].items()},
    )


def _made(
    public: Path, answer: Answer, report: Json | None, said: Sequence[Sequence[Json]]
) -> dict[str, Any]:
    world, folder = answer.world, recording_folders(public)[0]
    clean, recording, simulator = _opened(answer, folder)
    judge = MachineJudge(clean, simulator, world.main, _sensors(world))
    explanations = [list(map(_as_true, effects)) for effects in said]
    leader = explanations[0] if explanations else []
    standing = judge.standing(leader)
    rollouts: dict[str, float] = {}
    if report is not None:
        held = [str(n) for n in report["fit"]["held_out"]]
        rollouts = rollouts_over_truth(recording, simulator, held, world.main, leader)
    return {
        "seen": [asdict(s) for s in judge.seen],
        "stands": [[list(claim), list(effect)] for claim, effect in standing.stands.items()],
        "values": [effect_json(e) for e in standing.effects],
        "equivalent": [judge.equivalent(effects) for effects in explanations],
        "rollouts": rollouts,
    }


def _opened(answer: Answer, folder: Path) -> tuple[Recording, Recording, Simulator]:
    """The recording without noise and as it was published, and the simulator that is believed."""
    published = read_recording(folder)
    if published.model is None:
        return _yardstick(answer), published, make_simulator(answer.world.system)
    clean, simulator = clean_recording(answer, folder)
    return clean, in_its_columns(published, simulator), simulator


def _yardstick(answer: Answer) -> Recording:
    """The noise-free recording of the machine with its own effects alone, and noise that stands for all else."""
    world = main_world(answer)
    truth = run(world, world.effects)
    recording = even_recording(world, truth.clean, truth, np.asarray(sound(world, truth.sampled)))
    return replace(recording, noise=dict(world.noise), held_out=None)


def _sensors(world: World) -> dict[str, float]:
    """Channel -> noise of its sensor, and of the steps in which it counts."""
    steps = world.rough.quantum if world.rough else {}
    return {n: float(np.hypot(sd, steps.get(n, 0.0) / np.sqrt(12.0))) for n, sd in world.noise.items()}


def _as_true(effect: Json) -> TrueEffect:
    on = effect["on"] if isinstance(effect["on"], str) else ",".join(map(str, effect["on"]))
    region = {k: (float(low), float(high)) for k, (low, high) in effect["region"].items()}
    values = {n: float(p["value"]) for n, p in effect["parameters"].items()}
    return TrueEffect(str(effect["family"]), on, values, region, effect["since"])


def _plain(effect: Json) -> list[Any]:
    return [effect["family"], effect["on"], {n: p["value"] for n, p in effect["parameters"].items()}]


def _read(path: Path) -> dict[str, Any]:
    """What is kept; nothing where it is missing or damaged."""
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return {}
    return content
