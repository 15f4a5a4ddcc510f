"""The recording's clock: one that was set long before, as the time of day, is read from the recording's start on."""

from __future__ import annotations

from dataclasses import replace

from gpsim.recordings import Recording, apart


def rebased(recording: Recording) -> tuple[Recording, float]:
    """The recording on a clock of its own, and when that one begins on the recording's clock [s].

    0 where the clock began no longer before the recording than it lasts: a battery sags from when it was put in. Of
    several recordings each has a clock of its own, and what is told of them goes by that.
    """
    if recording.sources:
        parts = [rebased(part)[0] for part in apart(recording)]
        episodes = tuple(episode for part in parts for episode in part.episodes)
        named = zip(recording.sources, parts, strict=True)
        sources = tuple(replace(source, held_out=part.held_out) for source, part in named)
        return replace(recording, episodes=episodes, sources=sources), 0.0
    first = min(float(e.t[0]) for e in recording.episodes)
    last = max(float(e.t[-1]) for e in recording.episodes)
    if first <= last - first:
        return recording, 0.0
    held = recording.held_out
    if held is not None and held.time_from is not None:
        held = replace(held, time_from=held.time_from - first)
    episodes = tuple(replace(e, t=e.t - first) for e in recording.episodes)
    return replace(recording, episodes=episodes, held_out=held), first
