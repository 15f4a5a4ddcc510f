"""Several recordings of one machine as one, whose episodes say which of them they are from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gpsim.channels import Channels
from gpsim.errors import UsageError
from gpsim.recordings.recording import Episode, Recording, Source

SAME_STEP = 0.05  # relative difference of two recordings' steps that the clocks of one machine may make


def joined(recordings: Sequence[Recording], names: Sequence[str]) -> Recording:
    """The recordings one after the other; raises UsageError where they are not of one machine at one rate.

    Episodes are called `recording/episode`. Each recording keeps its own clock and what it holds out. A channel's known
    noise is the largest that a recording says.
    """
    first = recordings[0]
    for recording, name in zip(recordings[1:], names[1:], strict=True):
        _check_alike(first, recording, names[0], name)
    stated = [n for n in first.noise if all(n in r.noise for r in recordings)]
    return replace(
        first,
        episodes=tuple(
            replace(episode, name=f"{name}/{episode.name}", source=place)
            for place, (recording, name) in enumerate(zip(recordings, names, strict=True))
            for episode in recording.episodes
        ),
        clock="episode",
        noise={n: max(r.noise[n] for r in recordings) for n in stated},
        held_out=None,
        sources=tuple(Source(n, r.held_out) for n, r in zip(names, recordings, strict=True)),
    )


def apart(recording: Recording) -> list[Recording]:
    """The recordings that a joined one is of, as it has them; itself where it is one."""
    if not recording.sources:
        return [recording]
    return [
        replace(recording, episodes=_of(recording, place), held_out=source.held_out, sources=())
        for place, source in enumerate(recording.sources)
    ]


def _of(recording: Recording, place: int) -> tuple[Episode, ...]:
    return tuple(episode for episode in recording.episodes if episode.source == place)


def _check_alike(one: Recording, other: Recording, first: str, second: str) -> None:
    """What two recordings must share: the system, what is recorded in which units, the rate and the base simulator."""
    _check_same("system", one.system, other.system, first, second)
    _check_channels("state", one.state, other.state, first, second)
    _check_channels("action", one.action, other.action, first, second)
    if abs(other.dt - one.dt) > SAME_STEP * one.dt:
        raise UsageError(
            f"{first} has a step of {one.dt:g} s, {second} of {other.dt:g} s: several recordings are judged together "
            "at one rate; import them at the same one, or judge each with --each"
        )
    _check_same("velocities", one.velocities, other.velocities, first, second)
    _check_same("integrator", one.integrator, other.integrator, first, second)
    for name in dict.fromkeys((*one.parameters, *other.parameters)):
        own, theirs = one.parameters.get(name), other.parameters.get(name)
        if own != theirs:
            raise _unlike(f"{name} of the base simulator", own, theirs, first, second)


def _check_channels(kind: str, one: Channels, other: Channels, first: str, second: str) -> None:
    if not one.same_as(other):
        raise _unlike(kind, one.listed(), other.listed(), first, second)


def _check_same(what: str, one: object, other: object, first: str, second: str) -> None:
    if one != other:
        raise _unlike(what, one, other, first, second)


def _unlike(what: str, one: object, other: object, first: str, second: str) -> UsageError:
    return UsageError(
        f"{first} and {second} differ in {what} ({one} and {other}): several recordings are judged together as of one "
        "machine and one base simulator; make them alike, or judge each with --each"
    )
