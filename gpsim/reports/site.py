"""The index over all runs as one page: every experiment, what was found in it, and links to the reports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gpsim.reports.canvas import colours
from gpsim.reports.html import page_of, resource


@dataclass(frozen=True)
class Figure:
    """A number that an artifact is known by. name: whose it is, as a policy; value: as it is printed."""

    name: str
    value: str


@dataclass(frozen=True)
class Source:
    """What an artifact was made from. anchor: where that stands in the index, empty of what is not there."""

    name: str
    anchor: str = ""


@dataclass(frozen=True)
class Entry:
    """A finished artifact. anchor: its own in the page; page: where its report lies, relative to the index, or empty.

    verdict: of a diagnosis; said: what it is or found, in words; lines: what more; figures: what it is known by; of: of
    what all that is; finished, seconds, size: as they are printed, empty where nobody knows; wrong: why it cannot be
    read.
    """

    name: str
    stage: str
    anchor: str
    page: str = ""
    verdict: str = ""
    said: str = ""
    lines: tuple[str, ...] = ()
    figures: tuple[Figure, ...] = ()
    of: str = ""
    seed: str = ""
    finished: str = ""
    seconds: str = ""
    size: str = ""
    sources: tuple[Source, ...] = ()
    wrong: str = ""


@dataclass(frozen=True)
class Experiment:
    """What stands below one heading, what was found before what it was found with."""

    name: str
    anchor: str
    entries: tuple[Entry, ...]

    @property
    def reports(self) -> tuple[Entry, ...]:
        """Those that have a page."""
        return tuple(entry for entry in self.entries if entry.page)


def index_page(experiments: Sequence[Experiment], place: str) -> str:
    """The page; place: the folder of all runs, as it is called. Equal runs give equal pages."""
    known = dict.fromkeys(
        figure.name for group in experiments for entry in group.entries for figure in entry.figures
    )
    tints = {name: f"tint{i}" for i, name in enumerate(known)}
    dots = "".join(f".{tints[n]} {{ background: {c}; }}\n" for n, c in colours(known).items())
    return page_of(
        "site.html.jinja",
        resource("loop_report.css") + resource("site.css") + dots,
        experiments=experiments,
        place=place,
        artifacts=sum(len(group.entries) for group in experiments),
        reports=sum(len(group.reports) for group in experiments),
        tints=tints,
    )
