"""gpsim diagnose: where recording and simulator differ, which physics is missing, how much, and whether it helps."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gpsim.errors import UsageError

from . import completion
from .answers import answer, say, say_all
from .everywhere import named, named_effects
from .options import CORES, DryRun, Setup, launcher_of, refuse_launcher, say_made, split_words, spread
from .progress import DIAGNOSIS, MUJOCO, Board, caution, note, warn

COMPILES = "compiling the simulators for this machine: about a minute, only once"

if TYPE_CHECKING:
    from gpsim.artifacts import Artifact
    from gpsim.diagnosis import Diagnosis
    from gpsim.stages.fleet import Fleet
    from gpsim.stages.raw_logs import RawLog
    from gpsim.stages.stage import Request

RecordingWords = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[RECORDING]... [KEY=VALUE]...",
        help="Recording folders or raw logs; by default the recording of the loop. Several recordings of one "
        "machine get one account. Then settings, such as seed=1, or for a raw log theta=deg*angle.",
        autocompletion=completion.diagnose_words,
    ),
]
SimulatorName = Annotated[
    str | None,
    typer.Option(
        "--simulator",
        help="A simulator, or your own system as FILE.py:ClassName; by default that of the recording.",
        autocompletion=completion.simulator_names,
    ),
]
MappingName = Annotated[
    str | None,
    typer.Option(
        "--mapping",
        help="For a raw log: the assignment of columns to channels, as the name of a mapping or a YAML file.",
        autocompletion=completion.mapping_names,
    ),
]
Out = Annotated[
    Path | None, typer.Option("--out", help="Write here instead of runs/<experiment>/diagnose/vNNNN.")
]
Cores = Annotated[int | None, typer.Option("--cores", min=1, help="Processes to use; all cores by default.")]
Effects = Annotated[
    list[str] | None,
    typer.Option(
        "--effects",
        metavar="FILE.py[:Class]",
        help="Your own effects, tested together with the catalogue (`gpsim effects new`); may be repeated.",
    ),
]
ScoreOf = Annotated[
    Path | None,
    typer.Option(
        "--score",
        metavar="DIAGNOSIS",
        autocompletion=completion.diagnoses,
        help="Evaluate this finished diagnosis on RECORDING instead of making a new one; nothing is fitted.",
    ),
]
Each = Annotated[
    bool,
    typer.Option(
        "--each",
        help="Diagnose each RECORDING, or each in a folder, separately, and compare them on one page.",
    ),
]
Explain = Annotated[
    bool, typer.Option("--explain", help="Print the whole ranking of explanations, and every decision.")
]


@dataclass
class DiagnoseSetup(Setup):
    """Recordings stand before the settings."""

    words: RecordingWords = None


@spread
def diagnose_command(
    *,
    simulator: SimulatorName = None,
    mapping: MappingName = None,
    out: Out = None,
    score: ScoreOf = None,
    each: Each = False,
    explain: Explain = False,
    cores: Cores = None,
    effects: Effects = None,
    given: DiagnoseSetup,
    dry_run: DryRun = False,
) -> None:
    """Find which physics the simulator lacks, how much of it, and whether the corrected simulator fits better."""
    recordings, settings = split_words(given.words or [])
    named(simulator, settings)
    own = named_effects(effects)
    if not each:
        _refuse_several(recordings, score)
    recording = recordings[0] if recordings else None
    log: RawLog | None = None
    if each or len(recordings) > 1:
        if each:
            _check_each(recordings, score, explain, dry_run)
        settings, of_log = _parted(settings)
        _refuse(settings)
    elif recording is not None:
        log, settings = _raw(recording, settings, simulator, mapping, score)
        _refuse(settings)
    elif mapping is not None:
        raise UsageError("diagnose: --mapping goes with a raw log, as: gpsim diagnose my.bag --mapping FILE")
    setup = replace(given, words=settings)
    config = setup.config

    def read(path: Path) -> Path:
        found, rest = _raw(path, of_log, simulator, mapping, None)
        _refuse(rest)  # what says nothing of a log
        return path if found is None else _imported(found, config)

    if each:
        _diagnose_each(recordings, simulator, read, setup.request(out=out, cores=cores or CORES), own)
        return
    refuse_launcher("diagnose", settings)
    if score is not None:
        _score(setup, score, recording, simulator, out, dry_run, cores or CORES)
        return
    # Imported here: scipy and matplotlib take seconds to load, and `--help` should not wait for it.
    from gpsim.kernels import is_compiled
    from gpsim.mjcf import is_mujoco
    from gpsim.stages.diagnose import Task, read_diagnosis, stage_for
    from gpsim.stages.figures import diagnosis_figures, paths_of

    if recording is None and simulator is not None:
        raise UsageError("diagnose: --simulator needs a RECORDING; for the loop, use simulator=NAME")
    if log is not None:
        recording = _imported(log, config)
        answer({"recording": recording})
    if own and recording is None:
        raise UsageError(
            "diagnose: --effects goes with a RECORDING, as: gpsim diagnose rec --effects my_effects.py"
        )
    task, episodes = None, config["diagnose"]["episodes"]
    if len(recordings) > 1:
        from gpsim.stages.fleet import recordings_in

        together = {name: read(path) for name, path in recordings_in(recordings, simulator).items()}
        task = Task.of(together, simulator, episodes, own)
    elif recording is not None:
        task = Task(recording, simulator, episodes, effects=own)
    if task is not None:
        stage = stage_for(task)
    else:
        from gpsim.stages.diagnose_loop import STAGE

        stage = STAGE
    model = simulator is not None and is_mujoco(simulator)
    made = setup.make(
        stage,
        out,
        dry_run,
        MUJOCO if model else DIAGNOSIS,
        None if is_compiled() else COMPILES,
        cores=cores or CORES,
    )
    if made is None:
        return
    artifact, existed = made
    found = read_diagnosis(artifact.path)
    name = artifact.manifest["config"].get("simulator")
    _tell(found, artifact.path, name, of_task=task is not None, explain=explain)
    say_made(artifact, existed)
    answer(paths_of("diagnose", artifact.path), made=not existed, simulator=name, **diagnosis_figures(found))


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


def _score(
    setup: Setup,
    diagnosis: Path,
    recording: Path | None,
    simulator: str | None,
    out: Path | None,
    dry_run: bool,
    cores: int,
) -> None:
    """Print how an existing diagnosis does on another recording."""
    from gpsim.reports.statistics_text import score_lines
    from gpsim.stages.diagnose_loop import read_score, score_stage
    from gpsim.stages.figures import paths_of, score_figures

    if recording is None:
        raise UsageError("diagnose: --score DIAGNOSIS needs a RECORDING to evaluate it on")
    made = setup.make(score_stage(diagnosis, recording, simulator), out, dry_run, cores=cores)
    if made is None:
        return
    artifact, existed = made
    found = read_score(artifact.path)
    say_all(score_lines(found))
    say_made(artifact, existed)
    paths = paths_of("score", artifact.path) | {"diagnosis": diagnosis, "recording": recording}
    answer(paths, made=not existed, score=score_figures(found))


def _raw(
    recording: Path, settings: list[str], simulator: str | None, mapping: str | None, score: Path | None
) -> tuple[RawLog | None, list[str]]:
    """The recording as a log that is to be imported first, if it is one, and the settings that are left."""
    rest, of_log = _parted(settings)
    if (recording.is_dir() and (recording / "recording.yaml").is_file()) or score is not None:
        if mapping is not None:
            raise UsageError(f"diagnose: --mapping is for raw logs; {recording} already defines its channels")
        return None, settings
    from gpsim.stages.raw_logs import RawLog, is_raw  # they take a second that others have no use for

    if mapping is None and not is_raw(recording, simulator) and not (of_log and recording.is_file()):
        return None, settings
    log = RawLog(recording, "gpsim diagnose", simulator, mapping=mapping, words=tuple(of_log))
    return log, rest


def _parted(settings: list[str]) -> tuple[list[str], list[str]]:
    """The settings, and the words that say what is what in a raw log."""
    others = [word for word in settings if _top(word) not in (*USED, *INSTEAD)]
    if not others:
        return settings, []
    from gpsim.stages.raw_logs import of_the_mapping

    of_log = [word for word in others if of_the_mapping(word)]
    return [word for word in settings if word not in of_log], of_log


def _imported(log: RawLog, config: dict[str, Any]) -> Path:
    """The recording that a raw log gives, below runs/."""
    from gpsim.stages.raw_logs import imported
    from gpsim.stages.stage import Request

    artifact, _ = imported(Request(config), log, caution)
    warn(artifact.path)
    note(f"recording: {artifact.path} (import_report.txt lists the kept rows)")
    return artifact.path


USED = ("seed", "diagnose", "experiment", "runs_dir", "launcher")
"""What counts beside a RECORDING, which brings its own simulator, parameters, integrator and clock."""
INSTEAD = {
    "simulator": "--simulator NAME; parameters, integrator and dt come from its recording.yaml",
    "recording": "the RECORDING alone",
}


def _refuse(settings: list[str]) -> None:
    """What belongs to the loop's own recording would be ignored."""
    for word in settings:
        name = _top(word)
        if name in INSTEAD:
            raise UsageError(f"diagnose: {word}: beside a RECORDING give {INSTEAD[name]}")
        if name not in USED:
            raise UsageError(
                f"diagnose: {word}: not used with a RECORDING; valid settings: seed, diagnose.episodes, experiment, "
                "runs_dir"
            )


def _check_each(recordings: list[Path], score: Path | None, explain: bool, dry_run: bool) -> None:
    if not recordings:
        raise UsageError("diagnose: --each needs RECORDINGs, or folders of them")
    wrong = {"--score": score is not None, "--explain": explain, "--dry-run": dry_run}
    for option in (option for option, given in wrong.items() if given):
        raise UsageError(f"diagnose: {option} goes with one RECORDING, not with --each")


def _top(word: str) -> str:
    """The setting that a word changes, or one within it."""
    return re.split(r"[.@/=]", word.lstrip("+~"))[0]


def _refuse_several(recordings: Sequence[Path], score: Path | None) -> None:
    """What cannot be judged together: several beside `--score`, and what lies in one folder and is not named."""
    if len(recordings) > 1 and score is not None:
        named = ", ".join(map(str, recordings))
        raise UsageError(f"diagnose: --score goes with one RECORDING at a time, got {named}")
    for folder in recordings if len(recordings) == 1 else ():
        if folder.is_dir() and not (folder / "recording.yaml").is_file():
            below = sorted(path.parent.name for path in folder.glob("*/recording.yaml"))
            if below:
                raise UsageError(
                    f"diagnose: {folder} holds {len(below)} recordings, {below[0]} first: name one, name several for "
                    "a common account, or use --each"
                )


def _diagnose_each(
    recordings: Sequence[Path],
    simulator: str | None,
    read: Callable[[Path], Path],
    request: Request,
    effects: tuple[str, ...] = (),
) -> None:
    """Print an account a recording, then which robots differ, and where the page lies.

    read(path) is the recording itself, which of a raw log is imported then; it raises UsageError.
    """
    from gpsim.stages import fleet
    from gpsim.stages.diagnose import Task

    def task_of(path: Path) -> Task | str:
        try:
            return Task(read(path), simulator, request.config["diagnose"]["episodes"], effects=effects)
        except UsageError as error:
            return str(error)

    launcher = launcher_of(request.config, request.cores)
    tasks = {name: task_of(path) for name, path in fleet.recordings_in(recordings, simulator).items()}
    places: dict[str, Path] = {}
    with Board(len(tasks)) as board:

        def finished(job: str, artifact: Artifact, existed: bool) -> None:
            places[job] = artifact.path
            board.made(job, artifact, existed)

        alone = replace(request, cores=1)
        found = fleet.run(alone, tasks, launcher, board.update, finished, board.failed)
    _tell_fleet(found, places, simulator)
    if found.failed:
        raise UsageError(
            f"{found.failed} of {len(tasks)} recordings could not be diagnosed; the page says why. To continue, run "
            "the same command again"
        )


def _tell_fleet(found: Fleet, places: dict[str, Path], simulator: str | None) -> None:
    """The accounts, and what differs."""
    from gpsim.reports.account import account_of
    from gpsim.reports.account_lines import account_lines
    from gpsim.stages import fleet

    for robot in found.robots:
        say(f"{robot.name}: {places.get(robot.name, 'failed')}")
        lines = [robot.error]
        if robot.diagnosis is not None:
            lines = account_lines(account_of(robot.diagnosis, str(places[robot.name]), simulator))
        say_all(lines, "  ")
        say()
    say(f"Fleet    {found.said}")
    say_all((difference.sentence for difference in found.found), "  ")
    folder = found.artifact.path
    say(f"diagnose: {folder / fleet.PAGE}")
    answer(
        {"folder": folder, "fleet": folder / fleet.FACTS, "report": folder / fleet.PAGE},
        said=found.said,
        robots=[
            {
                "name": robot.name,
                "verdict": robot.diagnosis.verdict if robot.diagnosis is not None else None,
                "folder": str(places[robot.name].absolute()) if robot.name in places else None,
                "error": robot.error or None,
            }
            for robot in found.robots
        ],
        differences=[asdict(d) for d in found.found],
    )
