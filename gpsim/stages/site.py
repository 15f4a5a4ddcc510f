"""report --site: a static folder with an index over all runs and a copy of every report, which can be moved whole."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote, urlsplit

from gpsim.artifacts import MANIFEST, Artifact, read_manifest, read_timings
from gpsim.errors import UsageError
from gpsim.files import disk_errors, file_digest, files_below, written_whole
from gpsim.reports.runs_text import Entry, Experiment, Source, index_page
from gpsim.runs import entry_at
from gpsim.stages.site_facts import facts_of, proof_facts

INDEX, PAGES, REPORT, PROOF = "index.html", "pages", "report.html", "prove.json"
MARK = ".gpsim-site"
"""A file that says: this folder is a site, which the next one may replace."""
ORDER = (
    "report", "diagnose", "score", "evaluate", "train-gp-policy", "train-source", "fit-gp", "build-residuals",
    "certify", "collect", "import",
)  # fmt: skip
TABLES = ("recording.csv", "recording.parquet")
DEEPEST = 3  # folders below that of the runs: experiment, stage, version


def write_site(runs: Path, out: Path | None = None) -> tuple[Path, list[str]]:
    """Write the site of all runs; where its index lies, and sentences about it.

    out: a new folder, or one that holds a site, which is replaced; `site` among the runs without it. Raises UsageError.
    """
    if not runs.is_dir():
        raise UsageError(f"{runs}: no such folder; runs_dir= says where the runs are")
    out = out or runs / "site"
    _check_place(out)
    found = _found(runs, out)
    experiments = _experiments(found)
    with disk_errors(out, "--out"), written_whole(out) as made:
        made.mkdir()
        (made / MARK).touch()
        for item in found:
            if item.page:
                _copy_page(item.folder / REPORT, made / PAGES / item.folder.relative_to(runs))
        (made / INDEX).write_text(index_page(experiments, runs.name or "runs"), encoding="utf-8")
        if out.exists():
            shutil.rmtree(out)
    wrong = [item for item in found if item.wrong]
    notes = [
        f"{len(found)} artifacts of {len(experiments)} experiment(s), {sum(bool(item.page) for item in found)} reports"
    ]
    return out / INDEX, notes + [f"{item.folder}: {item.wrong}" for item in wrong]


@dataclass(frozen=True)
class _Found:
    """A folder with something finished in it. parts: its path below the runs; wrong: why it cannot be read."""

    folder: Path
    parts: tuple[str, ...]
    artifact: Artifact | None = None
    page: str = ""
    wrong: str = ""


def _check_place(out: Path) -> None:
    if out.is_symlink():
        raise UsageError(f"{out}: is a link, which a site cannot replace; name the folder itself by --out")
    if not out.parent.is_dir():
        raise UsageError(f"{out.parent}: no such folder; make it first")
    if out.is_dir() and not (out / MARK).is_file() and any(out.iterdir()):
        raise UsageError(f"{out}: holds something that is no site; choose another --out")
    if out.exists() and not out.is_dir():
        raise UsageError(f"{out}: is a file; choose another --out")


def _found(runs: Path, out: Path) -> list[_Found]:
    """Everything that is finished, in the order of its path."""
    items = []
    for folder in _folders(runs, out.resolve()):
        parts, page, artifact, wrong = folder.relative_to(runs).parts, "", None, ""
        if (folder / MANIFEST).is_file():
            try:
                artifact = read_manifest(folder)
            except UsageError as error:
                wrong = str(error).removeprefix(f"{folder / MANIFEST}: ")
        if (folder / REPORT).is_file() and not wrong:
            recorded = None if artifact is None else artifact.manifest["files"].get(REPORT)
            if artifact is not None and recorded != file_digest(folder / REPORT):
                wrong = f"{REPORT} changed after it was written; delete the folder and make it again"
            else:
                page = "/".join(map(quote, (PAGES, *parts, REPORT)))
        items.append(_Found(folder, parts, artifact, page, wrong))
    return items


def _folders(runs: Path, site: Path, depth: int = 1) -> Iterator[Path]:
    """Folders of artifacts and of proofs; what lies in them is theirs."""
    for folder in sorted(p for p in runs.iterdir() if p.is_dir() and not p.name.startswith(".")):
        if folder.resolve() == site or (folder / MARK).is_file():
            continue
        if (folder / MANIFEST).is_file() or (folder / PROOF).is_file():
            yield folder
        elif depth < DEEPEST:
            yield from _folders(folder, site, depth + 1)


def _experiments(found: list[_Found]) -> list[Experiment]:
    anchors: dict[str, _Found] = {}
    for item, artifact in ((i, i.artifact) for i in reversed(found) if i.artifact is not None):
        tables = (digest for name, digest in artifact.manifest["files"].items() if name in TABLES)
        anchors |= dict.fromkeys((artifact.digest, *tables), item)
    groups: dict[str, list[Entry]] = {}
    for item in found:
        groups.setdefault(item.parts[0], []).append(_entry(item, anchors))
    return [
        Experiment(name, f"experiment-{_slug((name,))}", tuple(sorted(entries, key=_rank)))
        for name, entries in groups.items()
    ]


def _rank(entry: Entry) -> tuple[int, str]:
    return (ORDER.index(entry.stage) if entry.stage in ORDER else -1, entry.name)


def _slug(parts: tuple[str, ...]) -> str:
    """A name for an anchor: letters, digits and dashes; others by their code."""
    return "--".join(re.sub(r"[^A-Za-z0-9-]", lambda c: f"_{ord(c[0]):x}_", part) for part in parts)


def _entry(item: _Found, known: dict[str, _Found]) -> Entry:
    facts: dict[str, Any] = {"name": " ".join(item.parts[1:]) or item.parts[0], "anchor": _slug(item.parts)}
    facts |= {"page": item.page, "wrong": item.wrong, "size": _size(item.folder), "stage": ""}
    if item.artifact is None:
        if (item.folder / PROOF).is_file():
            facts |= {"stage": "prove"} | _safely(proof_facts, item.folder / PROOF)
        return Entry(**facts)
    manifest, timings = item.artifact.manifest, read_timings(item.folder)
    seeds = manifest.get("seeds") or {}
    seed = seeds.get("seed", ", ".join(map(str, seeds.get("seeds", ()))))
    facts |= {
        "stage": item.artifact.stage,
        "seed": str(seed),
        "finished": str(timings.get("finished", ""))[:16].replace("T", " "),
        "seconds": _duration(timings.get("seconds")),
        "sources": _sources(item.folder, known, item.parts[0]),
    }
    return Entry(**facts | _safely(facts_of, item.artifact))


def _sources(folder: Path, known: dict[str, _Found], experiment: str) -> tuple[Source, ...]:
    """Parents, and a recording that is none: it is known by its bytes."""
    made = []
    for need in entry_at(folder, folder.parent).needs:
        tables = (digest for name, digest in need.files.items() if not name.endswith(".yaml"))
        found = known.get(str(need.digest or next(tables, "")))
        parts = () if found is None else found.parts
        name = " ".join(parts[parts[:1] == (experiment,) :]) or need.role
        made.append(Source(name, _slug(parts) if found else ""))
    return tuple(dict.fromkeys(made))


def _safely(tell: Any, of: Any) -> dict[str, Any]:
    """What an artifact says of itself; one of another version may say it otherwise, and is listed all the same."""
    try:
        return dict(tell(of))
    except (UsageError, OSError, ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        return {"said": f"written otherwise than this version reads ({type(error).__name__})"}


def _duration(seconds: Any) -> str:
    if not isinstance(seconds, int | float):
        return ""
    for most, size, unit in ((100, 1, "s"), (6000, 60, "min")):
        if seconds < most:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds / 3600:.1f} h"


def _size(folder: Path) -> str:
    size = sum(path.stat().st_size for path in files_below(folder)) / 1000
    power = 2 if size >= 1e6 else 1 if size >= 1e3 else 0
    return f"{size / 1000**power:.{0 if size / 1000**power >= 10 else 1}f} {('kB', 'MB', 'GB')[power]}"


def _copy_page(page: Path, to: Path) -> None:
    """A report and, as a proof's are, those below its folder that it links to."""
    to.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(page, to / page.name)
    links = _Links()
    links.feed(page.read_text(encoding="utf-8", errors="replace"))
    for link in links.found:
        parts = urlsplit(link)
        target = page.parent / unquote(parts.path)
        inside = page.parent.resolve() in target.resolve().parents
        if parts.scheme or parts.netloc or not parts.path or not inside or not target.is_file():
            continue
        copy = to / unquote(parts.path)
        if not copy.exists():
            _copy_page(target, copy.parent)


class _Links(HTMLParser):
    """What a page links to."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Called for every element."""
        self.found += [value for name, value in attrs if tag == "a" and name == "href" and value]
