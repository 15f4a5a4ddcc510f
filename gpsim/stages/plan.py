"""plan: the commands to play next, so that what a diagnosis left open is decided, and safely."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from gpsim.artifacts import Artifact, Recipe, read_artifact
from gpsim.channels import FloatArray
from gpsim.corrected import EffectsPlant
from gpsim.diagnosis import Explanation, LeftOpen
from gpsim.diagnosis.run import Run, cores
from gpsim.errors import UsageError
from gpsim.files import Json, plain
from gpsim.planning import STATED, Limits, Machine, Plan, PlanSettings, limits_of, make_plan
from gpsim.recordings import Episode, read_yaml, write_recording
from gpsim.settings import build
from gpsim.simulators import Plant, Simulator
from gpsim.stages.building import base_plant, recording_of, target_plant
from gpsim.stages.diagnose import read_corrected, read_diagnosis, read_left_open
from gpsim.stages.stage import SOURCES, Progress, Request, Stage, blamed, generator, silent, stage_about

FORMAT = 1
COMMANDS, FACTS, PAGE = "plan.csv", "plan.yaml", "report.html"
SCHEMA = "gpsim.plan/1"
SAME = 1e-6  # relative difference of two control steps that is rounding


@dataclass(frozen=True)
class Played:
    """A finished plan: commands (K, A) in episodes, the state in which each begins; facts: all of plan.yaml."""

    commands: tuple[FloatArray, ...]
    start: FloatArray
    facts: Mapping[str, Any]


def stage_for(diagnoses: Sequence[Path], minutes: float, anew: bool = False) -> Stage:
    """The stage for finished diagnoses of one machine, whose explanations are told apart together."""
    return stage_about("plan", _recipe, _write, diagnoses, minutes, anew, format=FORMAT, code=SOURCES)


def planned(
    posterior: LeftOpen,
    plant: EffectsPlant,
    section: Mapping[str, Any],
    minutes: float,
    rng: np.random.Generator,
    progress: Progress | None = None,
    processes: int = 1,
    anew: bool = False,
) -> tuple[Plan, Limits]:
    """The plan of a posterior under the settings and limits of a section; raises UsageError."""
    settings = build(PlanSettings, {k: v for k, v in section.items() if k not in STATED}, "plan")
    stated = {k: section[k] for k in STATED if k in section}
    limits = limits_of(stated, plant.simulator, posterior.visited)
    with blamed(plant.simulator.name), cores(processes) as workers:
        machine = Machine(plant.simulator, plant.parameters, plant.dt, plant.substeps, Run(workers))
        return make_plan(machine, posterior, limits, settings, minutes, rng, progress or silent, anew), limits


def together(posteriors: Sequence[LeftOpen]) -> LeftOpen:
    """The explanations of several diagnoses, of those that claim the same the first; noise and places of the first."""
    found: dict[frozenset[tuple[str, str]], Explanation] = {}
    for one in (e for posterior in posteriors for e in posterior.explanations):
        found.setdefault(one.hypothesis.claims, one)
    total = sum(e.probability for e in found.values())
    explanations = tuple(replace(e, probability=e.probability / total) for e in found.values())
    return posteriors[0] if len(posteriors) == 1 else replace(posteriors[0], explanations=explanations)


def read_plan(folder: Path, simulator: Simulator, dt: float) -> Played:
    """A finished plan for this simulator at this control step; raises UsageError."""
    path = read_artifact(folder, "plan").path
    facts = read_yaml(path / FACTS)
    names = list(simulator.action.names)
    if facts["action"] != simulator.action.units or facts["state"] != simulator.state.units:
        raise UsageError(
            f"--plan {folder}: is of {facts['simulator']}, whose channels are not those of {simulator.name}"
        )
    if abs(facts["dt"] - dt) > SAME * dt:
        raise UsageError(
            f"--plan {folder}: one command every {facts['dt']:g} s, the target takes one every {dt:g} s"
        )
    table = pd.read_csv(path / COMMANDS)
    episodes = table.groupby("episode", sort=True) if "episode" in table else [(0, table)]
    start = np.array([facts["rest"][name] for name in simulator.state.names])
    return Played(tuple(part[names].to_numpy(dtype=np.float64) for _, part in episodes), start, facts)


def _recipe(request: Request, diagnoses: Sequence[Path], minutes: float, anew: bool) -> Recipe:
    if not minutes > 0.0:
        raise UsageError(f"--minutes: expected more than 0, got {minutes:g}")
    _plant(diagnoses)
    made = {
        f"diagnosis_{i}" if i else "diagnosis": read_artifact(d, "diagnose") for i, d in enumerate(diagnoses)
    }
    config = {**request.section("plan"), "minutes": minutes, "anew": anew}
    return Recipe("plan", config, made, {"seed": request.seed})


def _plant(diagnoses: Sequence[Path]) -> EffectsPlant:
    """The machine; raises UsageError where there is nothing to plan for, or the diagnoses are of several machines."""
    for folder in diagnoses:
        if read_diagnosis(folder).verdict == "none":
            raise UsageError(
                f"{folder}: its verdict is none: nothing is missing, and there is nothing to plan for"
            )
    plants = [read_corrected(folder) for folder in diagnoses]
    for folder, plant in zip(diagnoses, plants, strict=True):
        same = plant.simulator.name == plants[0].simulator.name and plant.parameters == plants[0].parameters
        if not same or abs(plant.dt - plants[0].dt) > SAME * plant.dt:
            raise UsageError(
                f"{folder}: is of another simulator, its parameters or control step than {diagnoses[0]}"
            )
    return plants[0]


def _write(request: Request, folder: Path, diagnoses: Sequence[Path], minutes: float, anew: bool) -> Json:
    from gpsim.reports.plan_page import plan_facts, plan_page

    plant, posterior = _plant(diagnoses), together([read_left_open(d) for d in diagnoses])
    section, rng = request.config["plan"], generator(request.seed, "plan")
    plan, limits = planned(posterior, plant, section, minutes, rng, request.progress, request.cores, anew)
    state, action = plant.simulator.state, plant.simulator.action
    table: dict[str, Any] = {"episode": plan.episode.astype(int)} if anew else {}
    table |= {"t": np.round(plan.t, 9)} | {n: plan.commands[:, i] for i, n in enumerate(action.names)}
    pd.DataFrame(table).to_csv(folder / COMMANDS, index=False, lineterminator="\n")
    box = {n: [limits.box_low[i], limits.box_high[i]] for i, n in enumerate(state.names)}
    facts = {
        "schema": SCHEMA,
        "simulator": plant.simulator.name,
        "state": dict(state.units),
        "action": dict(action.units),
        "commands": {n: [limits.low[i], limits.high[i]] for i, n in enumerate(action.names)},
        "rates": {n: limits.rate[i] for i, n in enumerate(action.names)},
        "box": box,
        "rest": {n: limits.rest[i] for i, n in enumerate(state.names)},
        **plan_facts(plan),
    }
    text = yaml.safe_dump(plain(facts), sort_keys=False, allow_unicode=True)
    (folder / FACTS).write_text(text, encoding="utf-8")
    finite = {n: [v for v in edges if np.isfinite(v)] for n, edges in box.items()}
    (folder / PAGE).write_text(plan_page(plan, state, action, finite), encoding="utf-8")
    return {}


def plan_of(artifact: Artifact) -> Mapping[str, Any]:
    """What plan.yaml of a finished plan says."""
    return dict(read_yaml(artifact.path / FACTS))


def play_stage(plan: Path) -> Stage:
    """The stage for a finished plan; its recording is of the stage `collect`."""
    return stage_about("collect", _played_recipe, _play, plan, format=1)


def _played_recipe(request: Request, plan: Path) -> Recipe:
    _opened(request, plan)
    parents = {"plan": read_artifact(plan, "plan")}
    return Recipe("collect", request.section("simulator", "target"), parents, {"seed": request.seed})


def _opened(request: Request, plan: Path) -> Played:
    target = target_plant(request.config)
    return read_plan(plan, base_plant(request.config).simulator, target.dt)


def _play(request: Request, folder: Path, plan: Path) -> Json:
    played, base, target = _opened(request, plan), base_plant(request.config), target_plant(request.config)
    rng = generator(request.seed, "collect/episodes")
    episodes = tuple(
        _episode(target, str(i), played.start, commands, rng) for i, commands in enumerate(played.commands)
    )
    recording = recording_of(base, episodes, "plan", request.seed)
    write_recording(recording, folder)
    return {"transitions": recording.transition_count}


def _episode(
    target: Plant, name: str, start: FloatArray, commands: FloatArray, rng: np.random.Generator
) -> Episode:
    state, memory = start[None].copy(), target.begin(1, rng)
    seen = [target.measure(state, memory, rng)[0]]
    for command in commands:
        state = target.step(state, command[None], memory, rng)
        seen.append(target.measure(state, memory, rng)[0])
    return Episode(name, target.dt * np.arange(len(commands) + 1, dtype=np.float64), np.stack(seen), commands)
