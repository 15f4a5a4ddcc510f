"""`gpsim sweep`: one stage for every combination of settings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from gpsim.errors import UsageError
from gpsim.reports.sheets import literal

from .answers import answer, warned
from .cores import CORES
from .launching import launcher_of
from .options import ConfigDir, DryRun, Jobs, shown_words
from .printing import say
from .progress import Board, note, warn

if TYPE_CHECKING:
    from gpsim.artifacts import Artifact
    from gpsim.stages.grid import Point

Words = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[KEY=VALUE]...",
        help="Settings; several values make a sweep: gp.n_train=100,250 seed=range(10).",
    ),
]
Of = Annotated[str, typer.Option("--of", help="The stage to run at every point, with all that it needs.")]


def sweep_command(
    words: Words = None,
    of: Of = "evaluate",
    jobs: Jobs = CORES,
    config_dir: ConfigDir = None,
    dry_run: DryRun = False,
) -> None:
    """One stage for every combination of settings, in Hydra's sweep grammar; a table and a page at the end."""
    from .sweep_words import points_of

    points = _resolved(points_of(words or []), config_dir)
    launcher = launcher_of(points[0].request.config, jobs)
    from gpsim.stages import grid  # torch takes seconds to load

    plan = grid.grid_of(points, of)
    say(f"sweep: {len(points)} points, {len(plan.jobs)} jobs")
    answer(of=of, points=len(points), jobs=len(plan.jobs))
    if dry_run:
        answer(dry_run=True)
        return
    with Board(len(plan.jobs)) as board:

        def finished(job: str, artifact: Artifact, existed: bool) -> None:
            mark = Text("kept", "dim") if existed else Text("made", "green")
            board.finish(job, mark + literal(f" {job:<34} {artifact.path}"), existed)
            warn(artifact.path)

        def failed(job: str, why: str) -> None:
            board.finish(job, Text("failed", "red") + literal(f" {job:<34} {why}"))
            warned(f"{job}: {why}")

        artifact, missing = grid.run(plan, launcher, board.update, finished, failed)
    note(f"the table's columns: the settings that vary, the figures of {of}, sha256, error")
    say(f"sweep: {artifact.path / grid.PAGE}, {artifact.path / grid.PARQUET}")
    say(artifact.path / grid.CSV)  # the path alone on the last line, for programs
    made = {"table": grid.CSV, "parquet": grid.PARQUET, "report": grid.PAGE}
    answer(
        {"folder": artifact.path} | {name: artifact.path / file for name, file in made.items()},
        swept=list(points[0].swept),
    )
    if missing:
        raise UsageError(
            f"{missing} of {len(points)} points failed; the table says why, run the same command to carry on"
        )


def _resolved(found: Sequence[Any], config_dir: Path | None) -> list[Point]:
    """The requests; what differs by its seed alone is resolved once, which takes Hydra a tenth of a second."""
    from gpsim.stages.grid import Point
    from gpsim.stages.stage import Request

    from .configuration import resolve

    known: dict[tuple[str, ...], dict[str, Any]] = {}
    points = []
    for point in found:
        seed = point.swept.get("seed", "")
        rest = tuple(word for word in point.words if not (seed.isdecimal() and word.startswith("seed=")))
        if rest not in known:
            known[rest] = resolve(rest, config_dir)
        request = Request(known[rest], shown_words(rest, config_dir))
        points.append(Point(point.swept, request.having(seed=int(seed)) if seed.isdecimal() else request))
    return points
