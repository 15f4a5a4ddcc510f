"""Every kind of physics outside the catalogue, by name, and which of them a seed draws."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from gpsim.trials.outside import (
    actuators,
    actuators_with_memory,
    coupled_forces,
    forces_of_position,
    forces_of_speed,
    forces_of_time,
    free_curves,
    hidden_masses,
    hidden_materials,
    inertias,
    sensors,
    twists,
)
from gpsim.trials.outside.kind import Kind

TUNING = range(1, 100)
"""Seeds that tuning may use."""
REVEALED = 2031
"""The last seed whose measurement is published."""
K = TypeVar("K", bound=Kind)


def _named(kinds: tuple[type[Kind], ...]) -> dict[str, type[Kind]]:
    """Kinds by name; no two may have the same."""
    found: dict[str, type[Kind]] = {}
    for kind in kinds:
        if kind.name in found:
            raise ValueError(f"two kinds are called {kind.name}")
        found[kind.name] = kind
    return found


KINDS: Mapping[str, type[Kind]] = _named(
    (
        *forces_of_position.KINDS,
        *forces_of_speed.KINDS,
        *forces_of_time.KINDS,
        *hidden_materials.KINDS,
        *hidden_masses.KINDS,
        *coupled_forces.KINDS,
        *inertias.KINDS,
        *actuators.KINDS,
        *actuators_with_memory.KINDS,
        *twists.KINDS,
        *sensors.KINDS,
    )
)

CURVES: Mapping[str, type[free_curves.FreeCurve]] = {kind.name: kind for kind in free_curves.KINDS}
"""Random laws of one input, which only the worlds that prove measured curves hold."""
EVERY_KIND: Mapping[str, type[Kind]] = {**KINDS, **CURVES}


def at_site(site: type[K]) -> dict[str, type[K]]:
    """The kinds that act at a site."""
    return {name: kind for name, kind in EVERY_KIND.items() if issubclass(kind, site)}


def drawn(seed: int) -> dict[str, type[Kind]]:
    """The kinds that a seed may draw: those for every seed, and the newest that began with it or before it.

    Seeds for tuning draw those for every seed alone. So half of the kinds of a measurement can run for the first time,
    and the worlds of a seed stay what they are when kinds are added with a later `since`.
    """
    if seed in TUNING:
        return {name: kind for name, kind in KINDS.items() if kind.since is None}
    newest = max(kind.since for kind in KINDS.values() if kind.since is not None and kind.since <= seed)
    return {name: kind for name, kind in KINDS.items() if kind.since in (None, newest)}


def nuisances(seed: int) -> dict[str, type[Kind]]:
    """The kinds that a seed's rough worlds may hold beside their main effects: those it draws.

    Seeds for tuning may hold every kind of the measurements that were revealed, too.
    """
    if seed in TUNING:
        return {name: kind for name, kind in KINDS.items() if kind.since is None or kind.since <= REVEALED}
    return drawn(seed)
