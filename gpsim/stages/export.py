"""export policy: a trained policy as ONNX, and nodes of ROS 1 and ROS 2 that play it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from gpsim.artifacts import read_artifact
from gpsim.channels import FloatArray, wrap_angle
from gpsim.corrected import CorrectedPlant, GpCorrection
from gpsim.errors import UsageError, near_path
from gpsim.evaluation import BETS, Monitor
from gpsim.files import Json, write_json, written_whole
from gpsim.gp import Predictor
from gpsim.mjcf import Exported, MjcfSimulator, export_model, open_simulator
from gpsim.policies.export import to_onnx
from gpsim.policies.ros_node import ros_node
from gpsim.recordings import Episode, Predictions, Recording, read_recording, write_mcap, write_table
from gpsim.settings import build
from gpsim.simulators import SIMULATORS, Integrator, Simulator
from gpsim.stages import safety
from gpsim.stages.diagnose import read_corrected, read_diagnosis
from gpsim.stages.diagnosis_files import correction_of, moved_sentences, sentences, went
from gpsim.stages.policy_files import policy_artifact, read_policy, survival_lines
from gpsim.stages.stage import Request, new_place
from gpsim.tasks import GoalReaching

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
            "--monitor: a node predicts with one Gaussian process per rate, as in gp=exact; it does not support "
            "effects and chained processes: check its bag with gpsim deploy --replay"
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
    try:
        with written_whole(out) as made:
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
    except OSError as error:
        raise UsageError(f"{out}: cannot be written: {error.strerror or error}") from error
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
    try:
        with written_whole(out, ".parquet" if form == "parquet" else "") as made:
            (write_mcap if form == "mcap" else write_table)(recording, predictions, made)
    except OSError as error:
        raise UsageError(f"{out}: cannot be written: {error.strerror or error}") from error
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
    pairs = [_predicted(simulator, parameters, recording, episode) for episode in recording.episodes]
    notes = [
        "simulated: the base simulator, one step from the measured state; open_loop: from the first state on"
    ]
    return {"simulated": [one for one, _ in pairs], "open_loop": [run for _, run in pairs]}, notes


def _predicted(
    simulator: Simulator, parameters: dict[str, float], recording: Recording, episode: Episode
) -> tuple[FloatArray, FloatArray]:
    """(K + 1, S) each; the first row of the one-step prediction is unknown."""
    dt, integrator = np.diff(episode.t), cast(Integrator, recording.integrator)
    wraps = recording.state.wraps
    one_step = np.full_like(episode.states, np.nan)
    run = np.full_like(episode.states, np.nan)
    run[0] = episode.states[0]
    with np.errstate(all="ignore"):  # an open loop may run away; what is not finite is left out
        if len(episode):
            one_step[1:] = simulator.step(episode.states[:-1], episode.actions, parameters, dt, integrator)
        for k in range(len(episode)):
            run[k + 1] = simulator.step(
                run[k : k + 1], episode.actions[k : k + 1], parameters, dt[k : k + 1], integrator
            )
        for states in (one_step, run):
            states[:, wraps] = wrap_angle(states[:, wraps])
    return one_step, run


def export_corrected_model(folder: Path, out: Path, urdf: bool = False) -> tuple[Exported, list[str]]:
    """Write the corrected model of the diagnosis at `folder`; sentences about where each effect went.

    urdf: as URDF, too.

    Raises UsageError, for a diagnosis of equations too: they have no model file.
    """
    artifact = read_artifact(folder, "diagnose")
    found, plant = read_diagnosis(folder), read_corrected(folder)
    if not isinstance(plant.simulator, MjcfSimulator):
        raise UsageError(
            f"{folder}: corrects {plant.simulator.name}, which is a system of equations, so there is no XML to write; "
            f"use it in Python with gpsim.Diagnosis.load({str(folder)!r}).corrected(), or train in it with `gpsim "
            f"train-gp-policy diagnosis={folder}`"
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
    corrected = [*moved.values()]
    return made, [
        *_notes(made, plant.terms == () and not corrected),
        *(f"{said} -> model" for said in corrected),
    ]


def _notes(made: Exported, nothing: bool) -> list[str]:
    """What was written, and where each effect went."""
    notes = [f"{kind:<8} {path.name}" for kind, path in made.files.items()]
    if nothing:
        notes.append("no effect was found: the model is the base")
    notes += [went(effect) for effect in made.effects]
    if made.wrapped:
        notes.append(
            f"the model lacks the effects of the wrapper: run it with Robot from {made.files['wrapper'].name}"
        )
    notes += [f"not in the URDF: {line}" for line in made.lost]
    notes.append(f"read back: numbers differ by at most {made.difference:.1g} of the largest in their field")
    return notes


def told(made: Exported) -> Json:
    """For --json: where each effect went, and how exactly the model comes back."""
    effects = [dict(effect) for effect in made.effects]
    return {"effects": effects, "largest_difference": made.difference, "not_in_urdf": list(made.lost)}
