"""What a motion capture of a site says of a model's geometry: zeros, lengths, turns, the frame, and what stays open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from gpsim.findings.effects import Estimate

GeometryKind = Literal[
    "frame turn",
    "frame place",
    "joint zero",
    "body place",
    "body turn",
    "site place",
    "site turn",
    "delay",
]


@dataclass(frozen=True)
class GeometryPlace:
    """One number of a model's geometry.

    kind: `frame`: of the motion capture against the model's world, turned about the first joint; `joint zero`: what is
    to be added to the encoder's reading; `body place`: along its parent's axes; `body turn`: about its own axes;
    `site`: of the marker on its body; `delay`: by how much its columns come late. on: the joint, body or site, "" of
    the frame; axis: x, y, z, "" where there is none.
    """

    kind: GeometryKind
    on: str
    axis: str


@dataclass(frozen=True, kw_only=True)
class InPlaceOf:
    """What would explain the same, and how large it would be; exact: no sample tells the two apart at all."""

    place: GeometryPlace
    value: float
    unit: str
    exact: bool


@dataclass(frozen=True, kw_only=True)
class GeometryFound:
    """A number that is off. model: whether it is the robot's, and corrected; else it is the laboratory's."""

    place: GeometryPlace
    size: Estimate
    model: bool
    instead: tuple[InPlaceOf, ...] = ()
    sentence: str = ""


@dataclass(frozen=True, kw_only=True)
class Inseparable:
    """A number that no sample tells from others; weights: how large a unit of it is in each of them."""

    place: GeometryPlace
    of: tuple[GeometryPlace, ...] = ()
    weights: tuple[float, ...] = ()
    sentence: str = ""


@dataclass(frozen=True, kw_only=True)
class ToolError:
    """Root mean square distance of model and marker [m] on held-out samples.

    before: as model and recording stand; placed: with the laboratory's numbers (frame, delay) fitted alone; after: with
    the robot's, too; noise: what is left in training, of all directions together.
    """

    before: float
    placed: float
    after: float
    noise: float


@dataclass(frozen=True, kw_only=True)
class Kinematics:
    """The geometry of a model as a motion capture saw it.

    targets: the sites and bodies that were seen; samples: looked at; lost: of these, seen by nobody or leaping;
    held_out: of these, judged on alone; independent: how many samples in training count, as errors are alike in
    neighbours; error: of each target. found: what is off; inseparable: what cannot be told from others.
    """

    targets: tuple[str, ...]
    samples: int
    lost: int
    held_out: int
    independent: float
    found: tuple[GeometryFound, ...]
    error: Mapping[str, ToolError]
    inseparable: tuple[Inseparable, ...] = ()
