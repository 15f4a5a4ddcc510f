"""gpsim diagnose: where recording and simulator differ, which physics is missing, how much, and whether it helps."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Annotated

import typer

from .configuration import resolve
from .progress import single_progress

RecordingPath = Annotated[
    Path, typer.Argument(metavar="RECORDING", help="A recording's folder, or a bare CSV.")
]
Overrides = Annotated[list[str] | None, typer.Argument(metavar="[KEY=VALUE]...", help="Settings, as seed=1.")]
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
Explain = Annotated[bool, typer.Option("--explain", help="Print the whole ranking of explanations.")]


def diagnose_command(
    recording: RecordingPath,
    words: Overrides = None,
    simulator: SimulatorName = None,
    out: Out = None,
    explain: Explain = False,
) -> None:
    """Say where simulator and recording differ, which physics was left out, how much, and if the fit is better."""
    config = resolve(words or [], None)
    # Imported here: scipy and matplotlib take seconds to load, and `--help` should not wait for it.
    from gpsim.diagnosis.telling import paragraphs, ranking
    from gpsim.stages.diagnose import Task, make, read_diagnosis
    from gpsim.stages.stage import Request

    with single_progress("diagnose") as progress:
        artifact, existed = make(
            Request(config, tuple(words or ()), progress, out), Task(recording, simulator)
        )
    report = read_diagnosis(artifact.path)
    typer.echo(f"Verdict: {report['verdict']}\n")
    for text in paragraphs(report):
        typer.echo(textwrap.fill(text, 100) + "\n")
    if explain:
        typer.echo("Nats behind the best, integration, explanation:")
        for line in ranking(report):
            typer.echo(line)
    typer.echo(f"diagnose: {artifact.path}{' (already there)' if existed else ''}")
