"""load_simulator: what we believe, by name, from a file, or written where it is needed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from gpsim.errors import UsageError
from gpsim.mjcf import open_simulator, simulator_name
from gpsim.recordings import Recording
from gpsim.simulators import Integrator, Simulator, lives_here, own_simulator
from gpsim.trust import consent


def load_simulator(
    simulator: str | type[Any] | Callable[..., Any] | Simulator,
    *,
    state: Mapping[str, str] | None = None,
    action: Mapping[str, str] | None = None,
    parameters: Mapping[str, tuple[str, float, float, float]] | None = None,
    coordinates: Mapping[str, str] | None = None,
    force_units: Mapping[str, str] | None = None,
    wraps: Sequence[str] = (),
    start: Mapping[str, float] | None = None,
    integrator: Integrator | None = None,
) -> Simulator:
    """A base simulator: what we believe about the system.

    Args:
        simulator: one of
            a name: `cartpole`, `unicycle`, `ackermann`, `slider`, `pendulum` or `servo_joint`;
            a file: `"my_system.py:Tank"`, a class with `state`, `action`, `parameters` and `rates`;
            a MuJoCo model: `"robot.xml"`, `"robot.urdf"`, `"mine.py:function"` or `"gym:ID"` (needs `gpsim[mujoco]`);
            a class of that kind, or an object of one;
            a function `rates(state, action, parameters)`, which the arguments below describe.
            `state` and `action` are mappings of channel to (B,) numbers, `parameters` of name to number; it returns
            d/dt of every state channel, in the channel's unit per second, as a mapping of channel to (B,) numbers.
        state: channel: unit, in order. Of a function only, as all that follows.
        action: channel: unit, in order.
        parameters: name: (unit, default, low, high). Each may turn out to be off.
        coordinates: {position: velocity}. Then the function returns the rates of all states but the positions, and
            friction, springs and drag can be found: as an acceleration of that velocity alone. A function that takes
            a fourth argument `forces`, position: (B,) numbers, says itself what a force on a coordinate does.
        force_units: {position: unit} of those forces.
        wraps: angles in rad that are known modulo 2 pi.
        start: {channel: guess} of states that a recording may lack.
        integrator: `euler` (the default), `semi_implicit` or `rk4`, where no recording says it.

    Returns:
        The simulator. One that was written here lives in this process: it diagnoses on one core.

    Raises:
        UsageError: no such name or file, or what it returns has another shape, raises or is not finite.

    Example:
        >>> import numpy as np
        >>> import gpsim
        >>> def tank(state, action, parameters):
        ...     outflow = parameters["outflow"] * np.sqrt(np.maximum(state["level"], 0.0))
        ...     return {"level": action["pump"] - outflow}
        >>> simulator = gpsim.load_simulator(
        ...     tank,
        ...     state={"level": "m"},
        ...     action={"pump": "m/s"},
        ...     parameters={"outflow": ("m^0.5/s", 0.1, 0.0, 10.0)},
        ... )
        >>> simulator.name, gpsim.load_simulator("slider").state.units
        ('tank()', {'q': 'm', 'q_dot': 'm/s'})
    """
    given = {
        "state": state, "action": action, "parameters": parameters, "coordinates": coordinates,
        "force_units": force_units, "wraps": wraps or None, "start": start, "integrator": integrator,
    }  # fmt: skip
    declared = {key: value for key, value in given.items() if value is not None}
    if isinstance(simulator, str | Path | Simulator):
        if declared:
            raise UsageError(
                f"load_simulator: {', '.join(declared)} go with a function, not with {simulator}"
            )
        if isinstance(simulator, Simulator):
            return simulator
        consent(str(simulator))
        return open_simulator(str(simulator))
    return own_simulator(simulator, declared)


def simulator_of(recording: Recording, place: Path) -> Simulator:
    """The simulator that a recording names by its `system`, or by its `model`, which may lie in `place` beside it."""
    if lives_here(recording.system):
        raise UsageError(
            f"the recording is for {recording.system}, which is not in a file: also give the simulator"
        )
    return open_simulator(simulator_name(None, recording, place))


def folder_of(recording: object) -> Path:
    """Where the files of a recording lie that is given by its path; here, where it is given itself."""
    path = Path(recording) if isinstance(recording, str | Path) else Path()
    return path if path.is_dir() else path.parent
