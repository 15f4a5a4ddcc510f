"""Everything that the report of a loop shows, as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.evaluation import AllTrips
from gpsim.reports.sheets import unit

SOLVED, CERTIFIED, ALL = "returns", "returns_certified", "returns_all"
"""The three sets of starts, by their key in summary.json, in the order in which they are shown."""


@dataclass(frozen=True)
class ResidualSlice:
    """One rate's residual along one input, the other inputs held at `at`: what the GP says and what it was taught.

    grid: (G,) values of `channel`; mean, observed_std: (G,) of the GP there, the noise among the latter;
    point_inputs, point_residuals: (N,) training rows; point_errors: (N,) residual minus the GP's mean at the row's
    own inputs; near: (N,) True on the rows that lie closest to the slice.
    """

    rate: str
    channel: str
    at: Mapping[str, float]
    grid: FloatArray
    mean: FloatArray
    observed_std: FloatArray
    point_inputs: FloatArray
    point_residuals: FloatArray
    point_errors: FloatArray
    near: BoolArray


@dataclass(frozen=True)
class MadeBy:
    """An artifact that the report rests on. role: what it is to the loop, as `GP-Mean`; seed: None where shared.

    It is known by the hash of its content: the number of its version says only what was made before it.
    """

    stage: str
    role: str
    sha256: str
    seed: int | None = None
    manifest: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class TripReport(AllTrips):
    """What a task with a goal adds. paths: of one place with all its headings (H), of the first seed.

    paths: goal (H, 2), target/POLICY and simulator/POLICY (H, T + 1, 3), NaN after the end; the rest in m.
    """

    paths: Mapping[str, FloatArray] = field(default_factory=dict)
    goal_radius: float = 0.05
    arena: float = 1.5
    floor: float = 4.0


@dataclass(frozen=True)
class LoopReport:
    """Everything that the report of a loop shows; parts that are missing are left out of the page.

    summary: the content of summary.json (returns, returns_all, returns_certified, share, one_step,
    one_step_random, rollout); returns: policy to (seeds, N) episode returns on the target, NaN where unknown;
    trips: what a task with a goal adds, else None; system: the base simulator;
    starts: the keys of the sets of starts to masks (N,); best_return: how many steps an episode may take,
    which is what it earns at most where every step earns 1 (earns_steps); own_rewards: whether rewards are a Gymnasium
    environment's own, of which none says that a start is solved (best_return is then the most that was earned);
    held: control steps that a decision is held in training; curves: policy to one (decisions, mean return) per seed;
    slices: rate to slice, of the first seed;
    named: seed to what its diagnosis found, in sentences; given: what the loop was given instead of making it
    (recording, diagnosis); fits: seed to the content of fit.json; outside: seed to the share of what each driver
    visited outside the recording; rollouts: simulator to (B, T + 1, S) states
    in the order of `states`; velocities: those states that are the velocity of another one;
    units: channel or rate to unit; limits: channel to the absolute value beyond which an episode ends;
    settings: the resolved configuration worth knowing; command: what makes this report again.
    """

    experiment: str
    seeds: tuple[int, ...]
    summary: Mapping[str, Any]
    returns: Mapping[str, FloatArray] = field(default_factory=dict)
    trips: TripReport | None = None
    system: str = "cartpole"
    starts: Mapping[str, BoolArray] = field(default_factory=dict)
    best_return: float = 500.0
    earns_steps: bool = True
    own_rewards: bool = False
    held: int = 1
    curves: Mapping[str, Sequence[tuple[FloatArray, FloatArray]]] = field(default_factory=dict)
    slices: Mapping[str, ResidualSlice] = field(default_factory=dict)
    named: Mapping[int, Sequence[str]] = field(default_factory=dict)
    given: tuple[str, ...] = ()
    fits: Mapping[int, Mapping[str, Any]] = field(default_factory=dict)
    outside: Mapping[int, Mapping[str, float | None]] = field(default_factory=dict)
    states: tuple[str, ...] = ()
    velocities: tuple[str, ...] = ()
    rollouts: Mapping[str, FloatArray] = field(default_factory=dict)
    dt: float = 1.0
    units: Mapping[str, str] = field(default_factory=dict)
    limits: Mapping[str, float] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    artifacts: Sequence[MadeBy] = ()
    command: str = ""

    @property
    def policies(self) -> tuple[str, ...]:
        """The policies that were compared, in the summary's order."""
        return tuple(self.summary.get("returns_all") or self.summary.get("returns") or self.returns)

    @property
    def set_words(self) -> Mapping[str, str]:
        """The sets of starts that can be told apart, in words, in order.

        Without a Target policy nobody knows what one solves: summary.json then has the certified starts there.
        """
        if self.own_rewards:
            return {ALL: "all starts"}
        how = "a search over action sequences" if self.earns_steps else "geometry of arcs and lines"
        words = {
            SOLVED: "starts that a Target policy of any seed solves",
            CERTIFIED: f"starts that {how} certifies as solvable",
            ALL: "all starts",
        }
        return {key: text for key, text in words.items() if key != SOLVED or "Target" in self.policies}

    @property
    def start_sets(self) -> tuple[str, ...]:
        """Those of `set_words` that the summary holds and that hold a start."""
        return tuple(
            key
            for key in self.set_words
            if any(stats.get("episodes", 0) for stats in (self.summary.get(key) or {}).values())
        )

    def stats(self, starts: str, policy: str) -> Mapping[str, Any]:
        """The summary of a policy on a set of starts; empty where it holds none."""
        return (self.summary.get(starts) or {}).get(policy) or {}

    def episodes(self, starts: str, policy: str) -> FloatArray:
        """(seeds, n): the known returns of a policy from a set of starts."""
        values = self.returns.get(policy)
        if values is None:
            return np.empty((0, 0))
        mask = self.starts.get(starts)
        return np.asarray(values if mask is None else values[:, mask], dtype=np.float64)

    def unit(self, name: str, unknown: str = "") -> str:
        """The unit of a channel or a rate, as it is printed."""
        return unit(self.units.get(name, unknown))

    def full_share(self, starts: str, policy: str) -> float:
        """Share of the episodes that earn all there is; NaN where none is known."""
        values = self.episodes(starts, policy)
        values = values[np.isfinite(values)]
        return float(np.mean(values >= self.best_return)) if values.size else float("nan")
