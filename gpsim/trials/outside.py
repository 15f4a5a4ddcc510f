"""Physics outside the catalogue: kinds that no family of `gpsim.effects` described when they were written.

A kind that has become a word since says so (`family`): who names it is right.

A kind is one class: its docstring says the law, its methods are the law, `strength` draws its parameters, `since` is
the first seed whose worlds may hold it (None: those of every seed may). Files go by the site where kinds act. A new
kind is one class; `since` must be a seed of which no world has been drawn yet, or published proofs could not be
repeated. Twenty kinds a measurement: ten for every seed, ten that are new to it.

Random laws of one input (CURVES) are drawn for worlds of their own, which prove measured curves.

Laws here are never shared with `gpsim.effects`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

# Kinds are listed as their files are read.
from gpsim.trials import outside_chain, outside_forces  # noqa: F401
from gpsim.trials.outside_curves import FreeCurve
from gpsim.trials.outside_kind import Kind

TUNING = range(1, 100)
"""Seeds that tuning may use."""
REVEALED = 2031
"""The last seed whose measurement is published."""
K = TypeVar("K", bound=Kind)
CURVES: Mapping[str, type[FreeCurve]] = {n: k for n, k in Kind.listed.items() if issubclass(k, FreeCurve)}
"""Random laws of one input, which only the worlds that prove measured curves hold."""
KINDS: Mapping[str, type[Kind]] = {n: k for n, k in Kind.listed.items() if n not in CURVES}
EVERY_KIND: Mapping[str, type[Kind]] = {**KINDS, **CURVES}


def at_site(site: type[K]) -> dict[str, type[K]]:
    """The kinds that act at a site."""
    return {name: kind for name, kind in EVERY_KIND.items() if issubclass(kind, site)}


def drawn(seed: int) -> dict[str, type[Kind]]:
    """The kinds that a seed may draw: those for every seed, and the newest that began with it or before it.

    Seeds for tuning draw those for every seed alone. So half of the kinds of a measurement can run for the first time,
    and the worlds of a seed stay what they are when kinds are added with a later `since`.
    """
    begun = [kind.since for kind in KINDS.values() if kind.since is not None and kind.since <= seed]
    newest = None if seed in TUNING else max(begun)
    return {name: kind for name, kind in KINDS.items() if kind.since in (None, newest)}


def nuisances(seed: int) -> dict[str, type[Kind]]:
    """The kinds that a seed's rough worlds may hold beside their main effects: those it draws.

    Seeds for tuning may hold every kind of the measurements that were revealed, too.
    """
    if seed in TUNING:
        return {name: kind for name, kind in KINDS.items() if kind.since is None or kind.since <= REVEALED}
    return drawn(seed)
