"""posterior.json: what a diagnosis leaves open, as plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.left_open import Explanation, LeftOpen, Visited
from gpsim.effects import EffectParameter, from_json, to_json
from gpsim.errors import UsageError

SCHEMA = "gpsim.posterior/2"
OLDER = "gpsim.posterior/1"  # with a left_open.json beside it
LEVEL = 0.9  # of an older file's intervals


def left_open_data(open_still: LeftOpen) -> dict[str, Any]:
    """posterior.json."""
    return {
        "schema": SCHEMA,
        "level": open_still.level,
        "explanations": [_explanation_data(e) for e in open_still.explanations],
        "noise": dict(open_still.noise),
        "left": dict(open_still.left),
        "visited": {name: _listed(value) for name, value in vars(open_still.visited).items()},
    }


def left_open_from(data: Mapping[str, Any], where: str) -> LeftOpen:
    """The inverse of `left_open_data`; raises UsageError."""
    try:
        if data["schema"] != SCHEMA:
            raise UsageError(f"{where}: schema '{data['schema']}', expected {SCHEMA}")
        seen = {f.name: _array(data["visited"][f.name]) for f in fields(Visited) if f.name != "seconds"}
        visited = Visited(seconds=float(data["visited"]["seconds"]), **seen)
        noise, left = ({str(k): float(v) for k, v in data[key].items()} for key in ("noise", "left"))
        found = tuple(map(_explanation_from, data["explanations"]))
        return LeftOpen(found, float(data["level"]), noise, left, visited)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UsageError(f"{where}: not a posterior that this version reads ({error!r})") from error


def from_two_files(drawn: Mapping[str, Any], planned: Mapping[str, Any]) -> dict[str, Any]:
    """What posterior.json would say now, of an older one, with intervals, and the left_open.json beside it."""
    entries = zip(planned["explanations"], drawn["explanations"], strict=True)
    found = [entry | {"intervals": _intervals(entry, of)} for entry, of in entries]
    return {**planned, "schema": SCHEMA, "level": LEVEL, "explanations": found}


def _intervals(entry: Mapping[str, Any], drawn: Mapping[str, Any]) -> list[list[Any]]:
    """By the term and the name of each parameter: an older posterior.json has terms that do nothing, too."""
    said = {
        (drawn["terms"][s["term"]]["family"], drawn["terms"][s["term"]]["on"], s["name"]): s
        for s in drawn["parameters"]
    }
    sizes = (
        said[term["family"], term["on"], p["name"]]
        for term, group in zip(entry["terms"], entry["parameters"], strict=True)
        for p in group
    )
    return [["nan" if size[end] is None else size[end] for end in ("low", "high")] for size in sizes]


def _explanation_data(one: Explanation) -> dict[str, Any]:
    return {
        "label": one.label,
        "probability": one.probability,
        "scheme": one.hypothesis.scheme,
        "terms": [to_json(term) for term in one.hypothesis.terms],
        "parameters": [
            [{k: _listed(v) for k, v in asdict(p).items()} for p in group]
            for group in one.hypothesis.declared
        ],
        "intervals": _listed(one.intervals),
        "covariance": _listed(one.covariance),
    }


def _explanation_from(data: Mapping[str, Any]) -> Explanation:
    terms = tuple(from_json(term) for term in data["terms"])
    declared = tuple(tuple(map(_parameter, group)) for group in data["parameters"])
    hypothesis = Hypothesis(terms, declared, data["scheme"])
    size = len(hypothesis.parameters)
    matrix = _array(data["covariance"]).reshape(size, size)
    intervals = _array(data["intervals"]).reshape(size, 2)
    return Explanation(hypothesis, float(data["probability"]), matrix, intervals)


def _parameter(data: Mapping[str, Any]) -> EffectParameter:
    values = {k: _unlisted(v) for k, v in data.items()}
    for name in ("starts", "plausible"):
        values[name] = None if values[name] is None else tuple(values[name])
    return EffectParameter(**values)


def _listed(value: Any) -> Any:
    """JSON's own types; what is not finite, which JSON does not know, as a text."""
    if isinstance(value, np.ndarray | list | tuple):
        return [_listed(v) for v in (value.tolist() if isinstance(value, np.ndarray) else value)]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _array(value: Any) -> FloatArray:
    return np.array(_unlisted(value), dtype=np.float64)


def _unlisted(value: Any) -> Any:
    if isinstance(value, list):
        return [_unlisted(v) for v in value]
    return float(value) if value in ("inf", "-inf", "nan") else value
