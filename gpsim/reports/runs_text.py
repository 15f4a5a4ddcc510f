"""What is in runs/, how two artifacts differ, and what stands to be made, in words: lines for the terminal."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
from typing import Any

from gpsim.reports.pages import text_of
from gpsim.reports.sheets import MISSING, Cell, Sheet, fixed, sheet, significant
from gpsim.runs import (
    ABSENT,
    Beside,
    Compared,
    Difference,
    Listed,
    Listing,
    LoopStatus,
    Removed,
    Shown,
    Standing,
)

Figures = Mapping[str, Any]
HEADS = {
    "stage": "Stage",
    "setting": "Configuration",
    "file": "Files that were read",
    "seed": "Seeds",
    "parent": "Parents",
    "code": "Code",
    "package": "Packages",
    "figure": "Figures",
    "content": "Files of the artifact",
}
KINDS = {
    "making": "being made",
    "claimed": "in use by a process",
    "unfinished": "left unfinished",
    "removing": "its removal was cut off",
}
NAMES = 3  # how many a line says of what an artifact waits for
FIGURES = 12  # how many `show` prints without `--all`
MARKS = {"there": "there", "to make": "make", "waits": "waits", "refused": "refused"}
LONGEST = 60  # characters of a value in a line
BEFORE = 12  # characters before the first in which two long texts differ
SHORT_HASH, SHA256 = 8, 64
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
    try:
        return TELLERS[stage](figures, config, timings) if stage in TELLERS else ""
    except (KeyError, TypeError, AttributeError):  # made otherwise, or broken
        return ""


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


def phrase(difference: Difference) -> str:
    """One difference in a line."""
    before, after, key = difference.old, difference.new, difference.key
    old, new = _value(before), _value(after)
    if isinstance(before, str) and isinstance(after, str):
        old, new = _apart(before, after)
    elif old == new:  # they differ further behind the point
        old, new = repr(before), repr(after)
    gone, fresh = before == ABSENT, after == ABSENT
    if difference.kind == "file":
        name = key.removeprefix("recording.").removeprefix("import.sources.")
        return f"file {name}: {'not there before' if gone else 'no longer read' if fresh else 'changed'}"
    if difference.kind == "content":
        return f"file {key}: {'only in the second' if gone else 'only in the first' if fresh else 'differs'}"
    if difference.kind == "parent":  # where it is now, whole: a path that is cut short is of no use
        became = "to be made" if after is None else "gone" if fresh else str(after)
        return f"parent {key}: {'none' if gone else before} → {became}"
    if difference.kind == "code":
        return _code(key, *(str(v) if v is not None else "unknown" for v in (before, after)))
    return f"{'package ' if difference.kind == 'package' else ''}{key}: {old} → {new}"


def _code(key: str, old: str, new: str) -> str:
    if key == "format":
        return f"code: the stage's format {old} → {new}"
    if key == "commit":
        return f"code: commit {old[:SHORT_HASH]} → {new[:SHORT_HASH]}"
    if len(old) == len(new) == SHA256:
        return "code: gpsim's own modules have changed"
    return f"code: {_shortened(old) or 'none'} → {_shortened(new) or 'none'}"


def _value(value: Any) -> str:
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    return f"{value:.6g}" if isinstance(value, float) else _shortened(str(value))


def _apart(old: str, new: str) -> tuple[str, str]:
    """Two texts, from a little before the place where they begin to differ if they are long."""
    if max(len(old), len(new)) <= LONGEST or SHA256 in (len(old), len(new)):
        return _shortened(old), _shortened(new)
    differing = (i for i, (a, b) in enumerate(zip(old, new, strict=False)) if a != b)
    start = max(next(differing, min(len(old), len(new))) - BEFORE, 0)
    cut = "…" if start else ""
    return _shortened(f"{cut}{old[start:]}"), _shortened(f"{cut}{new[start:]}")


def _shortened(text: str) -> str:
    if len(text) == SHA256 and all(c in "0123456789abcdef" for c in text):
        return text[:SHORT_HASH]
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"


def listing_sheet(listing: Listing) -> Sheet:
    """Every artifact, a row each."""
    rows = (
        (a.name, a.says, Cell(a.state, marked=a.state == "broken"), _made(a), _seed(a), bytes_text(a.bytes))
        for a in listing.artifacts
    )
    title = f"{listing.runs_dir}: {_count(len(listing.artifacts), 'artifact')}, {bytes_text(listing.bytes)}"
    return sheet(title, ("Artifact", "Says", "State", "Made", "Seed", "Size"), rows, labels=2)


def listing_lines(listing: Listing) -> list[str]:
    """What the sheet does not say: why artifacts are broken or stale, and what lies beside them."""
    broken = [f"broken: {a.damage}" for a in listing.artifacts if a.damage is not None]
    by_reason = sorted(("; ".join(map(phrase, a.why)), a.name) for a in listing.artifacts if a.why)
    stale = [
        f"stale: {_some([name for _, name in group])}: {reason}"
        for reason, group in groupby(by_reason, key=lambda pair: pair[0])
    ]
    return [*broken, *stale, *beside_lines(listing.beside)]


def beside_lines(beside: Iterable[Beside]) -> list[str]:
    """What is no artifact."""
    return [f"{KINDS[left.kind]}: {left.path}, {bytes_text(left.bytes)}" for left in beside]


def shown_lines(shown: Shown, whole: bool = False) -> list[str]:
    """One artifact; whole: with all settings, files and package versions."""
    a = shown.artifact
    return text_of(
        "show.txt.jinja",
        shown=shown,
        a=a,
        whole=whole,
        made=_made(a),
        seeds=json.dumps(a.seeds),
        config=json.dumps(shown.config, indent=2),
        size=f"{_count(len(shown.files), 'file')}, {bytes_text(a.bytes)}",
        most=None if whole else FIGURES,
        left=_count(len(shown.figures) - FIGURES, "figure"),
        phrase=phrase,
        bytes_text=bytes_text,
    ).splitlines()


def compared_lines(found: Compared) -> list[str]:
    """How two artifacts differ, one key a line."""
    if not found.differences:
        return [f"{found.old} and {found.new} are equal: same recipe, same bytes"]
    lines = [f"{found.old} → {found.new}"]
    for kind, group in groupby(found.differences, key=lambda difference: difference.kind):
        lines += [HEADS[kind], *(f"  {phrase(difference)}" for difference in group)]
    return lines


def removed_lines(removed: Removed) -> list[str]:
    """What goes, the first first, and how much that is."""
    lines = [f"{a.name}, {bytes_text(a.bytes)}{f', {a.says}' if a.says else ''}" for a in removed.artifacts]
    return [*lines, *beside_lines(removed.beside)]


def removed_sum(removed: Removed) -> str:
    """How much goes."""
    parts = [_count(len(removed.artifacts), "artifact")] if removed.artifacts else []
    parts += [_count(len(removed.beside), "leftover")] if removed.beside else []
    return f"{' and '.join(parts)}, {bytes_text(removed.bytes)}" if parts else "nothing to remove"


def standing_lines(standing: Standing, width: int = 0) -> list[str]:
    """How it stands with one artifact, and why; width: of the column of names."""
    head = f"{MARKS[standing.state]:<8}{standing.job:<{width}}  "
    if standing.state in ("there", "refused"):
        return [f"{head}{standing.path if standing.state == 'there' else standing.refusal}"]
    waits = f"for {_some(standing.waits_for)}" if standing.state == "waits" else ""
    said = waits or (f"as {standing.path}" if standing.path is not None else "")
    if standing.nearest is None:
        why = "this stage has no artifact yet" if not waits else ""
        return [head + "; ".join(part for part in (said, why) if part)]
    told = [d for d in standing.differences if not (waits and d.kind == "parent" and d.new is None)]
    if not told:
        return [f"{head}{waits or f'as {standing.nearest}, written anew'}"]
    but = f"{'beside that ' if waits else ''}differs from {standing.nearest}"
    first = head + "; ".join(part for part in (said, but) if part)
    return [first, *(f"          {phrase(d)}" for d in told)]


def dry_run_lines(standing: Standing) -> list[str]:
    """How it stands with one stage, and what to make first where it waits."""
    lines = standing_lines(standing)
    return [*lines, f"make first: {standing.make_first}"] if standing.make_first else lines


def status_lines(status: LoopStatus) -> list[str]:
    """How it stands with a loop, artifact by artifact, and what would make the rest."""
    width = max(len(standing.job) for standing in status.standings)
    lines = [line for standing in status.standings for line in standing_lines(standing, width)]
    there, every, refused = status.count("there"), len(status.standings), status.count("refused")
    if there == every:
        return [*lines, f"all {every} are there"]
    rest = f"{status.count('to make')} to make at once, {status.count('waits')} wait"
    rest += f", {refused} refused" if refused else ""
    return [*lines, f"{there} of {every} exist, {rest}; make them with: {status.command}"]


def _some(names: Sequence[str]) -> str:
    """The first few names, and how many more there are."""
    more = f" and {len(names) - NAMES} more" if len(names) > NAMES else ""
    return f"{', '.join(names[:NAMES])}{more}"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _made(artifact: Listed) -> str:
    """On the maker's clock, to the minute."""
    return artifact.made[:16].replace("T", " ") if artifact.made is not None else MISSING


def _seed(artifact: Listed) -> str:
    each = (value if isinstance(value, list) else [value] for value in artifact.seeds.values())
    return ", ".join(str(v) for values in each for v in values) or MISSING
