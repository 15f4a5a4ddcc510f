"""monitor.json: the monitor of a safe deployment for an exported ROS node, which has NumPy alone."""

from __future__ import annotations

from typing import Any

from gpsim.corrected import CorrectedPlant, GpCorrection
from gpsim.errors import UsageError
from gpsim.evaluation import BETS, Monitor
from gpsim.gp import Predictor
from gpsim.stages import safety
from gpsim.stages.stage import Request

SCHEMA = "gpsim.monitor/1"
POSE, TWIST = ("x", "y", "yaw"), ("v_cmd", "w_cmd")


def monitor_facts(request: Request) -> dict[str, Any]:
    """The monitor as configured; raises UsageError for one that a node cannot predict with."""
    return facts_of(safety.monitor_of(request, "export"))


def facts_of(monitor: Monitor) -> dict[str, Any]:
    """The predictor and what is usual; raises UsageError as above."""
    plant, usual = monitor.plant, monitor.usual
    if (plant.state.names, plant.action.names) != (POSE, TWIST):
        raise UsageError(
            "--monitor: is of a vehicle in the plane that is told its speed and turn rate, no other"
        )
    gp = plant.correction if isinstance(plant, CorrectedPlant) else None
    # A chain of processes is a predictor, too, but has no form of its own.
    if (
        not isinstance(plant, CorrectedPlant)
        or not isinstance(gp, GpCorrection)
        or type(gp.predictor) is not Predictor
    ):
        raise UsageError(
            "--monitor: a node predicts by one Gaussian process a rate, as gp=exact has; effects and chained ones have "
            "memories and parts that it lacks: watch its bag with gpsim deploy --replay"
        )
    (shift, linear, weights), features, late = gp.predictor.mean_form, gp.features, plant.filter
    inputs = [
        [column, item.function or "", bool(wraps) and item.function in (None, "sign")]
        for column, item, wraps in zip(features.columns, features.items, features.wraps, strict=True)
    ]
    return {
        "schema": SCHEMA,
        "dt": plant.dt,
        "integrator": plant.integrator,
        "delay": list(late.delay) if late else [],
        "lag": list(late.time_constant) if late else [],
        "gp": {
            "inputs": inputs,
            "shift": shift.tolist(),
            "linear": linear.tolist(),
            "weights": weights.tolist(),
        },
        "scale": usual.scale.tolist(),
        "usual": usual.mean,
        "cap": monitor.settings.cap,
        "bets": list(BETS),
        "threshold": monitor.threshold,
        "stated_false_stops": monitor.settings.false_stops,
        "minutes": monitor.settings.minutes,
    }
