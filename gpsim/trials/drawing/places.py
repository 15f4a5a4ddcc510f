"""On which systems and places a family, or a kind outside the catalogue, makes sense."""

from __future__ import annotations

from gpsim.trials import catalogue, outside
from gpsim.trials.worlds import SYSTEMS, System


def systems_of(family: str) -> list[str]:
    """The systems on which a family makes sense."""
    return [name for name, system in SYSTEMS.items() if places_of(family, system, "measured")]


def places_of(family: str, system: System, velocities: str | None) -> list[str]:
    """What a family can act on in a system, so that a recording can show it."""
    if family in outside.KINDS:
        return outside.KINDS[family].places(system, velocities)
    if family in catalogue.WORDS:
        return catalogue.places_of(family, system)
    if family in catalogue.SMOOTH or family in catalogue.GRIP:
        return list(system.coordinates)
    if family in catalogue.ACTUATORS:
        return list(system.action)
    if family == "parameter_offset":
        return list(system.parameters)
    if family in catalogue.TWIST:
        return ["vehicle"] if system.vehicle else []
    if family in ("marker_offset", "frame_rotation"):
        return ["pose"] if system.vehicle else []
    if system.vehicle:
        return {"sensor_bias": ["yaw"], "sensor_scale": ["x", "y"]}.get(family, list(system.names))
    readable = [c for c in system.names if c in system.coordinates or velocities == "measured"]
    if family == "sensor_bias":  # nothing depends on where along its guide a cart or slider is
        return [c for c in readable if c not in ("x", "q")]
    return readable


def of_body(family: str) -> bool:
    """Whether it acts in the body itself; before or after it the engine does not matter."""
    if family in outside.KINDS:
        return outside.KINDS[family].of_body
    return not (family in catalogue.ACTUATORS or family.startswith("sensor_"))
