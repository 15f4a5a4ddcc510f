"""Layer 3: what a policy earns on the target, over one seed or several, and the small statistics of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.environments import Act, Episodes
from gpsim.simulators import Plant
from gpsim.tasks import Start, Task


def interquartile_mean(values: FloatArray) -> float:
    """Mean of the middle half (Agarwal et al. 2021, "Deep RL at the edge of the statistical precipice").

    As scipy.stats.trim_mean(values, 0.25), which is too slow for the inside of a bootstrap.
    """
    flat = np.asarray(values, dtype=np.float64).ravel()
    cut = flat.size // 4
    return float(np.partition(flat, (cut, flat.size - cut - 1))[cut : flat.size - cut].mean())


def bootstrap_interval(
    values: FloatArray, statistic: Callable[[FloatArray], float], draws: int = 2000
) -> tuple[float, float]:
    """95 % percentile bootstrap interval of statistic(values) over the rows of `values` (N, ...).

    With seeds as the rows of (seeds, starts), whole seeds are drawn, and the starts that all of them share: a start
    that nobody solves counts once, however many seeds have tried it. The draws are the same at every call.
    """
    rng = np.random.default_rng(0)
    values = np.asarray(values, dtype=np.float64)
    found = np.empty(draws)
    for i in range(draws):
        rows = values[rng.integers(0, len(values), len(values))] if len(values) > 1 else values
        if values.ndim > 1:
            rows = rows[:, rng.integers(0, rows.shape[1], rows.shape[1])]
        found[i] = statistic(rows)
    low, high = np.percentile(found, [2.5, 97.5])
    return float(low), float(high)


def nrmse(predicted: FloatArray, actual: FloatArray, value_range: float | None = None) -> float:
    """Root mean square error over the range (max - min) of `actual`, or over `value_range`; NaN if that is 0."""
    scale = float(np.ptp(actual)) if value_range is None else value_range
    return float(np.sqrt(np.mean((predicted - actual) ** 2)) / scale) if scale > 0 else float("nan")


def r2(predicted: FloatArray, actual: FloatArray) -> float:
    """Coefficient of determination; NaN where `actual` does not vary."""
    total = float(np.sum((actual - actual.mean()) ** 2))
    return 1.0 - float(np.sum((predicted - actual) ** 2)) / total if total > 0 else float("nan")


def play(
    plant: Plant, task: Task, act: Act, start: Start, rng: np.random.Generator
) -> Iterator[tuple[Episodes, BoolArray, FloatArray]]:
    """One episode from every start, step by step: where they are, (N,) which took the step, and (N,) what it earned."""
    running = Episodes(plant, task, len(start.states), rng)
    observations, alive = running.begin(start), np.ones(len(start.states), dtype=np.bool_)
    for _ in range(task.max_steps):
        with np.errstate(over="ignore", invalid="ignore"):  # what has ended moves on, however far
            rewards, terminated, _ = running.step(act(observations))
        yield running, alive, np.where(alive, rewards, 0.0)
        alive = alive & ~terminated
        if not alive.any():
            return
        with np.errstate(over="ignore"):
            observations = running.observe()


def episode_returns(plant: Plant, task: Task, act: Act, start: Start, rng: np.random.Generator) -> FloatArray:
    """(N,): the undiscounted return of one episode from every start."""
    returns = np.zeros(len(start.states))
    for _, _, earned in play(plant, task, act, start, rng):
        returns += earned
    return returns


def summarise(returns: FloatArray, starts: BoolArray) -> dict[str, Any]:
    """Mean, spread and interval of returns (seeds, N) over the chosen starts (N,).

    std is over all episodes; the interval of the mean is a 95 % bootstrap over seeds and starts; iqm is the
    interquartile mean over all runs, with its interval; by_seed the mean of each seed.
    """
    chosen = returns[:, starts]
    if not chosen.size:
        return {"episodes": 0}
    return {
        "mean": float(chosen.mean()),
        "std": float(chosen.std()),
        "episodes": int(chosen.size),
        "interval": list(bootstrap_interval(chosen, lambda r: float(r.mean()))),
        "iqm": interquartile_mean(chosen),
        "iqm_interval": list(bootstrap_interval(chosen, interquartile_mean)),
        "by_seed": chosen.mean(axis=1).tolist(),
    }


def summarise_all(returns: Mapping[str, FloatArray], starts: BoolArray) -> dict[str, dict[str, Any]]:
    """`summarise` for every policy."""
    return {name: summarise(values, starts) for name, values in returns.items()}


TENTH = 0.1


def worst_tenth(returns: FloatArray) -> float:
    """The mean of the lowest tenth, of one episode at least (the conditional value at risk)."""
    flat = np.sort(np.asarray(returns, dtype=np.float64).ravel())
    return float(flat[: max(1, round(TENTH * flat.size))].mean())


def mean_and_worst(returns: FloatArray) -> dict[str, Any]:
    """Mean and worst tenth of returns (N,), each with the 95 % bootstrap interval over starts."""
    one = returns[None]
    return {
        "mean": float(returns.mean()),
        "interval": list(bootstrap_interval(one, lambda r: float(r.mean()))),
        "worst_tenth": worst_tenth(returns),
        "worst_tenth_interval": list(bootstrap_interval(one, worst_tenth)),
        "episodes": int(returns.size),
    }


def robustness_lines(found: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> list[str]:
    """A line a policy and place."""
    return [
        f"on {'the target' if where == 'target' else 'draws of the posterior'}, {name}: mean {of['mean']:.1f}, worst "
        f"tenth {of['worst_tenth']:.1f} ({of['worst_tenth_interval'][0]:.1f} to {of['worst_tenth_interval'][1]:.1f})"
        for where, policies in found.items()
        for name, of in policies.items()
    ]


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
