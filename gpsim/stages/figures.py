"""What a finished artifact says in numbers, and its main files: plain JSON, for programs that called a command."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from gpsim.artifacts import Artifact
from gpsim.diagnosis import Diagnosis
from gpsim.files import Json, read_object
from gpsim.findings import Score
from gpsim.recordings import Inspection, Recording, gaps, read_recording

FILES: Mapping[str, Mapping[str, str]] = {
    "train-source": {"policy": "policy.safetensors", "learning_curve": "learning_curve.csv"},
    "train-gp-policy": {"policy": "policy.safetensors", "learning_curve": "learning_curve.csv"},
    "collect": {"recording": "recording.parquet", "import_report": "import_report.txt"},
    "import": {
        "recording": "recording.parquet", "import_report": "import_report.txt", "figure": "figures/channels.png",
    },
    "build-residuals": {"residuals": "residuals.parquet"},
    "fit-gp": {"fit": "fit.json", "gp": "gp.safetensors"},
    "certify": {"certified": "certified.csv"},
    "evaluate": {"evaluation": "evaluation.json", "returns": "returns.csv", "deployments": "deployments.csv"},
    "diagnose": {"diagnosis": "diagnosis.json", "report": "report.html", "corrected": "corrected.json"},
    "score": {"score": "score.json"},
    "plan": {"plan": "plan.csv", "facts": "plan.yaml", "report": "report.html"},
    "report": {"summary": "summary.json", "report": "report.html"},
}  # fmt: skip
"""The files of a stage's artifact that somebody looks for, by what they are; of these, those that are there."""
SETS = {"returns": "solvable", "returns_all": "all", "returns_certified": "certified"}
"""Tables of the policies' returns in evaluation.json and summary.json -> the starts that they are over."""
COLUMNS = ("mean", "std", "interval", "iqm", "iqm_interval", "episodes")


def paths_of(stage: str, folder: Path) -> dict[str, Path]:
    """The artifact's folder and its main files."""
    named = {name: folder / file for name, file in FILES.get(stage, {}).items()}
    return {"folder": folder} | {name: path for name, path in named.items() if path.is_file()}


def figures_of(artifact: Artifact) -> Json:
    """The figures of an artifact of the loop's stages; none of a stage that has none."""
    read = _READERS.get(artifact.stage)
    return read(artifact.path) if read is not None else {}


def recording_figures(recording: Recording) -> Json:
    """Size, pace [s], channels with their units, and how many steps are too long for one."""
    lengths = [float(episode.t[-1] - episode.t[0]) for episode in recording.episodes]
    return {
        "system": recording.system,
        "episodes": len(recording.episodes),
        "transitions": recording.transition_count,
        "dt": recording.dt,
        "seconds": sum(lengths),
        "gaps": sum(int(gaps(episode.t, recording.dt).sum()) for episode in recording.episodes),
        "state": dict(recording.state.units),
        "action": dict(recording.action.units),
        "velocities": recording.velocities,
    }


def inspection_figures(found: Inspection) -> Json:
    """The topics of a log, how they come [Hz, s], and the mappings that come with gpsim and fit it."""
    topics = []
    for topic in found.topics:
        pace = found.paces.get(topic.name)
        topics.append(
            {
                "name": topic.name,
                "type": topic.type,
                "count": topic.count,
                "rate": pace.rate if pace else None,
                "gaps": len(pace.gaps) if pace else None,
                "fields": list(topic.fields),
                "fault": found.faults.get(topic.name),
            }
        )
    return {
        "name": found.name,
        "topics": topics,
        "more_logs": found.others,
        "ready_mappings": list(found.ready),
    }


def diagnosis_figures(found: Diagnosis) -> Json:
    """What a script asks of a diagnosis first; all of it is in diagnosis.json, in the same words."""
    whole = found.to_dict()
    explained = whole["explained"]
    effects = [{key: effect.get(key) for key in _OF_EFFECT} for effect in whole["effects"]]
    return {
        "verdict": whole["verdict"],
        "explained": explained["rollout"],
        "explained_one_step": explained["one_step"],
        "effects": effects,
        "alternatives": [
            {
                "probability": one.get("probability"),
                "effects": [{"family": e["family"], "on": e["on"]} for e in one["effects"]],
            }
            for one in whole["alternatives"]
        ],
        "fit": {
            "held_out": whole["fit"]["held_out"],
            **{
                layer: {
                    name: {key: row.get(key) for key in _OF_FIT}
                    for name, row in whole["fit"][layer].items()
                    if isinstance(row, Mapping)
                }
                for layer in ("one_step", "rollout")
            },
            "horizon_s": whole["fit"]["rollout"].get("horizon_s"),
        },
        "remainder": {key: whole["remainder"].get(key) for key in ("structured", "share", "depends_on")},
        "tell_apart": whole["tell_apart"],
        "log_facts": whole["log_facts"],
    }


_OF_EFFECT = (
    "family", "on", "site", "parameters", "region", "since", "probability", "importance", "needed", "role", "form",
    "sentence",
)  # fmt: skip
_OF_FIT = ("before", "tuned", "gp", "after", "after_gp", "noise_floor", "unit")


def score_figures(found: Score) -> Json:
    """How a diagnosis does on another recording."""
    whole = found.to_dict()
    explained = (whole.get("explained") or {}).get("rollout")
    kept = ("one_step", "rollout", "horizon_s", "transitions", "steps", "rollouts")
    return {"explained": explained} | {key: whole[key] for key in kept}


def evaluation_figures(path: Path) -> Json:
    """Of evaluation.json or summary.json the three layers; `table` holds a row a policy and set of starts."""
    whole = read_object(path)
    rows = [
        {"policy": policy, "starts": starts} | {key: row.get(key) for key in COLUMNS}
        for name, starts in SETS.items()
        for policy, row in (whole.get(name) or {}).items()
    ]
    return {"table": rows} | {key: whole[key] for key in _OF_EVALUATION if key in whole}


_OF_EVALUATION = (
    "seeds", "one_step", "rollout", "own_simulator", "success", "success_all", "success_certified", "deployed",
    "judged_on", "measured_on", "not_driven",
)  # fmt: skip


def _fit(folder: Path) -> Json:
    whole = read_object(folder / "fit.json")
    rates = {
        name: {
            "rows": fit["rows"],
            "log_marginal_likelihood": fit["log_marginal_likelihood"],
            "noise_std": fit["hyper_parameters_original"]["noise_std"],
            "outcome": fit["outcome"],
            "converged": fit["converged"],
        }
        for name, fit in whole["rates"].items()
    }
    return {"inputs": whole["inputs"], "rates": rates, "filter": whole.get("filter", {})}


def _residuals(folder: Path) -> Json:
    whole = read_object(folder / "residuals.json")
    rates = {
        name: {
            "unit": unit, "residual_std": whole["residual_std"][name], "measured_std": whole["measured_std"][name],
        }
        for name, unit in whole["rates"].items()
    }  # fmt: skip
    return {"rows": whole["rows"], "rates": rates}


def _certified(folder: Path) -> Json:
    import pandas as pd  # here, as below: half a second that a diagnosis need not wait for

    table = pd.read_csv(folder / "certified.csv")
    return {"starts": len(table), "certified": int(np.sum(table["certified"]))}


def _training(folder: Path) -> Json:
    """The last row of the learning curve; None of what no episode of training had."""
    import pandas as pd

    path = folder / "learning_curve.csv"
    table = pd.read_csv(path) if path.is_file() else pd.DataFrame()
    if table.empty:
        return {"steps": None, "mean_return": None}
    last = table.iloc[-1]
    return {"steps": int(last["steps"]), "mean_return": float(last["mean_return"])}


_READERS: Mapping[str, Callable[[Path], Json]] = {
    "train-source": _training,
    "train-gp-policy": _training,
    "collect": lambda folder: recording_figures(read_recording(folder)),
    "build-residuals": _residuals,
    "fit-gp": _fit,
    "certify": _certified,
    "evaluate": lambda folder: evaluation_figures(folder / "evaluation.json"),
}
