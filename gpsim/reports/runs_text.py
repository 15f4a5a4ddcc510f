"""What is in runs/ and what stands to be made, in words: lines for the terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gpsim.reports.canvas import colours, page_of, resource
from gpsim.reports.sheets import fixed, significant
from gpsim.runs import ABSENT, Difference

Figures = Mapping[str, Any]
LONGEST = 60
"""Characters of a value in a line."""
BEFORE = 12
"""Characters before the first in which two long texts differ."""
SHORT_HASH = 8
SHA256 = 64
POLICIES_TOLD = ("GP-Sample", "Effects", "Target")
EMPTY = ("none", "unknown")
"""Verdicts that name nothing, though files of before may list what was tried."""
UNITS = ("B", "kB", "MB", "GB", "TB")


def bytes_text(count: int) -> str:
    """A size on the disk: 512 B, 12.3 kB, 1.4 GB (powers of 1000)."""
    value, place = float(count), 0
    while value >= 999.5 and place < len(UNITS) - 1:
        value, place = value / 1000.0, place + 1
    return f"{value:.0f} {UNITS[place]}" if place == 0 or value >= 99.95 else f"{value:.1f} {UNITS[place]}"


def says(stage: str, figures: Figures, config: Mapping[str, Any], timings: Mapping[str, Any]) -> str:
    """What an artifact says, in a word; nothing where it has no figures."""
    teller = TELLERS.get(stage)
    try:
        return teller(figures, config, timings) if teller is not None else ""
    except (KeyError, TypeError, AttributeError):  # made otherwise, or broken
        return ""


def phrase(difference: Difference) -> str:
    """One difference in a line."""
    old, new = (_value(value) for value in (difference.old, difference.new))
    if isinstance(difference.old, str) and isinstance(difference.new, str):
        old, new = _apart(difference.old, difference.new)
    elif old == new:  # they differ further behind the point
        old, new = repr(difference.old), repr(difference.new)
    key, gone, fresh = difference.key, difference.old == ABSENT, difference.new == ABSENT
    if difference.kind == "file":
        name = key.removeprefix("recording.").removeprefix("import.sources.")
        return f"file {name}: {'not there before' if gone else 'no longer read' if fresh else 'changed'}"
    if difference.kind == "content":
        return f"file {key}: {'only in the second' if gone else 'only in the first' if fresh else 'differs'}"
    if difference.kind == "parent":
        return f"parent {key}: {'none' if gone else difference.old} → {_became(difference)}"
    if difference.kind == "code":
        return _code(key, *(str(v) if v is not None else "unknown" for v in (difference.old, difference.new)))
    if difference.kind == "package":
        return f"package {key}: {old} → {new}"
    return f"{key}: {old} → {new}"


def _became(parent: Difference) -> str:
    """Where a parent is now, whole: a path that is cut short is of no use."""
    return "to be made" if parent.new is None else "gone" if parent.new == ABSENT else str(parent.new)


def _code(key: str, old: str, new: str) -> str:
    if key == "format":
        return f"code: the stage's format {old} → {new}"
    if key == "commit":
        return f"code: commit {old[:SHORT_HASH]} → {new[:SHORT_HASH]}"
    if len(old) == len(new) == SHA256:
        return "code: gpsim's own modules have changed"
    return f"code: {_shortened(old) or 'none'} → {_shortened(new) or 'none'}"


def _value(value: Any) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.6g}"
    return _shortened(str(value))


def _apart(old: str, new: str) -> tuple[str, str]:
    """Two texts, from a little before the place where they begin to differ if they are long."""
    if max(len(old), len(new)) <= LONGEST or SHA256 in (len(old), len(new)):
        return _shortened(old), _shortened(new)
    shared = next(
        (i for i, (a, b) in enumerate(zip(old, new, strict=False)) if a != b), min(len(old), len(new))
    )
    start = max(shared - BEFORE, 0)
    cut = "…" if start else ""
    return _shortened(f"{cut}{old[start:]}"), _shortened(f"{cut}{new[start:]}")


def _shortened(text: str) -> str:
    if len(text) == SHA256 and all(c in "0123456789abcdef" for c in text):
        return text[:SHORT_HASH]
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"


def _policy(figures: Figures, config: Mapping[str, Any], timings: Mapping[str, Any]) -> str:
    how = str(config.get("variant") or config["correction"])
    how += f", {config['prediction']}" if "prediction" in config else ""
    return f"{how}: return {fixed(figures['mean_return'])}"


def _diagnosis(figures: Figures, config: Mapping[str, Any], timings: Mapping[str, Any]) -> str:
    verdict, effects = str(figures["verdict"]), figures.get("effects")
    return f"{verdict}: {_shortened(str(effects))}" if effects and verdict not in EMPTY else verdict


def _evaluation(figures: Figures, config: Mapping[str, Any], timings: Mapping[str, Any]) -> str:
    if "deployed.trips" in figures:
        return f"{figures['deployed.reached']} of {figures['deployed.trips']} reached"
    means = {name: figures.get(f"returns_all.{name}.mean") for name in POLICIES_TOLD}
    told = [f"{name} {fixed(mean)}" for name, mean in means.items() if mean is not None]
    if told:
        return f"return: {', '.join(told)}"
    errors = [(key, value) for key, value in figures.items() if key.endswith(".mean.nrmse")]
    return f"{errors[0][0].split('.')[1]}: NRMSE {significant(errors[0][1], 2)}" if errors else ""


def _score(figures: Figures, config: Mapping[str, Any], timings: Mapping[str, Any]) -> str:
    after = next((key for key in figures if key.startswith("rollout.") and key.endswith(".after")), None)
    if after is None:
        return ""
    before = figures[f"{after.removesuffix('after')}before"]
    return f"{after.split('.')[1]}: {significant(before)} → {significant(figures[after])}"


TELLERS: Mapping[str, Callable[[Figures, Mapping[str, Any], Mapping[str, Any]], str]] = {
    "train-source": _policy,
    "train-gp-policy": _policy,
    "collect": lambda figures, config, timings: f"{timings['transitions']} transitions",
    "import": lambda figures, config, timings: str(config["mapping"].get("system", "")),
    "build-residuals": lambda figures, config, timings: (
        f"{figures['rows.training']} + {figures['rows.test']} transitions"
    ),
    "fit-gp": lambda figures, config, timings: f"{figures['rows']} rows",
    "certify": lambda figures, config, timings: f"{figures['certified']} of {figures['starts']} starts",
    "diagnose": _diagnosis,
    "evaluate": _evaluation,
    "report": _evaluation,
    "score": _score,
}


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
