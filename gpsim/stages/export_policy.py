"""export policy: a trained policy as ONNX, and a ROS node that plays it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gpsim.artifacts import read_artifact
from gpsim.errors import UsageError
from gpsim.files import write_json, written_whole
from gpsim.policies import Policy
from gpsim.policies.export import ros_node, to_onnx
from gpsim.settings import build
from gpsim.stages.policy_files import read_policy
from gpsim.stages.survives import survival_lines
from gpsim.tasks import GoalReaching

NODE = "drive_to_goal.py"


def export_policy(path: Path, out: Path) -> list[str]:
    """Write policy.onnx, policy.json (its origin) and, for a vehicle with a goal, a ROS node to the new folder `out`.

    path: an artifact of train-source or train-gp-policy. Returns sentences about what was written.
    """
    artifact = read_artifact(path)
    if artifact.stage not in ("train-source", "train-gp-policy"):
        raise UsageError(
            f"{path}: made by '{artifact.stage}', expected a policy of train-source or train-gp-policy"
        )
    if out.exists():
        raise UsageError(f"{out}: exists already; choose another --out")
    if not out.parent.is_dir():
        raise UsageError(f"{out.parent}: no such folder; make it first")
    policy, config = read_policy(path), artifact.manifest["config"]
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
            if config["task"]["name"] == "goal":
                node = made / NODE
                node.write_text(_node(policy, rate, config["task"]), encoding="utf-8")
                node.chmod(0o755)
                notes.append(f"{NODE}: a ROS 1 node that plays it; its first lines say how")
    except OSError as error:
        raise UsageError(f"{out}: cannot be written: {error.strerror or error}") from error
    return notes


def _node(policy: Policy, rate: float, section: Mapping[str, Any]) -> str:
    task = build(GoalReaching, section, "task")
    x, y = task.evaluation_goal
    return ros_node(policy, rate, task.goal_radius, (x, y), task.max_steps, task.floor)
