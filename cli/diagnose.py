"""gpsim diagnose: where recording and simulator differ, which physics is missing, how much, and whether it helps."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Annotated, Any

import typer

from gpsim.errors import UsageError

from .fleet import diagnose_each, refuse_several
from .launching import refuse_launcher
from .options import ConfigDir, DryRun, ShowConfig, show_standing, shown_words
from .printing import say
from .progress import caution, single_progress, warn

Words = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[RECORDING]... [KEY=VALUE]...",
        help="A recording's folder or a bare CSV (the loop's own recording without one), and settings, as seed=1.",
    ),
]
SimulatorName = Annotated[
    str | None,
    typer.Option(
        "--simulator",
        help="A simulator, or your own system as FILE.py:ClassName; the recording's by default.",
    ),
]
Out = Annotated[
    Path | None, typer.Option("--out", help="Write here instead of runs/<experiment>/diagnose/vNNNN.")
]
Cores = Annotated[int | None, typer.Option("--cores", min=1, help="Processes to use; all cores by default.")]
ScoreOf = Annotated[
    Path | None,
    typer.Option(
        "--score",
        metavar="DIAGNOSIS",
        help="Judge this finished diagnosis on RECORDING instead of making one; nothing is fitted.",
    ),
]
Each = Annotated[
    bool,
    typer.Option("--each", help="Several RECORDINGs, or folders of them: an account each, a page over all."),
]
Explain = Annotated[
    bool, typer.Option("--explain", help="Print the whole ranking of explanations, and every decision.")
]


def diagnose_command(
    words: Words = None,
    simulator: SimulatorName = None,
    out: Out = None,
    score: ScoreOf = None,
    each: Each = False,
    explain: Explain = False,
    cores: Cores = None,
    config_dir: ConfigDir = None,
    show_config: ShowConfig = False,
    dry_run: DryRun = False,
) -> None:
    """Say where simulator and recording differ, which physics was left out, how much, and if the fit is better."""
    from .configuration import as_yaml, resolve  # Hydra is no part of `--help`

    recordings, settings = _split(words or [])
    if not each:
        refuse_several(recordings)
    recording = recordings[0] if recordings else None
    if recording is not None:
        _refuse(settings)
    config = resolve(settings, config_dir)
    if show_config:
        typer.echo(as_yaml(config), nl=False)
        return
    if each:
        _check_each(recordings, score, explain, dry_run)
        diagnose_each(recordings, simulator, out, config, shown_words(settings, config_dir), cores)
        return
    refuse_launcher("diagnose", settings)
    if score is not None:
        _score(score, recording, simulator, out, config, shown_words(settings, config_dir), cores, dry_run)
        return
    # Imported here: scipy and matplotlib take seconds to load, and `--help` should not wait for it.
    from gpsim.reports.account import account_of
    from gpsim.reports.account_lines import account_lines
    from gpsim.reports.diagnosis_text import ranking
    from gpsim.reports.not_asked_text import not_asked_lines
    from gpsim.reports.trace_text import trace_lines
    from gpsim.stages import diagnose_loop
    from gpsim.stages.diagnose import Task, read_diagnosis, stage_for
    from gpsim.stages.diagnosis_files import read_trace
    from gpsim.stages.stage import Request

    if recording is None and simulator is not None:
        raise UsageError("diagnose: --simulator goes with a RECORDING; the loop's own is of simulator=NAME")
    task = Task(recording, simulator, config["diagnose"]["episodes"]) if recording is not None else None
    stage = stage_for(task) if task else diagnose_loop.STAGE
    if dry_run:
        show_standing(stage, Request(config, shown_words(settings, config_dir), out=out))
        return
    with single_progress("diagnose") as progress:
        request = Request(
            config, shown_words(settings, config_dir), progress, out, cores=cores or os.cpu_count() or 1
        )
        artifact, existed = stage.make(request)
    warn(artifact.path)
    found = read_diagnosis(artifact.path)
    for line in not_asked_lines(found.not_asked):
        caution(line)
    name = artifact.manifest["config"].get("simulator")
    for text in account_lines(account_of(found, str(artifact.path), name)):
        say(text)
    if explain:
        say("\nEvery hypothesis that was fitted: nats behind the best, integration, explanation.")
        for line in ranking(found):
            say(line)
        say(
            "\nEvery decision: nats by which it wins, share of what was left that it removes, rule, what it adds."
        )
        for line in trace_lines(read_trace(artifact.path)):
            say(line)
    say(f"diagnose: {artifact.path}{' (already there)' if existed else ''}")


def _score(
    diagnosis: Path,
    recording: Path | None,
    simulator: str | None,
    out: Path | None,
    config: dict[str, Any],
    words: tuple[str, ...],
    cores: int | None,
    dry_run: bool,
) -> None:
    """Print how an existing diagnosis does on another recording."""
    from gpsim.reports.score_text import score_lines
    from gpsim.stages.score import read_score, stage_for
    from gpsim.stages.stage import Request

    if recording is None:
        raise UsageError("diagnose: --score DIAGNOSIS needs the RECORDING to judge it on")
    if dry_run:
        show_standing(stage_for(diagnosis, recording, simulator), Request(config, words, out=out))
        return
    with single_progress("score") as progress:
        request = Request(config, words, progress, out, cores=cores or os.cpu_count() or 1)
        artifact, existed = stage_for(diagnosis, recording, simulator).make(request)
    for line in score_lines(read_score(artifact.path)):
        say(line)
    say(f"score: {artifact.path}{' (already there)' if existed else ''}")


USED = ("seed", "diagnose", "experiment", "runs_dir", "launcher")
"""What counts beside a RECORDING, which brings its own simulator, parameters, integrator and clock."""
INSTEAD = {
    "simulator": "--simulator NAME; parameters, integrator and dt are those of its recording.yaml",
    "recording": "the RECORDING alone",
}


def _refuse(settings: list[str]) -> None:
    """What belongs to the loop's own recording would be ignored."""
    for word in settings:
        name = re.split(r"[.@/=]", word.lstrip("+~"))[0]
        if name in INSTEAD:
            raise UsageError(f"diagnose: {word}: beside a RECORDING give {INSTEAD[name]}")
        if name not in USED:
            raise UsageError(
                f"diagnose: {word}: not used beside a RECORDING; settings that count there: seed, diagnose.episodes, "
                "experiment, runs_dir"
            )


def _check_each(recordings: list[Path], score: Path | None, explain: bool, dry_run: bool) -> None:
    if not recordings:
        raise UsageError("diagnose: --each needs RECORDINGs, or folders of them")
    wrong = {"--score": score is not None, "--explain": explain, "--dry-run": dry_run}
    for option in (option for option, given in wrong.items() if given):
        raise UsageError(f"diagnose: {option} goes with one RECORDING, not with --each")


def _split(words: list[str]) -> tuple[list[Path], list[str]]:
    """The recordings and the settings; a word with = or a leading ~ is one, unless something of that name exists."""
    recordings = [word for word in words if not ("=" in word or word.startswith("~")) or Path(word).exists()]
    return [Path(word) for word in recordings], [word for word in words if word not in recordings]
