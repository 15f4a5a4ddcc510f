"""gpsim view: a diagnosis in motion, in Rerun's viewer."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from gpsim.errors import UsageError

from .answers import answer, say, say_all
from .export import Diagnosed, Horizon, Where

OutFile = Annotated[
    Path | None,
    typer.Option(
        "--out", help="Save a Rerun file (.rrd), which must not exist, instead of opening the viewer."
    ),
]


def view_command(
    folder: Diagnosed, out: OutFile = None, recording: Where = None, horizon: Horizon = None
) -> None:
    """Watch real, base and corrected motion side by side, and their numbers, in Rerun."""
    from gpsim.stages.export_diagnosis import export_diagnosis

    with TemporaryDirectory() as here:
        made, notes = export_diagnosis(folder, out or Path(here, "motion.rrd"), recording, horizon, "rrd")
        say_all([f"view: {out}"] if out else [])
        say_all(notes, "  ")
        answer({"diagnosis": folder, "view": out}, notes=notes)
        if out is None:
            say("view: in Rerun's window, until it is closed")
            shown = subprocess.run([sys.executable, "-m", "rerun", str(made)], capture_output=True)
            if shown.returncode:
                raise UsageError(
                    "view: Rerun's viewer does not open here; --out FILE.rrd saves for elsewhere: rerun FILE.rrd"
                )
