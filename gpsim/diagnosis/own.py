"""Values that are one recording's own, by the recording's name: of several recordings that are judged together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from gpsim.diagnosis.report import Combination, Estimate
from gpsim.effects import base_name, owner_of


def parted(
    estimates: Mapping[str, Estimate], names: Sequence[str]
) -> tuple[dict[str, Estimate], dict[str, dict[str, Estimate]]]:
    """The parameters that recordings share, and recording -> its own; where none is shared, the first one's own."""
    shared = {name: e for name, e in estimates.items() if owner_of(name) is None}
    own: dict[str, dict[str, Estimate]] = {}
    for place, recording in enumerate(names):
        values = {base_name(name): e for name, e in estimates.items() if owner_of(name) == place}
        if values:
            own[recording] = values
    return shared or dict(next(iter(own.values()), {})), own


def by_name(combinations: Iterable[Combination], names: Sequence[str]) -> tuple[Combination, ...]:
    """Combinations of parameters, each of them called by the recording whose own it is."""
    return tuple(replace(c, of=tuple(_called(name, names) for name in c.of)) for c in combinations)


def _called(parameter: str, names: Sequence[str]) -> str:
    owner = owner_of(parameter) if names else None
    return parameter if owner is None else f"{base_name(parameter)} in {names[owner]}"
