"""Poses that somebody else measured: columns NAME.x .y .z [m], and NAME.qw .qx .qy .qz, that are no channel."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from gpsim.channels import Channel, Channels, FloatArray, IntArray
from gpsim.recordings.values import LARGEST, Columns, numbers_of

PLACE, TURN = ("x", "y", "z"), ("qw", "qx", "qy", "qz")


def pose_channels(names: Sequence[str], taken: Collection[str]) -> Channels:
    """The columns of poses among `names`, in their order, whole places alone; taken: names that mean something else."""
    heads = dict.fromkeys(name.removesuffix(".x") for name in names if name.endswith(".x"))
    found: list[Channel] = []
    for head in heads:
        place, turn = ([f"{head}.{part}" for part in parts] for parts in (PLACE, TURN))
        if not head or {*place, *turn} & {*taken} or not {*place} <= {*names}:
            continue
        found += [Channel(name, "m") for name in place]
        found += [Channel(name, "1") for name in turn] if {*turn} <= {*names} else []
    return Channels(tuple(found))


def numeric_poses(table: Columns, taken: Collection[str]) -> Channels:
    """The same of a table, of its columns of numbers."""
    return pose_channels([name for name, values in table.items() if values.dtype.kind in "fiu"], taken)


def pose_values(table: Columns, rows: IntArray, poses: Channels) -> FloatArray | None:
    """(K + 1, P) of an episode's rows, NaN where nothing was seen; None where nobody looked."""
    if not len(poses):
        return None
    values = numbers_of(table, poses.names, rows)
    return np.where(np.isfinite(values) & (np.abs(values) <= LARGEST), values, np.nan)
