"""gpsim diagnose: where recording and simulator differ, which physics is missing, how much, and whether it helps."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Annotated, Any

import typer

from gpsim.errors import UsageError

from .answers import answer
from .options import ConfigDir, ShowConfig, show, shown_words
from .printing import say
from .progress import caution, single_progress, warn

Words = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[RECORDING] [KEY=VALUE]...",
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
Explain = Annotated[
    bool, typer.Option("--explain", help="Print the whole ranking of explanations, and every decision.")
]


def diagnose_command(
    words: Words = None,
    simulator: SimulatorName = None,
    out: Out = None,
    score: ScoreOf = None,
    explain: Explain = False,
    cores: Cores = None,
    config_dir: ConfigDir = None,
    show_config: ShowConfig = False,
) -> None:
    """Say where simulator and recording differ, which physics was left out, how much, and if the fit is better."""
    from .configuration import resolve  # Hydra is no part of `--help`

    recording, settings = _split(words or [])
    if recording is not None:
        _refuse(settings)
    config = resolve(settings, config_dir)
    if show_config:
        show(config)
        return
    if score is not None:
        _score(score, recording, simulator, out, config, shown_words(settings, config_dir), cores)
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
    from gpsim.stages.figures import diagnosis_figures, paths_of
    from gpsim.stages.stage import Request

    if recording is None and simulator is not None:
        raise UsageError("diagnose: --simulator goes with a RECORDING; the loop's own is of simulator=NAME")
    task = Task(recording, simulator, config["diagnose"]["episodes"]) if recording is not None else None
    stage = stage_for(task) if task else diagnose_loop.STAGE
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
    answer(paths_of("diagnose", artifact.path), made=not existed, simulator=name, **diagnosis_figures(found))


def _score(
    diagnosis: Path,
    recording: Path | None,
    simulator: str | None,
    out: Path | None,
    config: dict[str, Any],
    words: tuple[str, ...],
    cores: int | None,
) -> None:
    """Print how an existing diagnosis does on another recording."""
    from gpsim.reports.score_text import score_lines
    from gpsim.stages.figures import paths_of, score_figures
    from gpsim.stages.score import read_score, stage_for
    from gpsim.stages.stage import Request

    if recording is None:
        raise UsageError("diagnose: --score DIAGNOSIS needs the RECORDING to judge it on")
    with single_progress("score") as progress:
        request = Request(config, words, progress, out, cores=cores or os.cpu_count() or 1)
        artifact, existed = stage_for(diagnosis, recording, simulator).make(request)
    found = read_score(artifact.path)
    for line in score_lines(found):
        say(line)
    say(f"score: {artifact.path}{' (already there)' if existed else ''}")
    made = paths_of("score", artifact.path) | {"diagnosis": diagnosis, "recording": recording}
    answer(made, made=not existed, score=score_figures(found))


USED = ("seed", "diagnose", "experiment", "runs_dir")
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


def _split(words: list[str]) -> tuple[Path | None, list[str]]:
    """The recording and the settings; a word with = or a leading ~ is one, unless something of that name exists."""
    recordings = [word for word in words if not ("=" in word or word.startswith("~")) or Path(word).exists()]
    if len(recordings) > 1:
        raise UsageError(f"diagnose: one RECORDING at a time, got {', '.join(recordings)}")
    return Path(recordings[0]) if recordings else None, [word for word in words if word not in recordings]
