"""Several seeds' evaluations -> one summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.evaluation.returns import summarise_all

Json = dict[str, Any]
NOTES = ("judged_on", "not_driven", "measured_on")
AVERAGED = ("outside_recording", "one_step", "one_step_random", "rollout", "own_simulator")


def start_sets(
    returns: Mapping[str, FloatArray],
    certified: BoolArray,
    max_steps: int | None,
    reached: Mapping[str, BoolArray] | None = None,
) -> dict[str, BoolArray]:
    """The three sets of starts, masks (N,): what a Target policy of any seed solves, all, what the search certifies.

    returns: policy to (seeds, N). Solved means a return of max_steps, 1 for every step there is, or, where the task
    has a goal, that it was reached: policy to (seeds, N). Without a Target policy the first set is the certified one,
    and so it is where no return means that a start is solved (max_steps None).
    """
    solves: Mapping[str, BoolArray] = reached or {}
    if reached is None and max_steps is not None:
        solves = {name: values >= max_steps for name, values in returns.items()}
    solved = np.asarray(solves["Target"].any(axis=0)) if "Target" in solves else certified
    return {"returns": solved, "returns_all": np.ones_like(certified), "returns_certified": certified}


def summarise_seeds(
    evaluations: Sequence[Json],
    returns: Mapping[str, FloatArray],
    sets: Mapping[str, BoolArray],
    experiment: str,
) -> Json:
    """The content of summary.json: returns on the three sets of starts, and the other layers averaged over seeds.

    evaluations: one evaluation.json a seed; returns: policy to (seeds, N); sets: as `start_sets` makes them.
    """
    return {
        "experiment": experiment,
        "seeds": [evaluation["seed"] for evaluation in evaluations],
        **{key: summarise_all(returns, starts) for key, starts in sets.items()},
        "share": {key: float(starts.mean()) for key, starts in sets.items()},
        **{key: _mean([e[key] for e in evaluations]) for key in AVERAGED if key in evaluations[0]},
        **{key: evaluations[0][key] for key in NOTES if key in evaluations[0]},
    }


def _mean(values: Sequence[Any]) -> Any:
    """The same structure with every number averaged; None where a number is missing."""
    first = values[0]
    if any(value is None for value in values):
        return None
    if isinstance(first, Mapping):
        keys = dict.fromkeys(key for value in values for key in value)
        return {key: _mean([value.get(key) for value in values]) for key in keys}
    if isinstance(first, list):
        return [_mean(list(column)) for column in zip(*values, strict=True)]
    if isinstance(first, str):
        return first
    return float(np.mean(values)) if isinstance(first, float) or len(set(values)) > 1 else first
