"""export, view: a policy as ONNX and ROS nodes, a recording, a corrected model, a diagnosis for Foxglove and Rerun."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from gpsim.artifacts import Artifact, read_artifact, read_timings
from gpsim.channels import FloatArray, wrap_angle
from gpsim.corrected import CorrectedPlant, GpCorrection
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Settings, read_settings
from gpsim.errors import UsageError, near_path
from gpsim.evaluation import BETS, Monitor
from gpsim.files import Json, disk_errors, write_json, written_whole
from gpsim.gp import Predictor
from gpsim.mjcf import Exported, MjcfSimulator, export_model, open_simulator
from gpsim.policies.export import ros_node, to_onnx
from gpsim.recordings import Predictions, Recording, read_recording, write_mcap, write_table
from gpsim.reports.account import account_of
from gpsim.reports.bodies import body_of
from gpsim.reports.scene import Shown
from gpsim.residuals import first_held_out
from gpsim.settings import build
from gpsim.simulators import SIMULATORS, Integrator
from gpsim.stages import diagnose, safety
from gpsim.stages.diagnose import read_corrected, read_diagnosis
from gpsim.stages.diagnosis_files import correction_of, moved_sentences, sentences, went
from gpsim.stages.policy_files import policy_artifact, read_policy, survival_lines
from gpsim.stages.stage import Request, blamed, new_place, written_new
from gpsim.tasks import GoalReaching
from gpsim.traces import alongside

SCHEMA = "gpsim.monitor/1"
POSE, TWIST = ("x", "y", "yaw"), ("v_cmd", "w_cmd")


def facts_of(monitor: Monitor) -> dict[str, Any]:
    """The predictor and what is usual; raises UsageError for a monitor that a node cannot predict with."""
    plant, usual = monitor.plant, monitor.usual
    if (plant.state.names, plant.action.names) != (POSE, TWIST):
        raise UsageError("--monitor: only works for a vehicle in the plane with speed and turn-rate commands")
    gp = plant.correction if isinstance(plant, CorrectedPlant) else None
    # A chain of processes is a predictor, too, but has no form of its own.
    if (
        not isinstance(plant, CorrectedPlant)
        or not isinstance(gp, GpCorrection)
        or type(gp.predictor) is not Predictor
    ):
        raise UsageError(
            "--monitor: works with one Gaussian process per rate (gp=exact), not with effects or chained processes; "
            "check the node's bag with gpsim deploy --replay"
        )
    (shift, linear, weights), features, late = gp.predictor.mean_form, gp.features, plant.filter
    inputs = [
        [column, item.function or "", bool(wraps) and item.function in (None, "sign")]
        for column, item, wraps in zip(features.columns, features.items, features.wraps, strict=True)
    ]
    return {
        "schema": SCHEMA,
        "dt": plant.dt,
        "integrator": plant.integrator,
        "delay": list(late.delay) if late else [],
        "lag": list(late.time_constant) if late else [],
        "gp": {
            "inputs": inputs,
            "shift": shift.tolist(),
            "linear": linear.tolist(),
            "weights": weights.tolist(),
        },
        "scale": usual.scale.tolist(),
        "usual": usual.mean,
        "cap": monitor.settings.cap,
        "bets": list(BETS),
        "threshold": monitor.threshold,
        "stated_false_stops": monitor.settings.false_stops,
        "minutes": monitor.settings.minutes,
    }


NODES: Mapping[Literal[1, 2], str] = {1: "drive_to_goal.py", 2: "drive_to_goal_ros2.py"}
MONITOR = "monitor.json"


def export_policy(path: Path, out: Path, watched: Request | None = None) -> list[str]:
    """Write policy.onnx, policy.json (its origin) and, for a vehicle with a goal, ROS nodes to the new folder `out`.

    path: an artifact of train-source or train-gp-policy; watched: how the node's monitor is configured. Returns
    sentences about what was written.
    """
    artifact = policy_artifact(path)
    new_place(out)
    policy, config = read_policy(path), artifact.manifest["config"]
    has_node = config["task"]["name"] == "goal"
    if watched is not None and not has_node:
        raise UsageError(
            f"--monitor: {path} has no ROS node for it, because it does not drive a vehicle to a goal"
        )
    monitor = None if watched is None else facts_of(safety.monitor_of(watched, "export"))
    rate = 1.0 / float(config["simulator"]["dt"])
    notes = [
        f"policy.onnx: observation ({len(policy.scale)}) to the most probable action, {rate:g} times a second"
    ]
    with written_new(out) as made:
        made.mkdir()
        (made / "policy.onnx").write_bytes(to_onnx(policy))
        origin = {
            "stage": artifact.stage, "sha256": artifact.digest, "rate": rate, "task": config["task"],
        }  # fmt: skip
        if survives := survival_lines(path):
            origin["survives"] = survives
        write_json(made / "policy.json", origin)
        if has_node:
            task = build(GoalReaching, config["task"], "task")
            goal = (task.evaluation_goal[0], task.evaluation_goal[1])
            for ros, name in NODES.items():
                text = ros_node(policy, rate, task.goal_radius, goal, task.max_steps, task.floor, ros)
                (made / name).write_text(text, encoding="utf-8")
                (made / name).chmod(0o755)
                notes.append(
                    f"{name}: a ROS {ros} node that runs it, or a plan; its first lines explain the use"
                )
        if monitor is not None:
            write_json(made / MONITOR, monitor)
            notes.append(f"{MONITOR}: beside a node, it makes the node stop as deploy.safe does")
    return notes


FORMATS = ("mcap", "csv", "parquet")


def export_recording(path: Path, form: str, out: Path) -> list[str]:
    """Write the recording at `path` to the new file `out`; returns sentences about what is in it."""
    if form not in FORMATS:
        raise UsageError(f"--format {form}: not one of {', '.join(FORMATS)}")
    new_place(out)
    if not path.exists() or (path.is_file() and path.stem != "recording"):
        raise UsageError(
            f"{path}: no such recording{near_path(path)}; give a folder with recording.yaml, made by `gpsim import`"
        )
    recording = read_recording(path)
    predictions, notes = predict(recording)
    with written_new(out, ".parquet" if form == "parquet" else "") as made:
        (write_mcap if form == "mcap" else write_table)(recording, predictions, made)
    samples = sum(len(e.t) for e in recording.episodes)
    return [f"{len(recording.episodes)} episode(s), {samples} samples", *notes]


def predict(recording: Recording) -> tuple[Predictions, list[str]]:
    """The base simulator's one-step (`simulated`) and open-loop (`open_loop`) states, where there is one."""
    if recording.system not in SIMULATORS:
        return {}, [
            f"measured channels only: no simulator '{recording.system}' (known: {', '.join(SIMULATORS)})"
        ]
    simulator = open_simulator(recording.system)
    names = (recording.state.names, recording.action.names)
    if names != (simulator.state.names, simulator.action.names):
        return {}, [f"measured channels only: they are not those of the simulator {recording.system}"]
    parameters = simulator.defaults(recording.parameters)
    integrator, wraps = cast(Integrator, recording.integrator), recording.state.wraps
    found: dict[str, list[FloatArray]] = {"simulated": [], "open_loop": []}
    for episode in recording.episodes:
        dt = np.diff(episode.t)
        one_step = np.full_like(episode.states, np.nan)  # (K + 1, S), of which the first row is unknown
        run = np.full_like(episode.states, np.nan)
        run[0] = episode.states[0]
        with np.errstate(all="ignore"):  # an open loop may run away; what is not finite is left out
            if len(episode):
                one_step[1:] = simulator.step(
                    episode.states[:-1], episode.actions, parameters, dt, integrator
                )
            for k in range(len(episode)):
                row = slice(k, k + 1)
                run[k + 1] = simulator.step(run[row], episode.actions[row], parameters, dt[row], integrator)
        for name, states in (("simulated", one_step), ("open_loop", run)):
            states[:, wraps] = wrap_angle(states[:, wraps])
            found[name].append(states)
    return found, [
        "simulated: the base simulator, one step from the measured state; open_loop: from the first state on"
    ]


def export_corrected_model(folder: Path, out: Path, urdf: bool = False) -> tuple[Exported, list[str]]:
    """Write the corrected model of the diagnosis at `folder`; sentences about where each effect went.

    urdf: as URDF, too.

    Raises UsageError, for a diagnosis of equations too: they have no model file.
    """
    artifact = read_artifact(folder, "diagnose")
    found, plant = read_diagnosis(folder), read_corrected(folder)
    if not isinstance(plant.simulator, MjcfSimulator):
        raise UsageError(
            f"{folder}: {plant.simulator.name} is no MuJoCo model, so there is no XML to write; in Python, use "
            f"gpsim.Diagnosis.load({str(folder)!r}).corrected()"
        )
    if artifact.path.resolve() in out.resolve().parents:
        raise UsageError(f"{out}: is inside the diagnosis, which is never changed; choose another --out")
    correction = correction_of(plant, plant.simulator)
    source = {
        "diagnosis": str(folder),
        "diagnosis_sha256": artifact.digest,
        "simulator": plant.simulator.name,
        "verdict": found.verdict,
    }
    moved = moved_sentences(found.kinematics)
    made = export_model(correction, sentences(found.effects), source, out, moved, urdf)
    notes = [f"{kind:<8} {path.name}" for kind, path in made.files.items()]
    if plant.terms == () and not moved:
        notes.append("no effect was found: the model is the base")
    notes += [went(effect) for effect in made.effects]
    if made.wrapped:
        notes.append(
            f"the model lacks the effects of the wrapper: run it with Robot from {made.files['wrapper'].name}"
        )
    notes += [f"not in the URDF: {line}" for line in made.lost]
    notes.append(f"read back: numbers differ by at most {made.difference:.1g} of the largest in their field")
    return made, [*notes, *(f"{said} -> model" for said in moved.values())]


def told(made: Exported) -> Json:
    """For --json: where each effect went, and how exactly the model comes back."""
    effects = [dict(effect) for effect in made.effects]
    return {"effects": effects, "largest_difference": made.difference, "not_in_urdf": list(made.lost)}


NEEDS = {"mcap": ("mcap", "mcap_protobuf", "foxglove_schemas_protobuf"), "rrd": ("rerun",)}
MISSING = {
    "mcap": "export diagnosis: Foxglove's formats are not installed; pip install 'gpsim[foxglove]'",
    "rrd": "view: Rerun is not installed; pip install 'gpsim[rerun]'",
}
"""What is said where a package that a format needs is not there."""


def export_diagnosis(
    folder: Path,
    out: Path | None = None,
    recording: Path | None = None,
    horizon: float | None = None,
    form: Literal["mcap", "rrd"] = "mcap",
) -> tuple[Path, list[str]]:
    """Write a file of the diagnosis at `folder`; where it lies, and sentences about what is in it.

    out: the new file, beside the folder without one. recording: where the recording lies now, which must be the one
    that was diagnosed. horizon: s of every rollout, that of the diagnosis without one. form: for Foxglove, or for
    Rerun. Raises UsageError.
    """
    if any(find_spec(name) is None for name in NEEDS[form]):
        raise UsageError(MISSING[form])
    artifact = read_artifact(folder, "diagnose")
    place = artifact.path if artifact.path.name not in ("", "..") else artifact.path.resolve()
    out = out or place.with_name(f"{place.name}.{form}")
    new_place(out)
    if artifact.path.resolve() in out.resolve().parents:
        raise UsageError(f"{out}: is inside the diagnosis, which is never changed; choose another --out")
    if horizon is not None and not 0 < horizon < np.inf:
        raise UsageError(f"--horizon {horizon:g}: expected a time of more than 0 s")
    found = read_diagnosis(folder)
    opened = _opened(artifact, recording)
    plant = read_corrected(folder)
    process = found.remainder.gp is None or found.remainder.gp.used
    with_gp = read_corrected(folder, gp=True) if process else None
    settings = Settings()  # the usual ones where an earlier version had others
    with suppress(UsageError):
        settings = read_settings(artifact.manifest["config"].get("settings") or {})
    seconds = horizon or found.fit.rollout.horizon_s
    with blamed(plant.simulator.name):
        along = alongside(opened, plant, with_gp, seconds, Run(settings=settings))
    facts = {
        "verdict": found.verdict,
        "said": account_of(found).sentence,
        "simulator": plant.simulator.name,
        "horizon_s": f"{along.horizon:g}",
        "diagnosis_sha256": artifact.digest,
    }
    body = body_of(plant.simulator, plant.parameters, _reach(opened))
    shown = Shown(opened, along, body, first_held_out(opened), facts)
    if form == "mcap":
        from gpsim.reports.foxglove_file import write_foxglove as write
    else:
        from gpsim.reports.rerun_file import write_rerun as write
    with disk_errors(out, "--out"), written_whole(out) as made:
        count = write(shown, made)
    samples = sum(len(e.t) for e in opened.episodes)
    notes = [
        f"{count} messages: {len(opened.episodes)} episode(s), {samples} samples",
        f"/real beside /{', /'.join(along.models)}: rollouts of {along.horizon:g} s from measured states",
    ]
    if along.every > 1:
        notes.append(f"simulated at one sample in {along.every}, as in the diagnosis")
    if not found.effects:
        notes.append(f"no effect was found (verdict {found.verdict}): /corrected is the base")
    if body is None:
        notes.append(f"numbers only: the shape of {plant.simulator.name} is unknown, so no body is drawn")
    return out, notes


def _opened(artifact: Artifact, recording: Path | None) -> Recording:
    """The recording that was diagnosed, byte for byte."""
    config = artifact.manifest["config"]
    if diagnose.RECORDINGS in config:
        raise UsageError(
            f"{artifact.path}: is about several recordings, but only one can be shown: diagnose that one separately"
        )
    told = read_timings(artifact.path).get(diagnose.RECORDING)  # where nobody wrote it down, none
    place = recording or (Path(told) if isinstance(told, str) else None)
    if place is None:
        raise UsageError(
            f"{artifact.path}: does not contain the path of its recording; name it with --recording PATH"
        )
    if not place.exists():
        raise UsageError(f"{place}: the recording was not found; give its present path with --recording PATH")
    task = diagnose.Task(place, str(config["simulator"]), config.get("episodes"))
    if sorted(diagnose.digests_of(task).values()) != sorted(config["recording"].values()):
        raise UsageError(
            f"{place}: not the recording of {artifact.path}, or changed since; name the right one with --recording "
            "PATH, or diagnose this one"
        )
    return diagnose.open_recording(task)[0]


def _reach(recording: Recording) -> float:
    """How far it travels along its longest channel in metres; 1 where nothing is."""
    columns = [i for i, channel in enumerate(recording.state) if channel.unit == "m"]
    states = np.concatenate([episode.states[:, columns] for episode in recording.episodes])
    return float(np.ptp(states, axis=0).max()) or 1.0 if columns else 1.0
