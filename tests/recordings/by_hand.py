"""Logs built by hand, with a known truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from gpsim.recordings import NamedLog, Topic, import_logs, parse_mapping
from gpsim.recordings.raw import Series


@dataclass
class HandLog:
    contents: dict[str, Series]
    epoch_ns: int = 0

    @property
    def losses(self):
        return {}

    def topics(self):
        return [
            Topic(name, s.type, len(s.receive), tuple(s.fields), 0.0, 1.0, s.header is not None)
            for name, s in self.contents.items()
        ]

    def series(self, wanted):
        return {name: self.contents[name] for name in wanted}


def series(topic, receive, header=None, **fields):
    named = {name.replace("__", "."): np.asarray(values, dtype=np.float64) for name, values in fields.items()}
    return Series(topic, "test", np.asarray(receive, dtype=np.float64), header, named, read=len(receive))


def pose_series(t, x, y, yaw, receive):
    """A planar pose whose quaternion changes sign at random rows, as drivers do."""
    sign = np.where(np.random.default_rng(1).random(len(t)) < 0.5, -1.0, 1.0)
    zero = np.zeros(len(t))
    return series(
        "/pose",
        receive,
        t,
        p__x=x,
        p__y=y,
        q__x=zero,
        q__y=zero,
        q__z=sign * np.sin(yaw / 2),
        q__w=sign * np.cos(yaw / 2),
    )


UNICYCLE: dict[str, Any] = {
    "system": "unicycle",
    "rate": 20,
    "gap_limit": 0.3,
    "state": {
        "x": {"topic": "/pose", "field": "p.x", "unit": "m"},
        "y": {"topic": "/pose", "field": "p.y", "unit": "m"},
        "yaw": {"topic": "/pose", "quaternion": "q", "unit": "rad", "wraps": True},
    },
    "action": {
        "v_cmd": {"topic": "/cmd", "field": "v", "unit": "m/s"},
        "w_cmd": {"topic": "/cmd", "field": "w", "unit": "rad/s"},
    },
}


@dataclass(frozen=True)
class Drive:
    """A drive at constant speed on a circle, turning with `w` [rad/s]: everything about it is known at any time."""

    v: float = 0.5
    w: float = 1.3

    def x(self, t):
        return self.v / self.w * np.sin(self.w * t)

    def y(self, t):
        return self.v / self.w * (1.0 - np.cos(self.w * t))

    def pose(self, t, receive=None):
        return pose_series(t, self.x(t), self.y(t), self.w * t, t if receive is None else receive)


def imported(contents, mapping, **changes):
    plan = parse_mapping({**mapping, **changes})
    return import_logs([NamedLog("hand", HandLog(contents))], plan, lambda name, one, m: {})


def cartpole_table(path, seed=0):
    t = np.arange(200) * 0.02
    table = pd.DataFrame({"t": t, "x": np.sin(t), "x_dot": np.cos(t), "theta": 0.1 * np.sin(3 * t)})
    force = np.random.default_rng(seed).normal(size=200)
    table.assign(theta_dot=0.3 * np.cos(3 * t), force=force).to_csv(path, index=False)
    return path
