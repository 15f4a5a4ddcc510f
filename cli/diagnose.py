"""gpsim diagnose: where recording and simulator differ, which physics is missing, how much, and whether it helps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gpsim.errors import UsageError

from . import completion, options
from .answers import answer, say, say_all
from .everywhere import named, named_effects
from .options import (
    CORES,
    DryRun,
    Setup,
    launcher_of,
    option,
    refuse_launcher,
    say_made,
    spread,
    top_key,
    words_of,
)
from .progress import DIAGNOSIS, MUJOCO, Board, caution, note, warn

if TYPE_CHECKING:
    from gpsim.diagnosis import Diagnosis
    from gpsim.stages.fleet import Fleet
    from gpsim.stages.raw_logs import RawLog
    from gpsim.stages.stage import Request

COMPILES = "compiling the simulators for this machine: about a minute, only once"
USED = ("seed", "diagnose", "experiment", "runs_dir", "launcher")
"""What counts beside a RECORDING, which brings its own simulator, parameters, integrator and clock."""
INSTEAD = {
    "simulator": "--simulator NAME; parameters, integrator and dt come from its recording.yaml",
    "recording": "the RECORDING alone",
}
Cores = Annotated[int | None, typer.Option("--cores", min=1, help="Processes to use; all cores by default.")]


@dataclass
class Asked:
    """What is asked beside recordings and settings."""

    simulator: str | None = option(
        None,
        "--simulator",
        help="A simulator, or your own system as FILE.py:ClassName; by default that of the recording.",
        autocompletion=completion.simulator_names,
    )
    mapping: str | None = option(
        None,
        "--mapping",
        help="For a raw log: the assignment of columns to channels, as the name of a mapping or a YAML file.",
        autocompletion=completion.mapping_names,
    )
    out: Path | None = option(None, "--out", help="Write here instead of runs/<experiment>/diagnose/vNNNN.")
    score: Path | None = option(
        None,
        "--score",
        metavar="DIAGNOSIS",
        help="Evaluate this finished diagnosis on RECORDING instead of making a new one; nothing is fitted.",
        autocompletion=completion.diagnoses,
    )
    each: bool = option(
        False,
        "--each",
        help="Diagnose each RECORDING, or each in a folder, separately, and compare them on one page.",
    )
    explain: bool = option(
        False, "--explain", help="Print the whole ranking of explanations, and every decision."
    )
    cores: Cores = None
    effects: list[str] | None = option(
        None,
        "--effects",
        metavar="FILE.py[:Class]",
        help="Your own effects, tested together with the catalogue (`gpsim effects new`); may be repeated.",
    )


@dataclass
class DiagnoseSetup(Setup):
    """Recordings stand before the settings."""

    words: list[str] | None = words_of(
        "[RECORDING]... [KEY=VALUE]...",
        "Recording folders or raw logs; by default the recording of the loop. Several recordings of one "
        "machine get one account. Then settings, such as seed=1, or for a raw log theta=deg*angle.",
        completion.diagnose_words,
    )


@spread
def diagnose_command(*, asked: Asked, given: DiagnoseSetup, dry_run: DryRun = False) -> None:
    """Find which physics the simulator lacks, how much of it, and whether the corrected simulator fits better."""
    recordings, settings = options.split_words(given.words or [])
    named(asked.simulator, settings)
    own = named_effects(asked.effects)
    _check_together(recordings, asked, dry_run)
    of_log: list[str] = []
    if recordings:
        settings, of_log = _parted(settings)
        _refuse(settings)
    elif asked.mapping is not None:
        raise UsageError("diagnose: --mapping goes with a raw log, as: gpsim diagnose my.bag --mapping FILE")
    setup, cores = replace(given, words=settings), asked.cores or CORES
    config = setup.config

    def read(path: Path) -> Path:
        """The recording itself, which of a raw log is imported then; raises UsageError."""
        if (log := _log_of(path, of_log, asked)) is not None:
            return _imported(log, config)
        _refuse(of_log)  # what says nothing of a log
        return path

    if asked.each:
        _diagnose_each(recordings, asked.simulator, read, setup.request(out=asked.out, cores=cores), own)
        return
    refuse_launcher("diagnose", settings)
    if asked.score is not None:
        if not recordings:
            raise UsageError("diagnose: --score DIAGNOSIS needs a RECORDING to evaluate it on")
        _score(setup, asked, read(recordings[0]), dry_run)
        return
    # Imported here: scipy and matplotlib take seconds to load, and `--help` should not wait for it.
    from gpsim.kernels import is_compiled
    from gpsim.mjcf import is_mujoco
    from gpsim.stages.diagnose import Task, read_diagnosis, stage_for
    from gpsim.stages.figures import diagnosis_figures, paths_of

    if recordings:
        from gpsim.stages.fleet import recordings_in

        found = recordings_in(recordings, asked.simulator) if len(recordings) > 1 else {"": recordings[0]}
        together = {name: read(path) for name, path in found.items()}
        if len(recordings) == 1 and together[""] != recordings[0]:
            answer({"recording": together[""]})
        stage = stage_for(Task.of(together, asked.simulator, config["diagnose"]["episodes"], own))
    else:
        if asked.simulator is not None:
            raise UsageError("diagnose: --simulator needs a RECORDING; for the loop, use simulator=NAME")
        if own:
            raise UsageError(
                "diagnose: --effects goes with a RECORDING, as: gpsim diagnose rec --effects my_effects.py"
            )
        from gpsim.stages import diagnose_loop

        stage = diagnose_loop.STAGE
    shares = MUJOCO if asked.simulator is not None and is_mujoco(asked.simulator) else DIAGNOSIS
    made = setup.make(stage, asked.out, dry_run, shares, None if is_compiled() else COMPILES, cores=cores)
    if made is None:
        return
    artifact, existed = made
    diagnosis = read_diagnosis(artifact.path)
    name = artifact.manifest["config"].get("simulator")
    _tell(diagnosis, artifact.path, name, of_task=bool(recordings), explain=asked.explain)
    say_made(artifact, existed)
    answer(
        paths_of("diagnose", artifact.path), made=not existed, simulator=name, **diagnosis_figures(diagnosis)
    )


def _tell(found: Diagnosis, folder: Path, simulator: Any, *, of_task: bool, explain: bool) -> None:
    """Print the account, behind what a reader of it has to know."""
    from gpsim.mjcf import notes_of
    from gpsim.reports.account import account_of
    from gpsim.reports.account_lines import account_lines
    from gpsim.reports.diagnosis_text import RANKED, not_asked_lines, ranking
    from gpsim.reports.statistics_text import trace_lines
    from gpsim.stages.diagnosis_files import read_trace

    for line in not_asked_lines(found.not_asked):
        caution(line)
    for line in notes_of(simulator) if of_task else ():
        caution(f"{simulator}, not as its file says: {line}")
    say_all(account_lines(account_of(found, str(folder), simulator)))
    if explain:
        say(f"\nEvery hypothesis that was fitted: {RANKED}.")
        say_all(ranking(found))
        say(
            "\nEvery decision: its gain in nats, the share of the remaining error that it removes, the rule, the "
            "change."
        )
        say_all(trace_lines(read_trace(folder)))


def _score(setup: Setup, asked: Asked, recording: Path, dry_run: bool) -> None:
    from gpsim.reports.statistics_text import score_lines
    from gpsim.stages.diagnose_loop import read_score, score_stage
    from gpsim.stages.figures import paths_of, score_figures

    assert asked.score is not None
    stage = score_stage(asked.score, recording, asked.simulator)
    if (made := setup.make(stage, asked.out, dry_run, cores=asked.cores or CORES)) is None:
        return
    artifact, existed = made
    found = read_score(artifact.path)
    say_all(score_lines(found))
    say_made(artifact, existed)
    paths = paths_of("score", artifact.path) | {"diagnosis": asked.score, "recording": recording}
    answer(paths, made=not existed, score=score_figures(found))


def _check_together(recordings: Sequence[Path], asked: Asked, dry_run: bool) -> None:
    """What goes with one recording alone, or with none."""
    if asked.each:
        if not recordings:
            raise UsageError("diagnose: --each needs RECORDINGs, or folders of them")
        wrong = {"--score": asked.score is not None, "--explain": asked.explain, "--dry-run": dry_run}
        for option in (option for option, given in wrong.items() if given):
            raise UsageError(f"diagnose: {option} goes with one RECORDING, not with --each")
        return
    if len(recordings) > 1 and asked.score is not None:
        raise UsageError(
            f"diagnose: --score goes with one RECORDING at a time, got {', '.join(map(str, recordings))}"
        )
    for folder in recordings if len(recordings) == 1 else ():
        below = sorted(path.parent.name for path in folder.glob("*/recording.yaml"))
        if below and not (folder / "recording.yaml").is_file():
            raise UsageError(
                f"diagnose: {folder} holds {len(below)} recordings, {below[0]} first: name one, name several for "
                "a common account, or use --each"
            )


def _parted(settings: list[str]) -> tuple[list[str], list[str]]:
    """The settings, and the words that say what is what in a raw log."""
    others = [word for word in settings if top_key(word) not in (*USED, *INSTEAD)]
    if not others:
        return settings, []
    from gpsim.stages.raw_logs import of_the_mapping

    of_log = [word for word in others if of_the_mapping(word)]
    return [word for word in settings if word not in of_log], of_log


def _refuse(settings: list[str]) -> None:
    """What belongs to the loop's own recording would be ignored."""
    for word in settings:
        if (name := top_key(word)) in INSTEAD:
            raise UsageError(f"diagnose: {word}: beside a RECORDING give {INSTEAD[name]}")
        if name not in USED:
            raise UsageError(
                f"diagnose: {word}: not used with a RECORDING; valid settings: seed, diagnose.episodes, experiment, "
                "runs_dir"
            )


def _log_of(recording: Path, of_log: list[str], asked: Asked) -> RawLog | None:
    """The recording as a log that is to be imported first, if it is one."""
    if asked.score is not None or (recording.is_dir() and (recording / "recording.yaml").is_file()):
        if asked.mapping is not None:
            raise UsageError(f"diagnose: --mapping is for raw logs; {recording} already defines its channels")
        return None
    from gpsim.stages.raw_logs import RawLog, is_raw  # they take a second that others have no use for

    if (
        asked.mapping is None
        and not is_raw(recording, asked.simulator)
        and not (of_log and recording.is_file())
    ):
        return None
    return RawLog(recording, "gpsim diagnose", asked.simulator, mapping=asked.mapping, words=tuple(of_log))


def _imported(log: RawLog, config: dict[str, Any]) -> Path:
    from gpsim.stages.raw_logs import imported
    from gpsim.stages.stage import Request

    artifact, _ = imported(Request(config), log, caution)
    warn(artifact.path)
    note(f"recording: {artifact.path} (import_report.txt lists the kept rows)")
    return artifact.path


def _diagnose_each(
    recordings: Sequence[Path],
    simulator: str | None,
    read: Callable[[Path], Path],
    request: Request,
    effects: tuple[str, ...],
) -> None:
    """Print an account a recording, then which robots differ, and where the page lies."""
    from gpsim.stages import fleet
    from gpsim.stages.diagnose import Task

    def task_of(path: Path) -> Task | str:
        try:
            return Task(read(path), simulator, request.config["diagnose"]["episodes"], effects=effects)
        except UsageError as error:
            return str(error)

    launcher = launcher_of(request.config, request.cores)
    tasks = {name: task_of(path) for name, path in fleet.recordings_in(recordings, simulator).items()}
    with Board(len(tasks)) as board:
        found = fleet.run(replace(request, cores=1), tasks, launcher, board)
    _tell_fleet(found, simulator)
    if found.failed:
        raise UsageError(
            f"{found.failed} of {len(tasks)} recordings could not be diagnosed; the page says why. To continue, run "
            "the same command again"
        )


def _tell_fleet(found: Fleet, simulator: str | None) -> None:
    from gpsim.reports.account import account_of
    from gpsim.reports.account_lines import account_lines
    from gpsim.stages import fleet

    robots, places = [], {name: artifact.path for name, artifact in found.made.items()}
    for robot in found.robots:
        name, told, verdict = robot.name, [robot.error], None
        if robot.diagnosis is not None:
            told = account_lines(account_of(robot.diagnosis, str(places[name]), simulator))
            verdict = robot.diagnosis.verdict
        say(f"{name}: {places.get(name, 'failed')}")
        say_all(told, "  ")
        say()
        folder = str(places[name].absolute()) if name in places else None
        robots.append({"name": name, "verdict": verdict, "folder": folder, "error": robot.error or None})
    say(f"Fleet    {found.said}")
    say_all((difference.sentence for difference in found.found), "  ")
    page = found.artifact.path / fleet.PAGE
    say(f"diagnose: {page}")
    paths = {"folder": page.parent, "fleet": page.with_name(fleet.FACTS), "report": page}
    answer(paths, said=found.said, robots=robots, differences=[asdict(d) for d in found.found])
