"""Physics outside the catalogue: kinds that no family of `gpsim.effects` describes, and never will.

Ten are everybody's. The others come in generations of ten, a file each (`kinds_2026.py` and so on). A seed draws
everybody's and those of the last generation that began with it or before it, so that half of the kinds of a measurement
run for the first time; seeds for tuning draw everybody's alone. A new generation is one file with its laws, one with
its strengths (`strengths_2031.py`, for one), and an entry in GENERATIONS and in `outside_strengths.OUTSIDE`.
"""

from __future__ import annotations

from gpsim.trials.outside import kinds_2026, kinds_2028, kinds_2029, kinds_2030, kinds_2031
from gpsim.trials.outside.kind import Generation, Kind
from gpsim.trials.outside.kinds_everybody import EVERYBODYS

TUNING = range(1, 100)
"""Seeds that tuning may use."""
GENERATIONS = (
    kinds_2026.GENERATION,
    kinds_2028.GENERATION,
    kinds_2029.GENERATION,
    kinds_2030.GENERATION,
    kinds_2031.GENERATION,
)
"""In the order of their first seeds."""
_ALL = (EVERYBODYS, *GENERATIONS)

KINDS = {name: kind for g in _ALL for name, kind in g.kinds.items()}
FORCES = {name: law for g in _ALL for name, law in g.forces.items()}
HIDDEN = {name: law for g in _ALL for name, law in g.hidden.items()}
INERTIA = {name: law for g in _ALL for name, law in g.inertia.items()}
COUPLED = {name: law for g in _ALL for name, law in g.coupled.items()}
ACTUATORS = {name: law for g in _ALL for name, law in g.actuators.items()}
TWIST = {name: law for g in _ALL for name, law in g.twist.items()}
HIDDEN_TWIST = {name: law for g in _ALL for name, law in g.hidden_twist.items()}
BENT = {name: law for g in _ALL for name, law in g.bent.items()}
RECALLED = {name: law for g in _ALL for name, law in g.recalled.items()}


def drawn(seed: int) -> dict[str, Kind]:
    """The kinds that a seed may draw."""
    if seed in TUNING:
        return dict(EVERYBODYS.kinds)
    return {**EVERYBODYS.kinds, **_newest(seed).kinds}


def allowed(seed: int, system: str) -> list[str]:
    """The kinds that a seed may draw on a system."""
    return [name for name, kind in drawn(seed).items() if system in kind.systems]


def _newest(seed: int) -> Generation:
    return [g for g in GENERATIONS if g.since <= seed][-1]
