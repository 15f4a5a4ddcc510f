"""What `gpsim runs` and `gpsim status` print: one sheet, the rest lines."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from itertools import groupby

from gpsim.reports.runs_text import bytes_text, phrase
from gpsim.reports.sheets import MISSING, Cell, Sheet, row
from gpsim.runs import Beside, Compared, Difference, Listed, Listing, LoopStatus, Removed, Shown, Standing

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
    "claimed": "claimed by a process that makes it or waits",
    "unfinished": "left unfinished",
    "removing": "its removal was cut off",
}
NAMES = 3
"""How many a line says of what an artifact waits for."""
FIGURES = 12
"""How many `show` prints without `--all`."""
MARKS = {"there": "there", "to make": "make", "waits": "waits", "refused": "refused"}


def listing_sheet(listing: Listing) -> Sheet:
    """Every artifact, a row each."""
    return Sheet(
        f"{listing.runs_dir}: {_count(len(listing.artifacts), 'artifact')}, {bytes_text(listing.bytes)}",
        ("Artifact", "Says", "State", "Made", "Seed", "Size"),
        tuple(
            row(
                a.name,
                a.says,
                Cell(a.state, marked=a.state == "broken"),
                _made(a),
                _seed(a),
                bytes_text(a.bytes),
            )
            for a in listing.artifacts
        ),
        labels=2,
    )


def listing_lines(listing: Listing) -> list[str]:
    """What the sheet does not say: why artifacts are broken or stale, and what lies beside them."""
    broken = [f"broken: {a.damage}" for a in listing.artifacts if a.damage is not None]
    by_reason = sorted((_reasons(a.why), a.name) for a in listing.artifacts if a.why)
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
    artifact = shown.artifact
    lines = [f"{artifact.name}: {artifact.state}{f', {artifact.says}' if artifact.says else ''}"]
    lines += [f"  broken: {artifact.damage}"] if artifact.damage else []
    lines += [f"  stale: {phrase(difference)}" for difference in artifact.why]
    took = f" in {artifact.seconds:.3g} s" if artifact.seconds is not None else ""
    lines.append(
        f"  made {_made(artifact)}{took}, {_count(len(shown.files), 'file')}, {bytes_text(artifact.bytes)}"
    )
    lines.append(f"  seeds {json.dumps(artifact.seeds)}, commit {shown.commit or 'unknown'}")
    lines.append(f"  sha256 {shown.sha256 or 'unknown'}")
    for parent in shown.parents:
        where = parent.name or f"gone ({parent.stage} {str(parent.sha256)[:12]})"
        lines.append(f"  made from {parent.role}: {where}")
    lines += [f"  needed by {name}" for name in shown.children]
    if shown.dependents > len(shown.children):
        lines.append(f"  needed by {shown.dependents} in all, at any distance")
    figures = [f"  {name} = {_figure(value)}" for name, value in shown.figures.items()]
    lines += figures if whole else figures[:FIGURES]
    if not whole:
        left = len(figures) - FIGURES
        return [*lines, f"  and {_count(left, 'figure')} more: --all"] if left > 0 else lines
    lines += [
        "  configuration:",
        *(f"    {line}" for line in json.dumps(shown.config, indent=2).splitlines()),
    ]
    lines += ["  packages:", *(f"    {name} {version}" for name, version in shown.packages.items())]
    return [*lines, "  files:", *(f"    {name}, {bytes_text(size)}" for name, size in shown.files.items())]


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
    if not removed.artifacts and not removed.beside:
        return "nothing to remove"
    parts = [_count(len(removed.artifacts), "artifact")] if removed.artifacts else []
    parts += [_count(len(removed.beside), "leftover")] if removed.beside else []
    return f"{' and '.join(parts)}, {bytes_text(removed.bytes)}"


def standing_lines(standing: Standing, width: int = 0) -> list[str]:
    """How it stands with one artifact, and why; width: of the column of names."""
    head = f"{MARKS[standing.state]:<8}{standing.job:<{width}}  "
    if standing.state == "there":
        return [f"{head}{standing.path}"]
    if standing.state == "refused":
        return [f"{head}{standing.refusal}"]
    waits = f"for {_some(standing.waits_for)}" if standing.state == "waits" else ""
    out = f"as {standing.path}" if standing.path is not None else ""
    said = waits or out
    if standing.nearest is None:
        why = "nothing of this stage is there yet" if not waits else ""
        return [f"{head}{'; '.join(part for part in (said, why) if part)}"]
    but = f"{'beside that ' if waits else ''}differs from {standing.nearest}"
    told = [d for d in standing.differences if not (waits and d.kind == "parent" and d.new is None)]
    if not told:
        nothing = "" if waits else f"as {standing.nearest}, written anew"
        return [f"{head}{waits or nothing}"]
    return [
        f"{head}{'; '.join(part for part in (said, but) if part)}",
        *(f"          {phrase(d)}" for d in told),
    ]


def dry_run_lines(standing: Standing) -> list[str]:
    """How it stands with one stage, and what to make first where it waits."""
    lines = standing_lines(standing)
    return [*lines, f"make first: {standing.make_first}"] if standing.make_first else lines


def status_lines(status: LoopStatus) -> list[str]:
    """How it stands with a loop, artifact by artifact, and what would make the rest."""
    width = max(len(standing.job) for standing in status.standings)
    lines = [line for standing in status.standings for line in standing_lines(standing, width)]
    there, all_of_them = status.count("there"), len(status.standings)
    if there == all_of_them:
        return [*lines, f"all {all_of_them} are there"]
    refused = f", {status.count('refused')} refused" if status.count("refused") else ""
    open_ones = f"{status.count('to make')} to make at once, {status.count('waits')} wait"
    return [
        *lines,
        f"{there} of {all_of_them} are there, {open_ones}{refused}; make them with: {status.command}",
    ]


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
    values = list(artifact.seeds.values())
    return (
        ", ".join(str(v) for value in values for v in (value if isinstance(value, list) else [value]))
        or MISSING
    )


def _reasons(why: Sequence[Difference]) -> str:
    return "; ".join(phrase(difference) for difference in why)


def _figure(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
