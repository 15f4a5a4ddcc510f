"""From configuration sections to the objects they describe.

Whether the target that is driven is another one than was recorded.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.artifacts import MANIFEST, read_manifest
from gpsim.corrected import Features
from gpsim.errors import UsageError
from gpsim.gp import Bounds, ChainSettings, FitSettings, Interval
from gpsim.mjcf import open_simulator
from gpsim.mjcf.gym_task import GymTask, is_gym_task
from gpsim.policies import BeamSearch, balance_search
from gpsim.policies.training.settings import PpoSettings, SacSettings
from gpsim.recordings import Episode, Recording
from gpsim.residuals import Residuals, build_residuals
from gpsim.settings import build, choice, number, positive, share, texts, truth, whole
from gpsim.simulators import INTEGRATORS, Plant, RandomisedPlant, Simulator, SimulatorPlant
from gpsim.stages.stage import Request
from gpsim.targets import ChangedModel, FrictionCartPole, Limo
from gpsim.tasks import TASKS, Task

TARGETS: Mapping[str, type[Plant]] = {
    "friction_cartpole": FrictionCartPole,
    "limo": Limo,
    "changed_model": ChangedModel,
}
RANDOMISED = ("parameters", "actions", "both")
RECORDED = "recording"
"""The target that is known by its logs alone: nothing can be driven."""
ALGORITHMS: Mapping[str, type[PpoSettings] | type[SacSettings]] = {"ppo": PpoSettings, "sac": SacSettings}


def base_plant(config: Mapping[str, Any]) -> SimulatorPlant:
    """The base simulator with its own parameters."""
    simulator, section = open_simulator(_name(config)), config["simulator"]
    integrator = choice(section["integrator"], INTEGRATORS, "simulator.integrator")
    parameters = simulator.defaults(_numbers(section["parameters"], "simulator.parameters"))
    dt = _positive(section["dt"], "simulator.dt")
    return SimulatorPlant(simulator, parameters, integrator, dt)  # type: ignore[arg-type]


def randomised_plant(config: Mapping[str, Any]) -> RandomisedPlant:
    """The base simulator under domain randomisation."""
    base, spread = base_plant(config), config["randomise"]["spread"]
    of = choice(config["randomise"]["of"], RANDOMISED, "randomise.of")
    if of != "actions" and not base.parameters:
        raise UsageError(
            f"simulator {base.simulator.name} has no parameters to randomise: set randomise.of=actions"
        )
    spread = share(spread, "randomise.spread")
    return RandomisedPlant(base.simulator, base.parameters, base.integrator, base.dt, spread, of)  # type: ignore[arg-type]


def drivable(config: Mapping[str, Any]) -> bool:
    """Whether the target can be driven, or is known by its logs alone."""
    return choice(config["target"]["name"], (*TARGETS, RECORDED), "target.name") != RECORDED


def target_plant(config: Mapping[str, Any]) -> Plant:
    """The stand-in for the real system; raises UsageError where there is none."""
    section = config["target"]
    if not drivable(config):
        raise UsageError(
            "target=recording is a log and cannot be driven; give it with collect.source=LOG or recording=DIR, or "
            "choose a simulated target, as target=limo"
        )
    target = build(TARGETS[section["name"]], section, "target")
    simulator = open_simulator(_name(config))
    _check_fits(f"target {section['name']}", target, simulator)
    dt = _positive(config["simulator"]["dt"], "simulator.dt")
    if not math.isclose(target.dt, dt, rel_tol=1e-9):
        raise UsageError(
            f"target.dt={target.dt:g} is not simulator.dt={dt:g}: both use the same control step; set "
            f"target.dt={dt:g}, or remove it (for finer steps, use target.substeps)"
        )
    return target


def make_task(config: Mapping[str, Any]) -> Task:
    """The task."""
    section = config["task"]
    name, simulator = section["name"], open_simulator(_name(config))
    task: Task
    if isinstance(name, str) and is_gym_task(name):
        task = build(GymTask, section, "task", reference=name)
    else:
        task = build(TASKS[choice(name, tuple(TASKS), "task.name")], section, "task")
    _check_fits(f"task {name}", task, simulator)
    if isinstance(task, GymTask) and not math.isclose(task.dt, config["simulator"]["dt"], rel_tol=1e-9):
        raise UsageError(
            f"simulator.dt={config['simulator']['dt']}: {name} takes control steps of {task.dt:g} s"
        )
    return task


def training_settings(config: Mapping[str, Any]) -> PpoSettings | SacSettings:
    """The algorithm that trains policies, and its hyper-parameters."""
    section = config["policy"]
    return build(
        ALGORITHMS[choice(section.get("name", "ppo"), tuple(ALGORITHMS), "policy.name")], section, "policy"
    )


def expert_search(config: Mapping[str, Any], width: int) -> BeamSearch:
    """How an expert looks ahead in the simulator; raises UsageError where nothing says what is near to failure."""
    parameters = base_plant(config).parameters
    if config["task"]["name"] != "balance" or not {"gravity", "pole_half_length"} <= set(parameters):
        raise UsageError(
            "policy.expert_rounds: the expert only works for balancing a cart-pole; set policy.expert_rounds=0"
        )
    return balance_search(parameters["gravity"], parameters["pole_half_length"], width)


def _check_fits(what: str, part: Plant | Task, simulator: Simulator) -> None:
    """Columns go from one to the other by their place: they must have the same names and units, in one order."""
    for kind, has, needs in (
        ("state", simulator.state, part.state),
        ("action", simulator.action, part.action),
    ):
        if not has.same_as(needs):
            raise UsageError(
                f"{what} does not go with simulator {simulator.name}: its {kind} is {needs.listed()}, the "
                f"simulator's is {has.listed()}; choose both, or an experiment"
            )


def _name(config: Mapping[str, Any]) -> str:
    name = config["simulator"]["name"]
    if not isinstance(name, str):
        raise UsageError(f"simulator.name: expected a text, got {name!r}")
    return name


def _numbers(values: Any, where: str) -> dict[str, float]:
    if not isinstance(values, Mapping):
        raise UsageError(f"{where}: expected a mapping of numbers, got {values!r}")
    for key, value in values.items():
        number(value, f"{where}.{key}")
    return dict(values)


def _positive(value: Any, where: str) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not value > 0:
        raise UsageError(f"{where}: expected a positive number, got {value!r}")
    return float(value)


def recording_of(
    base: SimulatorPlant,
    episodes: Sequence[Episode],
    driver: str,
    seed: int,
    noise: Mapping[str, float] | None = None,
    **more: int,
) -> Recording:
    """What was driven, in the base simulator's channels; driver: what drove it; more: what else is known of that."""
    return Recording(
        system=base.simulator.name,
        state=base.state,
        action=base.action,
        episodes=tuple(episodes),
        dt=base.dt,
        parameters=base.parameters,
        integrator=base.integrator,
        velocities="measured" if base.simulator.coordinates else None,
        clock="episode",
        noise=noise or {},
        provenance={"driver": driver, "seed": seed, **more},
    )


def residuals_of(base: SimulatorPlant, episodes: Sequence[Episode], rng: np.random.Generator) -> Residuals:
    """What the base misses of episodes that were driven, none of them held out; rng shuffles the rows."""
    recording = Recording(base.simulator.name, base.state, base.action, tuple(episodes), base.dt)
    model = (base.simulator, base.parameters, base.integrator)
    return build_residuals(recording, *model, test_fraction=0.0, rng=rng, learnt_from=False)


def measured_on(request: Request) -> str | None:
    """In words what a stand-in's figures are of, where the recording is of something else; else None.

    It is where logs are imported, and where `recording=` names one that was not made by driving this very stand-in.
    """
    given, target = request.config["recording"], request.section("target")["target"]
    imported = request.config["collect"]["source"] is not None
    if not drivable(request.config) or (given is None and not imported):
        return None
    if given is not None and (Path(str(given)) / MANIFEST).is_file():
        made = read_manifest(Path(str(given)))
        if made.stage == "collect" and made.manifest["config"].get("target") == target:  # gpsim drove it
            return None
    name = target["name"]
    return f"the simulated target {name}, not on the recording; choose target=recording to evaluate on the recording"


GP_OF_THE_STAGE = ("n_train", "inputs", "settle", "filter", "chain", "observations")
"""Settings of `gp` that say what is fitted, not how."""


def check_gp(request: Request) -> None:
    """Raise UsageError for settings that no fit can have."""
    section = request.config["gp"]
    truth(section.get("filter", False), "gp.filter")
    count_of(request), settle_of(request)
    chain, settings = chain_of(request), fit_settings(request)
    if chain is not None:
        try:
            chain.of_slow(settings), chain.of_fast(settings)
        except ValueError as error:
            raise UsageError(f"gp.chain: {error}") from error
    base = base_plant(request.config)
    Features.of(input_names(request), base.state + base.action)


def input_names(request: Request) -> list[str]:
    """The names of the Gaussian processes' inputs, as configured."""
    return texts(request.config["gp"]["inputs"], "gp.inputs")


def fit_settings(request: Request) -> FitSettings:
    """How the Gaussian processes are fitted, as configured."""
    section = request.config["gp"]
    rest = {key: value for key, value in section.items() if key not in GP_OF_THE_STAGE}
    usual = Bounds().noise_std
    floor = number(rest.pop("noise_floor", usual.low), "gp.noise_floor")
    try:
        bounds = Bounds(noise_std=Interval(floor, usual.high))
    except ValueError as error:
        raise UsageError(f"gp.noise_floor: {error}") from error
    return build(FitSettings, rest, "gp", bounds=bounds)


def chain_of(request: Request) -> ChainSettings | None:
    """How a slow and a fast process share the residual; None: there is one."""
    section = request.config["gp"].get("chain")
    if section is None:
        return None
    if not isinstance(section, Mapping):
        raise UsageError(f"gp.chain: expected settings, as {{least_slow: 1.0}}, or null, got {section!r}")
    return build(ChainSettings, section, "gp.chain")


def settle_of(request: Request) -> int:
    """Control steps that an action must have stood for its row to count."""
    return whole(request.config["gp"].get("settle", 0), "gp.settle")


def count_of(request: Request) -> int:
    """Transitions that the Gaussian processes are conditioned on."""
    return positive(request.config["gp"]["n_train"], "gp.n_train")
