"""evaluate deployed=BAG...: recorded deployments of a policy on the real thing - success, steps, metres, figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from gpsim.artifacts import Artifact, Recipe, WarningLog
from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.evaluation import path_length
from gpsim.files import Json, plain, read_object, write_json
from gpsim.recordings import Episode, Recording, read_recording
from gpsim.reports.canvas import png
from gpsim.reports.loop_figures import figure_deployed
from gpsim.stages import safety
from gpsim.stages.building import base_plant, make_task
from gpsim.stages.import_log import (
    changes_of,
    logs_of,
    read_configured,
    read_mapping,
    salvages,
    source_digests,
)
from gpsim.stages.stage import Request
from gpsim.tasks import GoalReaching

TABLE = "deployments.csv"


class Ended(StrEnum):
    """How a trip was over."""

    REACHED = "reached"
    LEFT = "left the floor"
    LATE = "out of time"
    LOG = "log ended"


def recipe(request: Request) -> Recipe:
    """The logs, how they are read, and where the goal was."""
    section = request.config["collect"]
    config = {
        "task": request.config["task"],
        "goal": _goal(request).tolist(),
        "tolerance": _tolerance(request),
        "control_step": base_plant(request.config).dt,
        "mapping": read_mapping(_mapping(request)),
        "changes": changes_of(section),
        "salvage": salvages(section),
        "deployed": source_digests(_sources(request), _mapping(request), changes_of(section)),
    }
    return Recipe("evaluate", config, {}, {})


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Write deployments.csv (one row a deployment), evaluation.json and figures/deployed.png."""
    task, goal, dt = _task(request), _goal(request), base_plant(request.config).dt
    recording, _, mapping = read_configured(request.config["collect"], _sources(request))
    if recording.state.names[:2] != ("x", "y"):
        raise UsageError(
            f"deployed: the mapping {_mapping(request)} gives no x and y to compare with the goal"
        )
    rows, paths = [], []
    whole = (mapping.get("episodes") or {}).get("by", "file") == "file"
    for name, episode in trips(recording, whole):
        path, ended = trip(episode, task, goal, task.goal_radius + _tolerance(request), dt)
        paths.append(path)
        rows.append(
            {
                "episode": name,
                "reached": int(ended is Ended.REACHED),
                "ended": str(ended),
                "steps": round(float(episode.t[len(path) - 1] - episode.t[0]) / dt),
                "path": float(path_length(path[None])[0]),
                "nearest": float(np.hypot(*(path[:, :2] - goal).T).min()),
            }
        )
    table = pd.DataFrame(rows)
    table.to_csv(folder / TABLE, index=False, lineterminator="\n")
    there = table[table["reached"] == 1]
    summary = {
        "trips": len(table),
        "reached": len(there),
        "rate": float(table["reached"].mean()),
        "steps": float(there["steps"].mean()) if len(there) else None,
        "path": float(there["path"].mean()) if len(there) else None,
    }
    evaluation = {"experiment": request.config["experiment"], "deployed": plain(summary)}
    write_json(folder / "evaluation.json", evaluation)
    (folder / "figures").mkdir()
    mishaps = WarningLog()
    with mishaps.contained("figures/deployed.png is left out"):
        figure = figure_deployed(paths, goal, task.goal_radius, task.floor)
        (folder / "figures" / "deployed.png").write_bytes(png(figure))
    mishaps.write(folder)
    return {}


def trips(recording: Recording, whole: bool) -> list[tuple[str, Episode]]:
    """Every deployment and its name: an episode each, or where a log is one (`whole`) all that is known of it.

    The cameras may lose a robot on its way, and find it again.
    """
    origins = recording.provenance.get("sources") or {}
    groups: dict[str, list[Episode]] = {}
    for episode in recording.episodes:
        log = origins.get(episode.name, {}).get("log")
        groups.setdefault(str(log) if whole and log else episode.name, []).append(episode)
    found = []
    for parts in groups.values():
        name = parts[0].name
        log = (origins.get(name) or {}).get("log")  # which is told where it is known
        found.append((name if log is None else f"{name} ({log})", _joined(parts, origins)))
    return found


def _joined(parts: Sequence[Episode], origins: Mapping[str, Any]) -> Episode:
    """The pieces of one log, on its clock; what was commanded in between is not known, and not asked."""
    if len(parts) == 1:
        return parts[0]
    begun = [float(origins[part.name]["start_s"]) for part in parts]
    times = [start + part.t - part.t[0] for start, part in zip(begun, parts, strict=True)]
    gap = np.full((1, parts[0].actions.shape[1]), np.nan)
    actions = [a for part in parts for a in (part.actions, gap)][:-1]
    states = np.concatenate([part.states for part in parts])
    return Episode(parts[0].name, np.concatenate(times), states, np.concatenate(actions))


def trip(
    episode: Episode, task: GoalReaching, goal: FloatArray, radius: float, dt: float
) -> tuple[FloatArray, Ended]:
    """The measured states (K + 1, S) until the trip is over, and how it ended, by the rules of the simulated ones.

    It is over where the goal (2,) is within `radius` [m], where the centre is outside the task's floor about the
    origin, and max_steps control steps of `dt` [s] after its first sample.
    """
    steps = (episode.t - episode.t[0]) / dt
    states = episode.states[steps < task.max_steps + 0.5]  # no clock is exact
    near = np.hypot(*(states[:, :2] - goal).T) <= radius
    over = np.flatnonzero(near | task.outside(states))
    if over.size:
        return states[: over[0] + 1], Ended.REACHED if near[over[0]] else Ended.LEFT
    return states, Ended.LATE if steps[-1] >= task.max_steps - 0.5 else Ended.LOG


def notes(artifact: Artifact) -> list[str]:
    """One line a deployment, and the sum."""
    table = pd.read_csv(artifact.path / TABLE)
    summary = read_object(artifact.path / "evaluation.json")["deployed"]
    lines = [
        f"{row.episode}: {'reached' if row.reached else f'not reached ({row.ended}), {row.nearest:.3f} m at best'} "
        f"in {row.steps} steps, {row.path:.2f} m"
        for row in table.itertuples()
    ]
    lines.append(f"{summary['reached']} of {summary['trips']} deployments reached the goal")
    figure = artifact.path / "figures" / "deployed.png"
    return [*lines, f"figure: {figure}"] if figure.is_file() else lines


def _sources(request: Request) -> list[Path]:
    return logs_of(request.config["deployed"], "deployed")


def _mapping(request: Request) -> str:
    mapping = request.config["collect"]["mapping"]
    if mapping is None:
        raise UsageError("deployed: name the mapping that reads the logs: collect.mapping=limo_optitrack")
    return str(mapping)


def _task(request: Request) -> GoalReaching:
    task = make_task(request.config)
    if not isinstance(task, GoalReaching):
        raise UsageError("deployed: only a task with a goal is scored from logs; choose experiment=limo")
    return task


def _tolerance(request: Request) -> float:
    given = request.config["deployed_tolerance"]
    if isinstance(given, bool) or not isinstance(given, int | float) or not given >= 0:
        raise UsageError(f"deployed_tolerance: expected a length of at least 0 m, got {given!r}")
    return float(given)


def _goal(request: Request) -> FloatArray:
    given = request.config["deployed_goal"]
    goal = _task(request).evaluation_goal if given is None else given
    listed = goal if isinstance(goal, list | tuple) else ()
    numbers = [value for value in listed if isinstance(value, int | float) and not isinstance(value, bool)]
    if len(numbers) != 2 or len(listed) != 2:
        raise UsageError(f"deployed_goal: expected [x, y] in metres, got {given!r}")
    found = np.array(numbers, dtype=np.float64)
    if (task := _task(request)).outside(found[None]).any():
        raise UsageError(
            f"deployed_goal: {numbers} is outside the floor ({task.floor:g} m square around the origin), where a trip "
            "ends; set the floor with task.floor="
        )
    return found


def replay(request: Request, logs: Sequence[Path]) -> Json:
    """Of every drive in the logs when and why it would have been stopped, and what false stops were stated.

    logs: raw ones, read by collect.mapping, or the folder of a recording.
    """
    safety.check(request)
    for log in logs:
        if not log.exists():
            raise UsageError(f"{log}: no such log; give a bag, a table, or the folder of a recording")
    if len(logs) == 1 and (logs[0] / "recording.yaml").is_file():
        recording, whole = read_recording(logs[0]), False
    else:
        recording, _, raw = read_configured(request.config["collect"], logs)
        whole = (raw.get("episodes") or {}).get("by", "file") == "file"  # each of its logs is one drive
    drives = safety.watched(request, recording, trips(recording, whole))
    settings = safety.settings_of(request)
    return {"drives": drives, "stated_false_stops": settings.false_stops, "minutes": settings.minutes}


def replay_lines(found: Json) -> list[str]:
    """A line a drive, and how often nothing would have been stopped."""
    lines = []
    for drive in found["drives"]:
        said = f"{drive['seconds']:.1f} s, not stopped"
        if drive["stopped_at"] is not None:
            said = f"stopped after {drive['stopped_at']:.2f} of {drive['seconds']:.1f} s ({drive['why']})"
        lines.append(f"{drive['drive']}: {said}")
    stopped = sum(drive["stopped_at"] is not None for drive in found["drives"])
    lines.append(
        f"{stopped} of {len(found['drives'])} drives would have been stopped; stated: a false stop in "
        f"{found['minutes']:g} minutes with a probability of {found['stated_false_stops']:g} at most"
    )
    return lines
