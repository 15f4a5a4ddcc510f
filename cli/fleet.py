"""`gpsim diagnose --each`: a fleet's recordings, one account each and one page over all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from gpsim.errors import UsageError

from .answers import answer, say, say_all
from .options import launcher_of
from .progress import Board

if TYPE_CHECKING:
    from gpsim.artifacts import Artifact
    from gpsim.stages.fleet import Fleet
    from gpsim.stages.stage import Request


def refuse_several(recordings: Sequence[Path], score: Path | None) -> None:
    """What cannot be judged together: several beside `--score`, and what lies in one folder and is not named."""
    if len(recordings) > 1 and score is not None:
        named = ", ".join(map(str, recordings))
        raise UsageError(f"diagnose: --score goes with one RECORDING at a time, got {named}")
    for folder in recordings if len(recordings) == 1 else ():
        if folder.is_dir() and not (folder / "recording.yaml").is_file():
            below = sorted(path.parent.name for path in folder.glob("*/recording.yaml"))
            if below:
                raise UsageError(
                    f"diagnose: {folder} holds {len(below)} recordings, {below[0]} first: name one, name several to "
                    "judge them together, or give --each"
                )


def diagnose_each(
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
    _tell(found, places, simulator)
    if found.failed:
        raise UsageError(
            f"{found.failed} of {len(tasks)} recordings could not be diagnosed; the page says why, run the same "
            "command to carry on"
        )


def _tell(found: Fleet, places: dict[str, Path], simulator: str | None) -> None:
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
