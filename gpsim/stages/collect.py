"""collect: drive the target and record what happens, or import what was recorded of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from gpsim import environments
from gpsim.artifacts import Recipe
from gpsim.channels import FloatArray
from gpsim.corrected import CorrectedPlant, Features, GpCorrection
from gpsim.environments import Act, ActiveSettings, Model
from gpsim.errors import UsageError
from gpsim.files import Json, written_whole
from gpsim.gp import Predictor, fit_outputs
from gpsim.recordings import ChannelSource, Episode, parse_mapping, write_recording
from gpsim.recordings.export import Topics, write_ros1_bag, write_ros2_bag
from gpsim.settings import build, choice, number, positive, share
from gpsim.stages import building, import_log, train_source
from gpsim.stages.building import base_plant, make_task, recording_of, residuals_of, target_plant
from gpsim.stages.import_log import changes_of, read_mapping, salvages
from gpsim.stages.policy_files import read_policy
from gpsim.stages.stage import Request, Stage, generator
from gpsim.targets import Limo
from gpsim.tasks import GoalReaching

ACTIVE = "active"
ON_THE_WAY = 60  # iterations of a fit


def active(request: Request) -> bool:
    """Whether uncertainty drives; raises UsageError for another word."""
    said = request.config["strategy"]
    return said is not None and choice(said, (ACTIVE,), "strategy") == ACTIVE


def _fitted(request: Request, settings: ActiveSettings, episodes: Sequence[Episode]) -> Model:
    """The corrected simulator of what was recorded so far, of a part of it drawn by seed."""
    base = base_plant(request.config)
    residuals = residuals_of(base, episodes, generator(request.seed, "collect/active/order"))
    features = Features.of(building.input_names(request), residuals.channels)
    rows, fit = residuals.training_rows(settings.n_train), building.fit_settings(request)
    # A fit on the way says where to drive next; the one that counts is fit-gp's.
    most = min(fit.max_iterations, ON_THE_WAY)
    quick = replace(fit, restarts=min(fit.restarts, 1), max_iterations=most)
    rng = generator(request.seed, "collect/active/fit")
    try:
        gps = fit_outputs(features(residuals.inputs[rows]), residuals.values[rows], quick, rng)
    except ValueError as error:
        raise UsageError(f"strategy=active: no Gaussian process fits the recording ({error})") from error
    predictor = Predictor(gps)
    correction = GpCorrection(predictor, features, "mean", sample_noise=False)
    plant = CorrectedPlant(base.simulator, base.parameters, base.integrator, base.dt, correction)
    return Model(plant, predictor, features)


ROS1_BAG, ROS2_BAG, PLAN = Path("bags/drive.bag"), Path("bags/drive_ros2"), "plan.csv"
DRIVERS = ("source", "random", "dithered", "sweep")


def recipe(request: Request) -> Recipe:
    """The target, the task and who drives; or the logs and how they are read."""
    section = request.config["collect"]
    if section["source"] is not None:
        mapping, changes = _mapping(request), changes_of(section)
        read = {
            "mapping": read_mapping(mapping) if mapping is not None else None,
            "salvage": salvages(section),
            "changes": changes,
            "sources": import_log.source_digests(_sources(request), mapping, changes),
        }
        return Recipe("collect", {"import": read}, {}, {})
    check(request)
    driver = section["policy"]
    by_policy = driver not in ("random", "sweep") and not active(request)
    parents = {"policy": train_source.STAGE.need(request.having(variant="source"))} if by_policy else {}
    config = request.section("simulator", "target", "task", "collect")
    if active(request):
        config |= request.section("strategy", "active", "gp")
        return Recipe("collect", config, {}, {"seed": request.seed})
    if driver == "sweep":  # which reads what it logged through the mapping
        config["mapping"] = read_mapping(sweep_mapping(request.config))
    return Recipe("collect", config, parents, {"seed": request.seed})


def waits_for_policy(request: Request) -> bool:
    """Whether the configuration's `collect` is driven by the source policy."""
    section = request.config["collect"]
    if active(request):
        return False
    return section["source"] is None and section["policy"] in ("source", "dithered")


def check(request: Request) -> None:
    """Raise UsageError for settings with which nothing can be recorded."""
    section = request.config["collect"]
    changes_of(section), salvages(section)
    if section["source"] is not None:
        if (mapping := _mapping(request)) is not None:
            read_mapping(mapping)
        for source in _sources(request):
            try:
                source.stat()
            except OSError as error:
                raise UsageError(f"collect.source: {source}: cannot be read ({error.strerror})") from error
        return
    target_plant(request.config)
    if section["transitions"] is not None:
        positive(section["transitions"], "collect.transitions")
    if not number(section["noise"], "collect.noise") >= 0:
        raise UsageError(f"collect.noise: expected a number of at least 0, got {section['noise']!r}")
    share(section["missing"], "collect.missing")
    if active(request):
        build(ActiveSettings, request.config["active"], "active")
        building.check_gp(request)
    elif choice(section["policy"], DRIVERS, "collect.policy") == "sweep":
        _commands(request.config), _car_and_topics(request.config)
    else:
        positive(section["episodes"], "collect.episodes")
        if not 0 <= number(section["dither"], "collect.dither") <= 1:
            raise UsageError(f"collect.dither: expected a number in [0, 1], got {section['dither']!r}")


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Run the episodes, or read the logs, and write a Recording."""
    if request.config["collect"]["source"] is not None:
        recording, report, _ = import_log.read_configured(request.config["collect"], _sources(request))
        import_log.write_import(recording, report, folder)
        return {"transitions": recording.transition_count}
    section: dict[str, Any] = request.config["collect"]
    if section["policy"] == "sweep" and not active(request):
        return run_sweep(request, folder)
    base, driver = base_plant(request.config), ACTIVE if active(request) else section["policy"]
    episodes = _driven(request, recipe)
    sensed, noise = environments.as_sensed(
        environments.first_of(episodes, section["transitions"]),
        base.state,
        float(section["noise"]),
        float(section["missing"]),
        generator(request.seed, "collect/sensors"),
    )
    recording = recording_of(base, sensed, driver, request.seed, noise)
    write_recording(recording, folder)
    return {"transitions": recording.transition_count}


def _driven(request: Request, recipe: Recipe) -> tuple[Episode, ...]:
    if active(request):  # to where the Gaussian processes of `gp` are least sure
        settings = build(ActiveSettings, request.config["active"], "active")
        return environments.collect_actively(
            target_plant(request.config),
            make_task(request.config).on_target(),
            lambda episodes: _fitted(request, settings, episodes),
            settings,
            generator(request.seed, "collect/active"),
            request.progress,
        )
    section = request.config["collect"]
    return environments.collect_episodes(
        target_plant(request.config),
        make_task(request.config).on_target(),
        _driver(request, recipe, section),
        positive(section["episodes"], "collect.episodes"),
        generator(request.seed, "collect/episodes"),
    )


def _sources(request: Request) -> list[Path]:
    return import_log.logs_of(request.config["collect"]["source"], "collect.source")


def _mapping(request: Request) -> str | None:
    given = request.config["collect"]["mapping"]
    return None if given is None else str(given)


def _driver(request: Request, recipe: Recipe, section: dict[str, Any]) -> Act:
    task, rng = make_task(request.config), generator(request.seed, "collect/driver")
    if section["policy"] == "random":
        return environments.random_actor(task, rng)
    # The policy's own distribution, not its most probable action: exploration is what a recording is for.
    actor = environments.policy_actor(read_policy(recipe.parents["policy"].path), rng)
    if section["policy"] == "source":
        return actor
    return environments.dithered_actor(actor, task, float(section["dither"]), rng)


def plan_table(config: Mapping[str, Any]) -> pd.DataFrame:
    """One row a control step: t [s] and the commanded channels, in the order in which a robot plays them."""
    (_, plan), base = _commands(config), base_plant(config)
    columns = {name: plan[:, i] for i, name in enumerate(base.action.names)}
    return pd.DataFrame({"t": np.round(base.dt * np.arange(len(plan)), 9)} | columns)


def write_plan(config: Mapping[str, Any], path: Path) -> int:
    """Write the plan to a new CSV file; returns the number of its rows."""
    if path.exists():
        raise UsageError(f"--plan {path}: exists already; choose another file")
    table = plan_table(config)
    try:
        with written_whole(path) as made:
            table.to_csv(made, index=False, lineterminator="\n")
    except OSError as error:
        raise UsageError(f"--plan {path}: cannot be written: {error.strerror or error}") from error
    return len(table)


def run_sweep(request: Request, folder: Path) -> Json:
    """Play the plan on the stand-in; write plan.csv, a ROS 1 and a ROS 2 bag, and the recording read from the first."""
    task, commands = _commands(request.config)
    target, topics = _car_and_topics(request.config)
    log, returns = environments.drive_plan(
        target, commands, task.floor, generator(request.seed, "collect/episodes")
    )
    plan_table(request.config).to_csv(folder / PLAN, index=False, lineterminator="\n")
    (folder / ROS1_BAG).parent.mkdir()
    write_ros1_bag(folder / ROS1_BAG, log, topics)
    write_ros2_bag(folder / ROS2_BAG, log, topics)
    changes = changes_of(request.config["collect"])
    recording, report, _ = import_log.read_logs([folder / ROS1_BAG], sweep_mapping(request.config), changes)
    import_log.write_import(recording, report, folder)
    return {"transitions": recording.transition_count, "put_back": returns}


def sweep_mapping(config: Mapping[str, Any]) -> str:
    """The mapping through which a sweep's bag is read, by name or file; raises UsageError where there is none."""
    mapping = config["collect"]["mapping"]
    if mapping is None:
        raise UsageError(
            "collect.policy=sweep: name the mapping that reads its bag: collect.mapping=limo_optitrack"
        )
    return str(mapping)


def _commands(config: Mapping[str, Any]) -> tuple[GoalReaching, FloatArray]:
    """The task, whose bounds of speed and turn rate a sweep needs, and the commands."""
    task, section = make_task(config), config["collect"]
    if not isinstance(task, GoalReaching):
        raise UsageError(
            "a sweep needs the bounds of speed and turn rate that the Limo's task has: choose experiment=limo"
        )
    if "speeds" not in section:
        raise UsageError("collect: no sweep is configured; choose experiment=limo")
    sweep = environments.Sweep(
        *(positive(section[key], f"collect.{key}") for key in ("speeds", "turns", "hold"))
    )
    low, high = np.array([task.speed, task.turn], dtype=np.float64).T
    return task, sweep.commands(low, high)


def _car_and_topics(config: Mapping[str, Any]) -> tuple[Limo, Topics]:
    """What is driven, and the topics that the mapping with its changes will look for: of commands and of poses."""
    target, base = target_plant(config), base_plant(config)
    if not isinstance(target, Limo):
        raise UsageError(
            "collect.policy=sweep drives a vehicle: choose target=limo, or another collect.policy"
        )
    name = sweep_mapping(config)
    plan = parse_mapping(import_log.resolved_mapping(name, changes_of(config["collect"])), f"mapping {name}")
    command = _one_topic(name, plan.action, base.action.names)
    return target, Topics(command=command, pose=_one_topic(name, plan.state, base.state.names))


def _one_topic(mapping: str, sources: Sequence[ChannelSource], wanted: tuple[str, ...]) -> str:
    channels, topics = [source.channel.name for source in sources], {source.topic for source in sources}
    topic = next(iter(topics), None)
    if channels != list(wanted) or len(topics) != 1 or topic is None:
        said = ", ".join(f"{source.channel.name} (topic {source.topic})" for source in sources)
        raise UsageError(
            f"collect.mapping={mapping} needs {said}, but the bag of a sweep has {', '.join(wanted)} in one topic; "
            "choose collect.mapping=limo_optitrack, or one topic for all (collect.changes)"
        )
    return topic


STAGE = Stage("collect", recipe, write, format=1)
