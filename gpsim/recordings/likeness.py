"""How well a column's name fits a channel: by the words that roboticists use for it."""

from __future__ import annotations

import re
from collections.abc import Sequence

EXACT, FULL, LAST, MEASURED = 5.0, 4.0, 1.9, 1.5
"""Called as the channel; as one of its words; its last word is one; one of them and an m, as qm."""
LATER = 0.1  # less for every place that a word stands further back in its list
WORDS: dict[str, tuple[str, ...]] = {
    "position": ("position", "pos", "q", "x", "displacement", "travel", "distance", "s"),
    "angle": ("theta", "angle", "phi", "th", "alpha", "position", "pos", "q", "rotation"),
    "heading": ("yaw", "heading", "psi", "theta", "orientation"),
    "x": ("x",),
    "y": ("y",),
    "velocity": ("velocity", "vel", "speed", "v", "qd", "xd", "dq", "dx"),
    "angular_velocity": (
        "omega",
        "velocity",
        "vel",
        "angular_velocity",
        "w",
        "speed",
        "qd",
        "dq",
        "rate",
        "gyro",
    ),
    "force": ("force", "motor_force", "u", "f", "effort", "command", "cmd", "control", "input", "action"),
    "torque": (
        "torque",
        "tau",
        "effort",
        "motor_torque",
        "u",
        "command",
        "cmd",
        "control",
        "input",
        "action",
    ),
    "speed_command": ("v_cmd", "cmd_v", "speed", "throttle", "v", "v_ref", "linear", "velocity_command"),
    "turn_command": ("w_cmd", "cmd_w", "omega", "angular", "turn_rate", "yaw_rate", "w"),
    "steering_command": ("steering", "steer", "delta", "steering_angle", "steering_cmd"),
    "time": ("t", "time", "timestamp", "stamp", "elapsed_time", "time_s"),
}
"""What a quantity is called, the likeliest first."""
NO_STATE = frozenset({
    "target", "desired", "des", "ref", "reference", "cmd", "command", "goal", "set", "setpoint", "planned", "err",
    "error", "raw", "squared", "sin", "cos", "acc", "accel", "imu", "std", "cov", "covariance", "count", "seq",
})  # fmt: skip
"""Words of a column that is not what was measured of a state."""
NO_ACTION = frozenset(
    {"raw", "squared", "err", "error", "measured", "sin", "cos", "std", "acc", "seq", "count"}
)
_UNIT = re.compile(r"\s*[\[(]([^\])]*)[\])]\s*$")


def words_of(name: str) -> list[str]:
    """`angleD [rad/s]` -> [angle, d]; numbers apart, units and slashes left out."""
    bare = _UNIT.sub("", name)
    bare = re.sub(r"([a-z])([A-Z])", r"\1 \2", bare)
    return [word for word in re.split(r"[^a-zA-Z]+", bare.lower()) if word]


def unit_of(name: str) -> str:
    """The unit that a column's name ends in, as `[deg]` or `(ms)`; empty without one."""
    found = _UNIT.search(name)
    return found[1].strip() if found else ""


def likeness(name: str, channel: str, words: Sequence[str], never: frozenset[str]) -> float:
    """How well a column fits a channel that is called by these words; 0 where it does not."""
    own = words_of(name)
    joined = "_".join(own)
    if joined == "_".join(words_of(channel)) or name == channel:
        return EXACT
    if never & set(own) or not own:
        return 0.0
    for place, word in enumerate(words):
        less = LATER * place
        if joined == word:
            return FULL - less
        if own[-len(word.split("_")) :] == word.split("_"):
            return LAST - less
        if len(own) == 1 and own[0] == f"{word}m":
            return MEASURED - less
    return 0.0


def rate_words(position: str) -> tuple[str, ...]:
    """What the velocity of a position column is called, beside the words for velocities."""
    own = "_".join(words_of(position))
    ends = [f"{own}_{end}" for end in ("d", "dot", "vel", "velocity", "rate", "speed")]
    return (*ends, f"d_{own}", f"{own}d", f"{own}dot", f"d{own}", f"v_{own}", f"v{own}")
