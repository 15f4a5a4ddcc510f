"""Parameters of what was said against the true ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gpsim.trials.scoring.claims import Json, identity

FACTORS = (
    "gain",
    "ratio",
    "scale",
    "gain_positive",
    "gain_negative",
)  # they change nothing at 1, others at 0


def parameter_errors(truth: Sequence[Json], said: Sequence[Json]) -> list[dict[str, Any]]:
    """Errors of the parameters of every true effect that was said; whether their intervals hold them.

    Errors are relative to a value and to what it changes.
    """
    found = {identity(e): e["parameters"] for e in said}
    out = []
    for effect in truth:
        for name, value in effect["parameters"].items():
            given = found.get((effect["family"], effect["on"]), {}).get(name)
            if given is None:
                continue
            covered = given["low"] is not None and given["low"] <= value <= given["high"]
            error, neutral = abs(given["value"] - value), 1.0 if name in FACTORS else 0.0
            out.append(
                {
                    "family": effect["family"],
                    "name": name,
                    "relative_error": error / max(abs(value), 1e-300),
                    "error_of_effect": error / max(abs(value - neutral), 1e-300),
                    "covered": bool(covered),
                    # Where zero is an arbitrary point, an error relative to the value says nothing.
                    "has_scale": name != "rest_position"
                    and not (effect["family"] == "payload" and name in "xyz"),
                }
            )
    return out
