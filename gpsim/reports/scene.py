"""What a file of motions shows: numbers, and bodies, as frames that move and shapes that hang in them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.recordings import Recording
from gpsim.reports.canvas import FAINT, OTHERS, POLICIES
from gpsim.traces import Alongside

Vector = tuple[float, float, float]  # x, y, z
Turn = tuple[float, float, float, float]  # a unit quaternion x, y, z, w
Columns = Mapping[str, FloatArray]
WORLD = "world"  # x ahead, y to the left, z upwards
STRAIGHT: Turn = (0.0, 0.0, 0.0, 1.0)
REAL = "real"
COLOURS = {
    REAL: FAINT,
    "base": POLICIES["Source"],
    "corrected": OTHERS[0],
    "corrected_gp": POLICIES["GP-Sample"],
}


@dataclass(frozen=True)
class Frame:
    """Where a part is in its parent's frame at N moments. parent: a part, `` the root, WORLD what stands still.

    position: (N, 3) m; turn: (N, 4) unit quaternions x, y, z, w.
    """

    parent: str
    position: FloatArray
    turn: FloatArray


@dataclass(frozen=True)
class Shape:
    """What is drawn in a frame: centre and whole size along its own axes, both in m, turned (x, y, z, w).

    A cylinder stands along its z, an arrow points along x from its centre. A mesh has triangles (F, 3, 3) m instead.
    """

    frame: str
    kind: Literal["cube", "cylinder", "sphere", "arrow", "mesh"]
    centre: Vector
    size: Vector
    turn: Turn = STRAIGHT
    triangles: FloatArray | None = None


@dataclass(frozen=True)
class Body:
    """needs: state channels that must be known; frames(columns (N,) by channel): in the order of parents.

    path: x and y are a trail.
    """

    needs: tuple[str, ...]
    frames: Callable[[Columns], dict[str, Frame]]
    shapes: tuple[Shape, ...]
    path: bool = False


@dataclass(frozen=True)
class Shown:
    """What a file holds. held_out: (E,) first sample of every episode that was only judged on, past its end if none.

    facts: what is said of the diagnosis, in words.
    """

    recording: Recording
    along: Alongside
    body: Body | None
    held_out: IntArray
    facts: Mapping[str, str]

    @property
    def motions(self) -> tuple[str, ...]:
        """What was measured, and what every model says."""
        return (REAL, *self.along.models)

    def frames(self, names: tuple[str, ...], states: FloatArray) -> dict[str, Frame]:
        """The body's frames of N states (N, S), without a place (NaN) where not all that places it is known.

        A state that never changes is where it always is.
        """
        columns = {name: np.full(len(states), value) for name, value in self.along.held.items()}
        columns |= dict(zip(names, states.T, strict=True))
        if self.body is None or not set(self.body.needs) <= columns.keys():
            return {}
        unknown = ~np.isfinite([columns[name] for name in self.body.needs]).all(axis=0)
        found = self.body.frames({name: np.nan_to_num(column) for name, column in columns.items()})
        for frame in found.values():
            frame.position[unknown] = np.nan
        return found

    def path(self, index: int) -> FloatArray:
        """(N, 2) m: where a vehicle went in an episode; of no length for what leaves no trail."""
        names, states = self.recording.state.names, self.recording.episodes[index].states
        if self.body is None or not self.body.path or not {"x", "y"} <= set(names):
            return np.empty((0, 2))
        path = states[:, [names.index("x"), names.index("y")]]
        return path[np.isfinite(path).all(axis=1)]
