"""plan: the commands to play next, so that what a diagnosis left open is decided, and safely."""

from __future__ import annotations

import math
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
from gpsim.diagnosis.run import Run
from gpsim.errors import UsageError
from gpsim.files import Json, plain
from gpsim.planning import STATED, Around, Limits, Machine, Plan, PlanSettings, Steer, limits_of, make_plan
from gpsim.posterior import Explanation, LeftOpen
from gpsim.recordings import Episode, read_yaml, write_recording
from gpsim.settings import build
from gpsim.simulators import Plant, Simulator
from gpsim.stages.building import base_plant, make_task, recording_of, target_plant
from gpsim.stages.diagnose import read_corrected, read_diagnosis, read_left_open
from gpsim.stages.policy_files import policy_artifact, read_policy, write_policy
from gpsim.stages.stage import SOURCES, Progress, Request, Stage, blamed, generator, silent, stage_about

FORMAT = 1
SAME = 1e-6  # relative difference of two control steps that is rounding
COMMANDS, FACTS, PAGE = "plan.csv", "plan.yaml", "report.html"
SCHEMA = "gpsim.plan/1"
DITHER = "_dither"
"""Behind the names of the commands in plan.csv that are added to those of a policy."""


@dataclass(frozen=True)
class Played:
    """A finished plan: commands (K, A) in episodes, the state in which each begins; facts: all of plan.yaml.

    around: what they are dithers of; None where they are played as they are.
    """

    commands: tuple[FloatArray, ...]
    start: FloatArray
    facts: Mapping[str, Any]
    around: Around | None


@dataclass(frozen=True)
class Asked:
    """What is asked beside the settings.

    minutes: how long the plan may take; anew: somebody puts the machine back to rest before each piece; policy: a
    finished one that steers the machine meanwhile.
    """

    minutes: float
    anew: bool = False
    policy: Path | None = None
    seed: int = 0
    progress: Progress = silent
    processes: int = 1


def stage_for(diagnoses: Sequence[Path], asked: Asked) -> Stage:
    """The stage for finished diagnoses of one machine, whose explanations are told apart together."""
    return stage_about("plan", _recipe, _write, diagnoses, asked, format=FORMAT, code=SOURCES)


def planned(
    posterior: LeftOpen, plant: EffectsPlant, section: Mapping[str, Any], asked: Asked
) -> tuple[Plan, Limits]:
    """The plan of a posterior under the settings and limits of a section; raises UsageError."""
    settings = build(PlanSettings, {k: v for k, v in section.items() if k not in STATED}, "plan")
    stated = {k: section[k] for k in STATED if k in section}
    limits = limits_of(stated, plant.simulator, posterior.visited, settings.margin)
    with blamed(plant.simulator.name):
        around = None
        if (steer := steered_by(asked.policy, plant)) is not None:
            around = Around(steer, limits.low, limits.high, limits.rate, limits.idle, plant.dt)
        run, rng = Run(threads=asked.processes), generator(asked.seed, "plan")
        machine = Machine(plant.simulator, plant.parameters, plant.dt, plant.substeps, run, around)
        made = make_plan(machine, posterior, limits, settings, asked.minutes, rng, asked.progress, asked.anew)
        return made, limits


def policy_for(folder: Path, plant: EffectsPlant) -> Artifact:
    """A finished policy that can steer this machine at its control step; raises UsageError."""
    artifact, simulator, dt = policy_artifact(folder), plant.simulator, plant.dt
    config = artifact.manifest["config"]
    task = make_task(config)
    if not (task.state.same_as(simulator.state) and task.action.same_as(simulator.action)):
        raise UsageError(
            f"--policy {folder}: drives {config['simulator']['name']}, whose channels are not those of "
            f"{simulator.name}"
        )
    own = float(config["simulator"]["dt"])
    if not math.isclose(own, dt, rel_tol=SAME):
        raise UsageError(
            f"--policy {folder}: acts every {own:g} s, but the diagnosis has one command every {dt:g} s"
        )
    return artifact


def steering(folder: Path, config: Mapping[str, Any]) -> Steer:
    """What the policy in a folder commands. config: its simulator and task, whose first evaluation start it is given.

    It acts by its most probable action. A policy that picks one of several actions is replaced by their mean, each as
    probable as the policy finds it: between two full pushes there is nothing that a dither could be added to.
    """
    policy, task = read_policy(folder), make_task(config)
    context = task.evaluation_starts(1, np.random.default_rng(0)).context
    picks = policy.bounds is None
    each = task.command(np.arange(task.action_space.n)) if picks else np.empty((0, 0))  # type: ignore[attr-defined]

    def steer(seen: FloatArray) -> FloatArray:
        observations = task.observe(seen, np.repeat(context, len(seen), axis=0))
        if picks:
            return np.asarray(policy.probabilities(observations) @ each)
        return task.command(policy.act(observations))

    return steer


def steered_by(policy: Path | None, plant: EffectsPlant) -> Steer | None:
    """What a finished policy commands of this machine; raises UsageError for one that cannot."""
    if policy is None:
        return None
    made = policy_for(policy, plant)
    return steering(made.path, made.manifest["config"])


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
    around = _around(path, facts, simulator) if "policy" in facts else None
    names = [name + (DITHER if around else "") for name in simulator.action.names]
    return Played(tuple(part[names].to_numpy(dtype=np.float64) for _, part in episodes), start, facts, around)


def _around(folder: Path, facts: Mapping[str, Any], simulator: Simulator) -> Around:
    """The policy that lies beside a plan, under the limits that the plan states."""
    names = simulator.action.names
    low, high = np.array([facts["commands"][name] for name in names], dtype=np.float64).T
    rate, idle = (
        np.array([facts[key][n] for n in names], dtype=np.float64) for key in ("rates", "rest_commands")
    )
    rate[np.isnan(rate)] = np.inf  # YAML has no infinite number: none is stated
    return Around(steering(folder, facts["policy"]), low, high, rate, idle, facts["dt"])


def _recipe(request: Request, diagnoses: Sequence[Path], asked: Asked) -> Recipe:
    if not asked.minutes > 0.0:
        raise UsageError(f"--minutes: expected more than 0, got {asked.minutes:g}")
    plant = _plant(diagnoses)
    made = {
        f"diagnosis_{i}" if i else "diagnosis": read_artifact(d, "diagnose") for i, d in enumerate(diagnoses)
    }
    if asked.policy is not None:
        made["policy"] = policy_for(asked.policy, plant)
    config = {**request.section("plan"), "minutes": asked.minutes, "anew": asked.anew}
    return Recipe("plan", config, made, {"seed": request.seed})


def _plant(diagnoses: Sequence[Path]) -> EffectsPlant:
    """The machine; raises UsageError where there is nothing to plan for, or the diagnoses are of several machines."""
    for folder in diagnoses:
        if read_diagnosis(folder).verdict == "none":
            raise UsageError(
                f"{folder}: its verdict is none: nothing is missing, so there is nothing to plan"
            )
    plants = [read_corrected(folder) for folder in diagnoses]
    for folder, plant in zip(diagnoses, plants, strict=True):
        same = plant.simulator.name == plants[0].simulator.name and plant.parameters == plants[0].parameters
        if not same or abs(plant.dt - plants[0].dt) > SAME * plant.dt:
            raise UsageError(
                f"{folder}: is of another simulator, its parameters or control step than {diagnoses[0]}"
            )
    return plants[0]


def _write(request: Request, folder: Path, diagnoses: Sequence[Path], asked: Asked) -> Json:
    from gpsim.reports.plan_page import plan_facts, plan_page

    plant, posterior = _plant(diagnoses), together([read_left_open(d) for d in diagnoses])
    asked = replace(asked, seed=request.seed, progress=request.progress, processes=request.cores)
    plan, limits = planned(posterior, plant, request.config["plan"], asked)
    state, action = plant.simulator.state, plant.simulator.action
    table: dict[str, Any] = {"episode": plan.episode.astype(int)} if asked.anew else {}
    what = DITHER if asked.policy else ""
    table |= {"t": np.round(plan.t, 9)} | {n + what: plan.commands[:, i] for i, n in enumerate(action.names)}
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
        "rest_commands": {n: limits.idle[i] for i, n in enumerate(action.names)},
        **plan_facts(plan),
    }
    if asked.policy is not None:  # beside its plan, which can then be played where the policy is not
        made = policy_artifact(asked.policy)
        write_policy(folder, read_policy(made.path))
        config = made.manifest["config"]
        facts["policy"] = {"sha256": made.digest, "simulator": config["simulator"], "task": config["task"]}
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
        _episode(target, str(i), played, commands, rng) for i, commands in enumerate(played.commands)
    )
    recording = recording_of(base, episodes, "plan", request.seed)
    write_recording(recording, folder)
    return {"transitions": recording.transition_count}


def _episode(
    target: Plant, name: str, played: Played, commands: FloatArray, rng: np.random.Generator
) -> Episode:
    state, memory = played.start[None].copy(), target.begin(1, rng)
    seen: list[FloatArray] = [target.measure(state, memory, rng)[0]]
    done: list[FloatArray] = []
    for wanted in commands[:, None]:
        command = wanted
        if played.around is not None:
            last = done[-1][None] if done else played.around.idle[None]
            command = played.around.command(seen[-1][None], wanted, last)
        state = target.step(state, command, memory, rng)
        seen.append(target.measure(state, memory, rng)[0])
        done.append(command[0])
    t = target.dt * np.arange(len(commands) + 1, dtype=np.float64)
    return Episode(name, t, np.stack(seen), np.stack(done))
