"""Values of a term that are one recording's own, where several recordings of one machine are judged together.

A value that all recordings share has its parameter's name. One that belongs to recording k alone is called `name@k` and
stands in the place of the shared one there: a sensor's offset on one day, a payload in one log.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import IntArray
from gpsim.effects.effect import Values

OWN = "@"


def own_name(name: str, recording: int) -> str:
    """What a recording's own value of a parameter is called."""
    return f"{name}{OWN}{recording}"


def base_name(name: str) -> str:
    """The parameter's name, whoever's value it is."""
    return name.partition(OWN)[0]


def owner_of(name: str) -> int | None:
    """The recording whose own a value is; None of one that is shared."""
    owner = name.partition(OWN)[2]
    return int(owner) if owner else None


def own_values(values: Values, recordings: IntArray | None) -> Values:
    """(B,) values by name as they are in the recording of each row (B,); None: in one without any of its own."""
    out = {name: value for name, value in values.items() if owner_of(name) is None}
    for name, value in values.items():
        owner = owner_of(name)
        if owner is not None and recordings is not None:
            base = base_name(name)
            out[base] = np.where(recordings == owner, value, out[base])
    return out
