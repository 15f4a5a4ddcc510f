"""The sweep over the action space: its plan as a file, and its run on the stand-in through a bag and the importer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from gpsim.channels import FloatArray
from gpsim.environments import Sweep, drive_plan
from gpsim.errors import UsageError
from gpsim.files import Json, written_whole
from gpsim.recordings import ChannelSource, parse_mapping
from gpsim.recordings.export import Topics, write_ros1_bag, write_ros2_bag
from gpsim.settings import positive
from gpsim.stages.building import base_plant, make_task, target_plant
from gpsim.stages.import_log import changes_of, read_logs, resolved_mapping, write_import
from gpsim.stages.stage import Request, generator
from gpsim.targets import Limo
from gpsim.tasks import GoalReaching

ROS1_BAG, ROS2_BAG, PLAN = Path("bags/drive.bag"), Path("bags/drive_ros2"), "plan.csv"


def plan_table(config: Mapping[str, Any]) -> pd.DataFrame:
    """One row a control step: t [s] and the commanded channels, in the order in which a robot plays them."""
    plan, base = _commands(config), base_plant(config)
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


def check_sweep(config: Mapping[str, Any]) -> None:
    """Raise UsageError for settings with which no sweep can be driven, logged and read again."""
    _commands(config), _car(config), _topics(config)


def run_sweep(request: Request, folder: Path) -> Json:
    """Play the plan on the stand-in; write plan.csv, a ROS 1 and a ROS 2 bag, and the recording read from the first."""
    section, target, task = request.config["collect"], _car(request.config), _task(request.config)
    log, returns = drive_plan(
        target, _commands(request.config), task.floor, generator(request.seed, "collect/episodes")
    )
    plan_table(request.config).to_csv(folder / PLAN, index=False, lineterminator="\n")
    (folder / ROS1_BAG).parent.mkdir()
    topics = _topics(request.config)
    write_ros1_bag(folder / ROS1_BAG, log, topics)
    write_ros2_bag(folder / ROS2_BAG, log, topics)
    recording, report, _ = read_logs([folder / ROS1_BAG], sweep_mapping(request.config), changes_of(section))
    write_import(recording, report, folder)
    return {"transitions": recording.transition_count, "put_back": returns}


def sweep_mapping(config: Mapping[str, Any]) -> str:
    """The mapping through which a sweep's bag is read, by name or file; raises UsageError where there is none."""
    mapping = config["collect"]["mapping"]
    if mapping is None:
        raise UsageError(
            "collect.policy=sweep: name the mapping that reads its bag: collect.mapping=limo_optitrack"
        )
    return str(mapping)


def _commands(config: Mapping[str, Any]) -> FloatArray:
    section, task = config["collect"], _task(config)
    if "speeds" not in section:
        raise UsageError("collect: no sweep is configured; choose experiment=limo")
    sweep = Sweep(*(positive(section[key], f"collect.{key}") for key in ("speeds", "turns", "hold")))
    low, high = np.array([task.speed, task.turn], dtype=np.float64).T
    return sweep.commands(low, high)


def _task(config: Mapping[str, Any]) -> GoalReaching:
    task = make_task(config)
    if not isinstance(task, GoalReaching):
        raise UsageError(
            "a sweep needs the bounds of speed and turn rate that the Limo's task has: choose experiment=limo"
        )
    return task


def _car(config: Mapping[str, Any]) -> Limo:
    target = target_plant(config)
    if not isinstance(target, Limo):
        raise UsageError(
            "collect.policy=sweep drives a vehicle: choose target=limo, or another collect.policy"
        )
    return target


def _topics(config: Mapping[str, Any]) -> Topics:
    """The topics that the mapping with its changes will look for: one of commands and one of poses."""
    section, base = config["collect"], base_plant(config)
    name = sweep_mapping(config)
    plan = parse_mapping(resolved_mapping(name, changes_of(section)), f"mapping {name}")
    return Topics(
        command=_one_topic(name, plan.action, base.action.names),
        pose=_one_topic(name, plan.state, base.state.names),
    )


def _one_topic(mapping: str, sources: Sequence[ChannelSource], wanted: tuple[str, ...]) -> str:
    channels, topics = [source.channel.name for source in sources], {source.topic for source in sources}
    topic = next(iter(topics), None)
    if channels != list(wanted) or len(topics) != 1 or topic is None:
        said = ", ".join(f"{source.channel.name} (topic {source.topic})" for source in sources)
        raise UsageError(
            f"collect.mapping={mapping}: a sweep's bag holds {', '.join(wanted)} under one topic, the mapping looks "
            f"for {said}; choose collect.mapping=limo_optitrack, or the same topic for all of them (collect.changes)"
        )
    return topic
