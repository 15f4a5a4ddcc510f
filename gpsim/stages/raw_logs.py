"""A raw log where a recording is expected: imported by the mapping that its names suggest, or one line that asks."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from gpsim.artifacts import Artifact, Recipe
from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.files import Json
from gpsim.mjcf import SYSTEM, MjcfSimulator, open_simulator
from gpsim.recordings import (
    SUFFIXES,
    TOP_KEYS,
    Inspection,
    NamedLog,
    System,
    Topic,
    changes_of_words,
    find_logs,
    guess,
    inspect_log,
    is_bag_folder,
    likeliest,
    one_line,
    open_log,
    parse_mapping,
)
from gpsim.reports.import_text import Asking, asked, told
from gpsim.simulators import SIMULATORS, Simulator
from gpsim.stages import import_log
from gpsim.stages.stage import Request, Stage

TABLES = (".csv", ".parquet")
ASIDE = ("desired", "target", "reference", "planned", "setpoint")


@dataclass(frozen=True)
class RawLog:
    """A log to import. command, tail: what was typed before and behind it, for the command that a message proposes.

    simulator: what it will be compared with; mapping: a name or file, instead of guessing; words: `channel=source`
    and changes of the mapping.
    """

    path: Path
    command: str
    simulator: str | None = None
    tail: str = ""
    mapping: str | None = None
    words: tuple[str, ...] = ()
    salvage: bool = False


def is_raw(path: Path, simulator: str | None) -> bool:
    """Whether this is a log, neither a recording nor a table whose columns are called as the simulator's channels."""
    if path.is_dir():
        return not (path / "recording.yaml").is_file() and (
            is_bag_folder(path) or import_log.holds_logs(path)
        )
    if path.suffix.lower() not in SUFFIXES or not path.is_file():
        return False
    if path.suffix.lower() not in TABLES:
        return True
    if path.stem == "recording" and (path.parent / "recording.yaml").is_file():
        return False
    if simulator is None:
        return True
    columns = open_log(path).topics()[0].fields
    return "t" not in columns or not any(name in columns for name in open_simulator(simulator).state.names)


def reads_bare(paths: Sequence[Path], simulator: str | None, words: Sequence[str]) -> bool:
    """Whether `gpsim import` needs no guess: `system=NAME`, and a table with its channels' names."""
    given, changes = _given(words)
    name = simulator or changes.get("system")
    if simulator is not None or given or name not in SIMULATORS or len(paths) != 1 or paths[0].is_dir():
        return False
    topics = open_log(paths[0]).topics()
    own = _system(str(name))
    return len(topics) == 1 and set(own.state.names) <= set(topics[0].fields)


def of_the_mapping(word: str) -> bool:
    """Whether a word of the command line says something of a log, as `theta=position`, `rate=50`."""
    key = word.partition("=")[0]
    return "=" in word and (key.split(".")[0].split("[")[0] in TOP_KEYS or _is_channel(key))


def _is_channel(key: str) -> bool:
    """Whether it may be a channel's name, as `theta`, `root.x`."""
    top = key.split(".")[0]
    setting = top != key and (files("gpsim.conf") / top).is_dir()
    return all(part.isidentifier() for part in key.split(".")) and top not in TOP_KEYS and not setting


def inspect_source(source: Path, salvage: bool = False) -> Inspection:
    """What a log holds and the mapping it suggests; of a folder of logs, the first, which alone is opened."""
    opener = partial(open_log, salvage=salvage)
    paths: list[Path] = []
    found = find_logs([source], "files", "*", import_log.remembering(paths))
    first = NamedLog(found[0].name, opener(paths[0]))
    _topics(first, paths[0])
    systems = [_system(each) for each in SIMULATORS]
    return inspect_log(first, systems, len(found), import_log.ready_mappings(source, first, opener))


def _topics(log: NamedLog, path: Path) -> Sequence[Topic]:
    """What is inside; raises UsageError where not one number is."""
    topics = log.log.topics()
    of, where = "rows" if topics and topics[0].type == "table" else "messages", one_line(path)
    if not any(topic.count or topic.fault for topic in topics):
        raise UsageError(f"{where}: no {of}: it has column names but no rows; record or export it again")
    if not any(topic.fields or topic.fault for topic in topics):
        raise UsageError(f"{where}: no column of numbers; give a table with a column for each channel")
    return topics


@dataclass(frozen=True)
class Read:
    """How a log will be read: the whole mapping, where it is from, and what a person should know of it."""

    raw: dict[str, Any]
    where: str
    remarks: tuple[str, ...] = ()


def decide(log: RawLog) -> Read:
    """The mapping: the one that is named, or the guess; raises UsageError with the command that would do."""
    if log.mapping is not None:
        return Read(import_log.resolved_mapping(log.mapping, log.words), f"mapping {log.mapping}")
    given, changes = _given(log.words)
    layout, pattern, kinds = _layout(log, changes)
    opener = partial(open_log, salvage=log.salvage)
    first = find_logs([log.path], layout, pattern, opener)[0]
    topics = _topics(first, log.path)

    def values(topic: str, field: str) -> FloatArray:
        return first.log.series({topic: [field]})[topic].fields[field]

    name, shown = log.simulator or changes.get("system"), shlex.quote(str(log.path))
    systems = [_system(str(name))] if name else [_system(each) for each in SIMULATORS]
    known = {key: value for key, value in given.items() if name}
    guesses = [guess(topics, system, known, values) for system in systems]
    found = likeliest(guesses)
    if "episodes" in changes:
        found.switch = None
    if kinds:
        found.taken["files"] = pattern
        if len(kinds) > 1:
            found.unclear["files"] = kinds
    if not found.complete or (name is None and not found.typed):
        ready = () if name else import_log.ready_mappings(log.path, first, opener)
        typed = Asking(log.command, shown, log.words, log.tail, named=bool(name))
        columns = list(topics[0].fields) if len(topics) == 1 else [topic.name for topic in topics]
        line, table = asked(typed, found, columns, ready)
        raise UsageError(line, table=table)
    raw = import_log.merge_changes(found.raw, changes)
    raw |= {"layout": layout} if layout != "files" else {}
    raw |= {"files": pattern} if pattern != "*" else {}
    simulator = open_simulator(found.system.name)
    raw.setdefault("integrator", simulator.integrator)
    return Read(raw, "mapping (from the names in the log)", tuple(told(found, shown, _own(simulator, raw))))


def _given(words: Sequence[str]) -> tuple[dict[str, str], dict[str, Any]]:
    """`channel=source` as typed, and the changes of the mapping."""
    given: dict[str, str] = {}
    others = []
    for word in words:
        key, _, value = word.partition("=")
        if key == "dt" or _is_channel(key):
            given[key] = value
        else:
            others.append(word)
    return given, changes_of_words(others)


def _system(name: str) -> System:
    simulator = open_simulator(name)
    pairs = {c.velocity: c.name for c in simulator.coordinates if c.velocity in simulator.state.names}
    system = System(
        name,
        simulator.state,
        simulator.action,
        pairs,
        tuple(simulator.start),
        integrator=simulator.integrator,
    )
    if not isinstance(simulator, MjcfSimulator):
        return system
    return replace(system, optional=tuple(pairs), drives=simulator.drives, recorded_as=SYSTEM, model=name)


def _own(simulator: Simulator, raw: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
    """Parameters that nobody gave: name -> (value, unit); a MuJoCo model says its own in its file."""
    if isinstance(simulator, MjcfSimulator):
        return {}
    given = raw.get("parameters") or {}
    values = simulator.defaults()
    return {n: (values[n], p.unit) for n, p in simulator.parameters.items() if n not in given}


def _layout(log: RawLog, changes: Mapping[str, Any]) -> tuple[Literal["files", "folder"], str, list[str]]:
    """(layout, files, their kinds): whether a folder's tables are logs of one kind, or the topics of one log.

    Tables of the same columns that are called differently may be measured and planned ones: of such, `files` are
    those of the commonest name that is no plan's, and the kinds the names to choose from.
    """
    pattern = str(changes.get("files", "*"))
    if not log.path.is_dir() or is_bag_folder(log.path) or "layout" in changes:
        return changes.get("layout", "files"), pattern, []
    logs = find_logs([log.path], "files", pattern, partial(open_log, salvage=log.salvage))
    topics = [one.log.topics() for one in logs]
    if any(len(of_log) != 1 or of_log[0].type != "table" for of_log in topics):
        return "files", pattern, []
    if len({of_log[0].fields for of_log in topics}) > 1:
        return "folder", pattern, []
    names = Counter(Path(one.name).name for one in logs)
    measured = [name for name, _ in names.most_common() if not any(word in name.lower() for word in ASIDE)]
    if measured and len(measured) < len(names) and pattern == "*":
        return "files", measured[0], measured
    return "files", pattern, []


def stage_for(log: RawLog, read: Read, say: Callable[[str], None] = import_log.quiet) -> Stage:
    """The import as a stage: the same log, read in the same way, is imported once."""

    def recipe(request: Request) -> Recipe:
        plan = parse_mapping(read.raw, read.where)
        digests = import_log.digests_read([log.path], plan.layout, plan.files)
        return Recipe("import", {"mapping": read.raw, "salvage": log.salvage, "sources": digests}, {}, {})

    def write(request: Request, recipe: Recipe, folder: Path) -> Json:
        made, report, _ = import_log.read_by(read.raw, read.where, [log.path], log.salvage, say)
        import_log.write_import(made, report, folder)
        for line in report.warnings:
            say(line)
        return {}

    return Stage("import", recipe, write, format=1)


def imported(request: Request, log: RawLog, say: Callable[[str], None]) -> tuple[Artifact, bool]:
    """Import a log below runs/; say: is given what the person should know. Returns the recording's artifact."""
    read = decide(log)
    for line in read.remarks:
        say(line)
    return stage_for(log, read, say).make(replace(request, out=None))
