"""Physics outside the catalogue: kinds that no family of `gpsim.effects` described when they were written.

A kind that has become a word since says so (`word`): who names it is right. Kinds stand in the tables of `outside_body`
and `outside_chain`; `since` of a new one must be a seed of which no world has been drawn yet, or published proofs could
not be repeated. Twenty kinds a measurement: ten for every seed, ten that are new to it. Random laws of one input
(CURVES) are drawn for worlds of their own, which prove measured curves. Nothing here is shared with `gpsim.effects`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from gpsim.trials import catalogue
from gpsim.trials.catalogue import Family, Site
from gpsim.trials.outside_body import OF_BODIES
from gpsim.trials.outside_chain import OF_CHAINS
from gpsim.trials.outside_curves import CURVES

TUNING = range(1, 100)
"""Seeds that tuning may use."""
REVEALED = 2031
"""The last seed whose measurement is published."""
KINDS: Mapping[str, Family] = {**OF_CHAINS, **OF_BODIES}
EVERY_KIND: Mapping[str, Family] = {**KINDS, **CURVES}
LAWS: Mapping[str, Family] = {**catalogue.FAMILIES, **EVERY_KIND}
"""Every family and every kind."""


def at_site(site: Site) -> dict[str, Callable[..., Any]]:
    """The laws of the kinds that act at a site."""
    return catalogue.at_site(site, EVERY_KIND)


def drawn(seed: int) -> dict[str, Family]:
    """The kinds that a seed may draw: those for every seed, and the newest that began with it or before it.

    Seeds for tuning draw those for every seed alone. So half of the kinds of a measurement can run for the first time,
    and the worlds of a seed stay what they are when kinds are added with a later `since`.
    """
    begun = [kind.since for kind in KINDS.values() if kind.since is not None and kind.since <= seed]
    newest = None if seed in TUNING else max(begun)
    return {name: kind for name, kind in KINDS.items() if kind.since in (None, newest)}


def nuisances(seed: int) -> dict[str, Family]:
    """The kinds that a seed's rough worlds may hold beside their main effects: those it draws.

    Seeds for tuning may hold every kind of the measurements that were revealed, too.
    """
    if seed in TUNING:
        return {name: kind for name, kind in KINDS.items() if kind.since is None or kind.since <= REVEALED}
    return drawn(seed)
