"""Reach a goal: the thesis's task for a vehicle in the plane (section 4.4.2 and Table 4.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from gpsim.channels import BoolArray, Channels, FloatArray
from gpsim.tasks.task import Actions, Start

X, Y, YAW = 0, 1, 2


@dataclass(frozen=True)
class GoalReaching:
    """Drive the pose (x, y [m], yaw [rad]) to within goal_radius [m] of a goal; the context is the goal (x, y).

    Training starts and goals are uniform in a square of edge `arena` [m] about the origin, agent_radius from its edge;
    in simulation nothing stops at that edge. On the target the episode ends where the centre leaves the square of
    edge `floor` [m]. Evaluation starts lie within +-evaluation_spread of the centre, each with evaluation_headings
    headings, and share evaluation_goal, as in the thesis's Figure 4.3.
    """

    arena: float = 1.5
    agent_radius: float = 0.2
    goal_radius: float = 0.05
    goal_reward: float = 10.0
    speed: Sequence[float] = (0.0, 0.2)
    turn: Sequence[float] = (-0.3, 0.3)
    max_steps: int = 500
    floor: float = 4.0
    evaluation_goal: Sequence[float] = (0.5, -0.5)
    evaluation_spread: float = 0.3
    evaluation_headings: int = 8
    ends_at_edge: bool = False

    state: ClassVar[Channels] = Channels.of({"x": "m", "y": "m", "yaw": "rad"}, wraps=("yaw",))
    action: ClassVar[Channels] = Channels.of({"v_cmd": "m/s", "w_cmd": "rad/s"})

    def __post_init__(self) -> None:
        for name in ("speed", "turn", "evaluation_goal"):
            if len(getattr(self, name)) != 2:
                raise ValueError(f"{name} must be two numbers, got {list(getattr(self, name))}")
        for name in ("goal_radius", "floor"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name):g}")
        for name in ("agent_radius", "evaluation_spread"):
            if not getattr(self, name) >= 0:
                raise ValueError(f"{name} must be at least 0, got {getattr(self, name):g}")
        for name in ("max_steps", "evaluation_headings"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        if not self.arena > 2.0 * self.agent_radius:
            raise ValueError(
                f"arena {self.arena:g} m has no room for an agent of radius {self.agent_radius:g} m"
            )
        if not self.goal_radius < self.arena / 2.0 - self.agent_radius:
            raise ValueError(
                f"goal_radius {self.goal_radius:g} m leaves no room in the arena for a path to the goal"
            )
        if not (self.speed[0] < self.speed[1] and self.turn[0] < self.turn[1]):
            raise ValueError("speed and turn need a lower bound below the upper one")

    @property
    def observation_space(self) -> gymnasium.Space[Any]:
        """The goal in the agent's frame (2,): ahead and to the left [m]."""
        return gymnasium.spaces.Box(-np.inf, np.inf, (2,), np.float32)

    @property
    def action_space(self) -> gymnasium.Space[Any]:
        """Speed [m/s] and turn rate [rad/s]."""
        low, high = np.array([self.speed, self.turn], dtype=np.float32).T
        return gymnasium.spaces.Box(low, high, (2,), np.float32)

    def start(self, count: int, rng: np.random.Generator) -> Start:
        """Uniform poses and goals, never within reach of each other from the beginning."""
        half = self.arena / 2.0 - self.agent_radius
        places = rng.uniform(-half, half, (count, 4))
        while (close := self._distance(places[:, :2], places[:, 2:]) <= self.goal_radius).any():
            places[close, 2:] = rng.uniform(-half, half, (int(close.sum()), 2))
        return Start(
            np.column_stack([places[:, :2], rng.uniform(-np.pi, np.pi, count)]), places[:, 2:].copy()
        )

    def evaluation_starts(self, count: int, rng: np.random.Generator) -> Start:
        """The first `count` of: drawn places, each with every heading, all with the one goal."""
        places = -(-count // self.evaluation_headings)
        drawn = rng.uniform(-self.evaluation_spread, self.evaluation_spread, (places, 2))
        yaw = -np.pi + 2.0 * np.pi * np.arange(self.evaluation_headings) / self.evaluation_headings
        states = np.column_stack([np.repeat(drawn, len(yaw), axis=0), np.tile(yaw, places)])[:count]
        return Start(states, np.tile(np.asarray(self.evaluation_goal, dtype=np.float64), (count, 1)))

    def on_target(self) -> GoalReaching:
        """The same task where the floor has an edge."""
        return replace(self, ends_at_edge=True)

    def observe(self, states: FloatArray, context: FloatArray) -> NDArray[np.float32]:
        """(B, 2): the goal in the agent's frame."""
        return self._local(states, context).astype(np.float32)

    def command(self, actions: Actions) -> FloatArray:
        """(B, 2): v_cmd [m/s], w_cmd [rad/s], inside the action space."""
        low, high = np.array([self.speed, self.turn]).T
        return np.clip(np.asarray(actions, dtype=np.float64), low, high)

    def reward(
        self, states: FloatArray, actions: Actions, next_states: FloatArray, context: FloatArray
    ) -> FloatArray:
        """(4.14), what the turn towards the goal gained [rad], and goal_reward on reaching it."""
        turned = np.abs(self.bearing(states, context)) - np.abs(self.bearing(next_states, context))
        return np.asarray(turned + self.goal_reward * self.reached(next_states, context))

    def terminated(self, states: FloatArray, context: FloatArray) -> BoolArray:
        """The goal is reached, the edge crossed where it counts, or the numbers have ceased to be finite."""
        over = self.reached(states, context) | ~np.isfinite(states).all(axis=1)
        return over | self.outside(states) if self.ends_at_edge else over

    def reached(self, states: FloatArray, context: FloatArray) -> BoolArray:
        """(B,): the centre is within goal_radius of the goal."""
        return np.asarray(self._distance(states[:, :2], context) <= self.goal_radius)

    def outside(self, states: FloatArray) -> BoolArray:
        """(B,): the centre has left the floor."""
        return np.asarray((np.abs(states[:, :2]) > self.floor / 2.0).any(axis=1))

    def bearing(self, states: FloatArray, context: FloatArray) -> FloatArray:
        """(B,): angle from the heading to the goal [rad], in [-pi, pi]."""
        local = self._local(states, context)
        return np.asarray(np.arctan2(local[:, 1], local[:, 0]))

    @staticmethod
    def _distance(places: FloatArray, goals: FloatArray) -> FloatArray:
        return np.asarray(np.hypot(*(goals - places).T))

    @staticmethod
    def _local(states: FloatArray, context: FloatArray) -> FloatArray:
        dx, dy = (context - states[:, :2]).T
        sin, cos = np.sin(states[:, YAW]), np.cos(states[:, YAW])
        return np.column_stack([dx * cos + dy * sin, dy * cos - dx * sin])
