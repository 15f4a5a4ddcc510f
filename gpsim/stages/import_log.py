"""import: raw logs and a mapping to a recording, with a report and a picture; --inspect proposes one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from gpsim.artifacts import Artifact, Recipe, Store, WarningLog
from gpsim.errors import UsageError, near_path
from gpsim.files import Json, disk_errors, file_digest
from gpsim.recordings import (
    FolderLog,
    ImportMapping,
    ImportReport,
    NamedLog,
    Opener,
    RawLog,
    Recording,
    bare_mapping,
    changes_of_words,
    find_bad_rows,
    find_logs,
    finds_all,
    import_logs,
    merged,
    one_line,
    open_log,
    parse_mapping,
    parse_yaml,
    read_yaml,
    write_recording,
)
from gpsim.reports.import_text import as_text
from gpsim.settings import texts, truth
from gpsim.simulators import SIMULATORS

STAGE_NAME = "import"
NO_COMMANDS = (
    "no commands: its action is empty; `gpsim diagnose` then assumes commands of 0 (a free swing), the loop cannot "
    "use it; if there are commands, name them under action"
)


def quiet(line: str) -> None:
    """Say nothing."""


GUESSED = "mapping (from the names in the log)"


@dataclass(frozen=True)
class Imported:
    """What an import made: the artifact on disk, the recording in it and the report."""

    artifact: Artifact
    recording: Recording
    report: ImportReport


def import_log(
    sources: Sequence[Path],
    out: Path,
    mapping: str | None = None,
    words: Sequence[str] = (),
    salvage: bool = False,
    say: Callable[[str], None] = quiet,
    raw: Mapping[str, Any] | None = None,
) -> Imported:
    """Import `sources` into the new folder `out`, written whole or not at all.

    mapping: a name from conf/mapping or a YAML file; None for tables whose columns are the channels' names.
    words: key=value changes of the mapping. salvage: go on past damage and count it. say: is given what the person
    should know before the logs are read, a line each. raw: the whole mapping, where it is there already.
    """
    refuse_existing(out)
    raw, where = mapping_of(sources, mapping, words, salvage, raw)
    recording, report, plan = read_by(raw, where, sources, salvage, say)
    digests = digests_read(sources, plan.layout, plan.files)

    def write(folder: Path) -> Json:
        write_import(recording, report, folder)
        return {}

    store = Store(out.resolve().parent, "")
    config = {"mapping": raw, "salvage": salvage, "sources": digests}
    return Imported(
        store.publish(Recipe(STAGE_NAME, config, {}, {}), write, out=out.resolve()), recording, report
    )


def refuse_existing(out: Path) -> None:
    """Raise UsageError where something is already."""
    if out.exists():
        raise UsageError(f"{out}: exists already; a recording is never overwritten, choose another --out")


def logs_of(given: Any, where: str) -> list[Path]:
    """The logs that a setting names: a path or a list of them."""
    paths = [given] if isinstance(given, str) else texts(given, where)
    if not all(paths) or not paths:
        raise UsageError(f"{where}: name a log, or several as [a.bag, b.bag]")
    return [Path(path) for path in paths]


def changes_of(section: Mapping[str, Any]) -> list[str]:
    """The changes of the mapping that the configuration's `collect` names."""
    return texts(section["changes"], "collect.changes")


def salvages(section: Mapping[str, Any]) -> bool:
    """Whether the configuration's `collect` goes on past damage."""
    return truth(section["salvage"], "collect.salvage")


def read_configured(
    section: Mapping[str, Any], sources: Sequence[Path]
) -> tuple[Recording, ImportReport, dict[str, Any]]:
    """Logs as the configuration's `collect` says that they are read."""
    mapping = None if section["mapping"] is None else str(section["mapping"])
    return read_logs(sources, mapping, changes_of(section), salvages(section))


def read_logs(
    sources: Sequence[Path],
    mapping: str | Mapping[str, Any] | None = None,
    words: Sequence[str] = (),
    salvage: bool = False,
    say: Callable[[str], None] = quiet,
) -> tuple[Recording, ImportReport, dict[str, Any]]:
    """The recording, the report and the resolved mapping, of a name, a file, or what such a file holds."""
    raw, where = mapping_of(sources, mapping, words, salvage)
    recording, report, _ = read_by(raw, where, sources, salvage, say)
    return recording, report, raw


def mapping_of(
    sources: Sequence[Path],
    mapping: str | Mapping[str, Any] | None,
    words: Sequence[str],
    salvage: bool,
    raw: Mapping[str, Any] | None = None,
) -> tuple[dict[str, Any], str]:
    """The resolved mapping, and what messages call it; raw: where it is there already."""
    if raw is not None:
        return dict(raw), GUESSED
    if mapping is not None:
        named = f"mapping {mapping}" if isinstance(mapping, str) else "mapping"
        return resolved_mapping(mapping, words), named
    changes = changes_of_words(words)
    pattern, opener = str(changes.get("files", "*")), partial(open_log, salvage=salvage)
    first = find_logs(sources, "files", pattern, opener)[0]
    systems = {name: (simulator.state, simulator.action) for name, simulator in SIMULATORS.items()}
    bare = bare_mapping(first, str(changes.get("system", "")), systems)
    return merge_changes(bare, changes), "mapping (from the column names)"


def read_by(
    raw: Mapping[str, Any], where: str, sources: Sequence[Path], salvage: bool, say: Callable[[str], None]
) -> tuple[Recording, ImportReport, ImportMapping]:
    """The recording, the report, and the mapping that was read."""
    plan = parse_mapping(raw, where)
    if not plan.action:
        say(f"{where}: {NO_COMMANDS}")
    logs = find_logs(sources, plan.layout, plan.files, partial(open_log, salvage=salvage))
    recording, report = import_logs(logs, plan, partial(find_bad_rows, salvage=salvage))
    return recording, report, plan


def write_import(recording: Recording, report: ImportReport, folder: Path) -> None:
    """recording.parquet, recording.yaml, import_report.txt and figures/channels.png, which may fail with a warning."""
    write_recording(recording, folder)
    (folder / "import_report.txt").write_text(as_text(report), encoding="utf-8")
    (folder / "figures").mkdir()
    mishaps, figure = WarningLog(), folder / "figures" / "channels.png"
    with mishaps.contained("figures/channels.png is left out"):
        from gpsim.reports.import_figure import (
            draw_channels,  # Matplotlib: who draws nothing need not wait for it
        )

        draw_channels(recording, figure)
    if mishaps.lines:
        figure.unlink(missing_ok=True)
    mishaps.write(folder)


def ready_mappings(source: Path, first: NamedLog, opener: Opener) -> tuple[str, ...]:
    """The mappings that come with gpsim and find all they want in a source, whose first log is `first`."""
    found = []
    for name in mapping_names():
        plan, topics = parse_mapping(read_mapping(name), f"mapping {name}"), first.log.topics()
        if plan.layout == "folder":
            if not source.is_dir():
                continue
            try:
                topics = find_logs([source], "folder", plan.files, opener)[0].log.topics()
            except UsageError:  # no tables of these names
                continue
        if finds_all(plan, topics):
            found.append(name)
    return tuple(found)


def holds_logs(folder: Path) -> bool:
    """Whether there are log files below a folder; none is opened."""
    try:
        return bool(find_logs([folder], "files", "*", remembering([])))
    except UsageError:
        return False


def write_mapping(text: str, path: Path) -> None:
    """Write a proposed mapping into a new file; one that is there is left alone."""
    with disk_errors(path, "--write-mapping"):
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
        except FileExistsError as error:
            raise UsageError(
                f"--write-mapping {path}: exists already; files are never overwritten, choose another name"
            ) from error
        except FileNotFoundError as error:
            raise UsageError(f"--write-mapping {path}: its folder does not exist") from error


def mapping_names() -> list[str]:
    """The mappings that come with gpsim."""
    return sorted(p.name.removesuffix(".yaml") for p in files("gpsim.conf").joinpath("mapping").iterdir())


def read_mapping(name_or_file: str) -> dict[str, Any]:
    """A mapping as it is written: a file, or the name of one that comes with gpsim."""
    path = Path(name_or_file)
    if path.suffix in (".yaml", ".yml") or _is_file(path):
        if not _is_file(path):
            raise UsageError(
                f"--mapping {one_line(path)}: no such file; built-in mappings: {', '.join(mapping_names())}"
            )
        where = str(path)
        raw = read_yaml(path, f"--mapping {where}")
    else:
        if name_or_file not in mapping_names():
            known = ", ".join(mapping_names())
            raise UsageError(
                f"--mapping {one_line(name_or_file)}: no such file or built-in mapping; known: {known}"
            )
        text = files("gpsim.conf").joinpath("mapping", f"{name_or_file}.yaml").read_text(encoding="utf-8")
        raw, where = parse_yaml(text), name_or_file
    if not isinstance(raw, dict):
        raise UsageError(f"--mapping {where}: expected keys and values (system, state, action, rate)")
    return raw


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file can have
        return False


def merge_changes(raw: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A mapping with changes."""
    if "rate" in changes or "dt" in changes:  # two ways to say one thing: the last word counts
        raw = {key: value for key, value in raw.items() if key not in ("rate", "dt")}
    return merged(raw, changes)


def resolved_mapping(given: str | Mapping[str, Any], words: Sequence[str]) -> dict[str, Any]:
    """A mapping, or that of a name or a file, with the changes that `words` (key=value) make to it."""
    return merge_changes(read_mapping(given) if isinstance(given, str) else given, changes_of_words(words))


def source_digests(
    sources: Sequence[Path], mapping: str | None = None, words: Sequence[str] = ()
) -> dict[str, str]:
    """sha256 of every file that `read_logs` reads with this mapping and its changes, by its name below the source.

    The same bytes give the same artifact, whatever else lies beside them in a folder.
    """
    layout: Literal["files", "folder"] = "files"
    pattern = str(changes_of_words(words).get("files", "*"))
    if mapping is not None:
        plan = parse_mapping(resolved_mapping(mapping, words), f"mapping {mapping}")
        layout, pattern = plan.layout, plan.files
    return digests_read(sources, layout, pattern)


def digests_read(sources: Sequence[Path], layout: Literal["files", "folder"], pattern: str) -> dict[str, str]:
    """sha256 of every file of the logs below the sources that are called by `pattern`, by its name there.

    The same bytes give the same artifact. Of a ROS 2 bag's folder the files are named one by one.
    """
    out: dict[str, str] = {}
    for number, source in enumerate(sources, 1):
        try:
            if not source.exists():
                raise UsageError(f"{source}: no such file or folder{near_path(source)}")
            logs: list[Path] = []
            for found in find_logs([source], layout, pattern, remembering(logs)):
                logs += found.log.files.values() if isinstance(found.log, FolderLog) else ()
            files = [
                file
                for log in logs
                for file in (sorted(filter(_stores, log.iterdir())) if log.is_dir() else [log])
            ]
        except OSError as error:  # a folder that may not be entered
            raise UsageError(f"{source}: cannot be read ({error.strerror or error})") from error
        for path in files:
            name = path.relative_to(source).as_posix() if source.is_dir() else path.name
            out[name if len(sources) == 1 else f"{number}/{name}"] = file_digest(path)
    return out


def remembering(paths: list[Path]) -> Opener:
    """An opener that opens nothing and notes what it was asked for."""

    def remember(path: Path) -> RawLog:
        paths.append(path)
        return FolderLog({}, remember)

    return remember


def _stores(path: Path) -> bool:
    return path.is_file() and (path.name == "metadata.yaml" or bool({".db3", ".mcap"} & set(path.suffixes)))
