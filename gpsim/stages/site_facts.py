"""What an artifact is known by, in a line: read from the few files that say so, whatever version wrote them."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gpsim.artifacts import Artifact
from gpsim.diagnosis import Diagnosis
from gpsim.files import Json, read_object
from gpsim.recordings import read_yaml
from gpsim.reports.account import account_of
from gpsim.reports.account_effects import told_effects
from gpsim.reports.runs_text import Figure
from gpsim.reports.sheets import fixed, percent, whole_percent

STARTS = {
    "returns": "mean returns, solvable starts",
    "returns_certified": "mean returns, certified starts",
    "returns_all": "mean returns, all starts",
}
"""Sets of starts in the order in which they are preferred, in words."""

NARROW = "\u202f"  # the space between thousands, which breaks no line
MOST_EFFECTS = 4  # of a diagnosis that are told
Facts = dict[str, Any]
"""Some of `said`, `lines`, `verdict`, `figures` and `of` of an Entry."""


def facts_of(artifact: Artifact) -> Facts:
    """Facts of an artifact; of a stage that nobody knows here, none. May raise on a file of another shape."""
    tell = _TELL.get(artifact.stage)
    return tell(artifact) if tell is not None else {}


def proof_facts(path: Path) -> Facts:
    """Facts of a prove.json; may raise on one of another shape."""
    content = read_object(path)
    parts = {name: part for name, part in content.items() if isinstance(part, dict) and "right" in part}
    told = {name: part for name, part in parts.items() if name not in ("all", "long") and part.get("n")}
    figures = tuple(Figure(name, f"{part['right']} of {part['n']}") for name, part in told.items())
    return {
        "said": f"concealed worlds, seed {content.get('seed')}",
        "figures": figures,
        "of": "named rightly",
    }


def _diagnosis(artifact: Artifact) -> Facts:
    found = Diagnosis.from_dict(_json(artifact, "diagnosis.json"))
    simulator = str(artifact.manifest["config"].get("simulator") or "")
    sentence = account_of(found, simulator=simulator or None).sentence
    effects = tuple(effect.sentence for effect in told_effects(found)[0][:MOST_EFFECTS])
    said = sentence[:1].upper() + sentence[1:]
    return {"verdict": found.verdict, "said": said, "of": simulator.rpartition("/")[2], "lines": effects}


def _compared(name: str) -> Callable[[Artifact], Facts]:
    def tell(artifact: Artifact) -> Facts:
        content = _json(artifact, name)
        for key, words in STARTS.items():
            stats = {policy: s for policy, s in (content.get(key) or {}).items() if s.get("episodes")}
            if stats:
                rates = content.get(key.replace("returns", "success")) or {}
                figures = tuple(Figure(p, _result(s, rates.get(p) or {})) for p, s in stats.items())
                return {"figures": figures, "of": words + (" (success)" if rates else "")}
        return {"said": str(content.get("not_driven") or "").partition(";")[0]}

    return tell


def _result(stats: Mapping[str, Any], success: Mapping[str, Any]) -> str:
    rate = f" ({whole_percent(success['rate'])})" if success.get("episodes") else ""
    return fixed(stats.get("mean")) + rate


def _policy(artifact: Artifact) -> Facts:
    config = artifact.manifest["config"]
    where = {
        "source": "the base simulator",
        "randomised": "the base simulator, randomised",
        "target": "the target",
    }
    if artifact.stage == "train-source":
        place = where.get(str(config.get("variant")), "")
    else:
        sampled = f", {config['prediction']}" if "prediction" in config else ""
        place = f"the simulator corrected by {config.get('correction', 'gp')}{sampled}"
    with (artifact.path / "learning_curve.csv").open(newline="", encoding="utf-8") as stream:
        rows = [(int(row["steps"]), float(row["mean_return"] or "nan")) for row in csv.DictReader(stream)]
    known = [value for _, value in rows if math.isfinite(value)]
    last = f", {fixed(known[-1])} an episode at the end" if known else ""
    steps = f"{rows[-1][0]:_}".replace("_", NARROW)
    return {"said": f"policy of {place}: {steps}{NARROW}steps{last}"}


def _recording(artifact: Artifact) -> Facts:
    told = read_yaml(artifact.path / "recording.yaml")
    channels = ", ".join(str(name) for part in ("state", "action") for name in told.get(part) or {})
    return {"said": f"recording of {told['system']} every {told['dt']:g} s: {channels}"}


def _process(artifact: Artifact) -> Facts:
    fit = _json(artifact, "fit.json")
    rates = ", ".join(fit["rates"])
    return {"said": f"Gaussian processes of {rates} on {fit['rows']} rows; inputs {', '.join(fit['inputs'])}"}


def _score(artifact: Artifact) -> Facts:
    score = _json(artifact, "score.json")
    share = ((score.get("explained") or {}).get("rollout") or {}).get("share")
    told = "" if share is None else f": {percent(share)} of the mismatch is explained"
    return {"said": f"a diagnosis on another recording, {score.get('transitions')} transitions{told}"}


def _certified(artifact: Artifact) -> Facts:
    with (artifact.path / "certified.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))[1:]
    return {"said": f"which of {len(rows)} starts can be solved at all"}


def _residuals(artifact: Artifact) -> Facts:
    return {"said": "measured rates minus those of the base simulator"}


def _json(artifact: Artifact, name: str) -> Json:
    return read_object(artifact.path / name)


_TELL: Mapping[str, Callable[[Artifact], Facts]] = {
    "diagnose": _diagnosis,
    "report": _compared("summary.json"),
    "evaluate": _compared("evaluation.json"),
    "train-source": _policy,
    "train-gp-policy": _policy,
    "collect": _recording,
    "import": _recording,
    "fit-gp": _process,
    "score": _score,
    "certify": _certified,
    "build-residuals": _residuals,
}
