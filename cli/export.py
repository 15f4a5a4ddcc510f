"""What gpsim made, for other programs: `gpsim export` writes their files, `gpsim view` opens Rerun's viewer."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import typer

from gpsim.errors import UsageError

from . import completion
from .answers import answer, say, say_all
from .options import ConfigDir, Words, shown_words

export_app = typer.Typer(
    help="Write a recording, a diagnosis or a policy in the formats of other programs.", no_args_is_help=True
)
Diagnosed = Annotated[
    Path, typer.Argument(metavar="DIR", help="A finished diagnosis, as runs/a/diagnose/v0001.")
]
Where = Annotated[
    Path | None,
    typer.Option("--recording", help="Present path of the recording, if it was moved."),
]
Horizon = Annotated[
    float | None,
    typer.Option("--horizon", metavar="SECONDS", help="Length of a rollout; default: as in the diagnosis."),
]


@export_app.callback()
def _export() -> None:
    pass


def _tell(made: Path, notes: Sequence[str], of: dict[str, Path], form: str = "", **more: Any) -> None:
    """What was written, of what, and what is in it; more: what else a program asks."""
    say(f"export: {made}")
    say_all(notes, "  ")
    answer(of | {"export": made}, **({"format": form} if form else {}), notes=notes, **more)


@export_app.command("recording")
def recording_command(
    path: Path = typer.Argument(
        ...,
        metavar="PATH",
        help="A recording folder, as made by `gpsim import`.",
        autocompletion=completion.recordings,
    ),
    out: Path = typer.Option(..., "--out", help="The file to make; it must not exist."),
    form: str = typer.Option(
        "mcap", "--format", help="mcap | csv | parquet", autocompletion=completion.formats
    ),
) -> None:
    """Measured channels beside the base simulator's prediction, for Foxglove, PlotJuggler or a spreadsheet."""
    # Imported here: rosbags and pandas take a second to load, and `--help` should not wait for it.
    from gpsim.stages.export import export_recording

    _tell(out, export_recording(path, form, out), {"recording": path}, form)


@export_app.command("diagnosis")
def diagnosis_command(
    folder: Diagnosed,
    mcap: bool = typer.Option(False, "--mcap", help="Write MCAP for Foxglove, the only format."),
    out: Path | None = typer.Option(
        None, "--out", help="The file to make, DIR.mcap by default; it must not exist."
    ),
    recording: Where = None,
    horizon: Horizon = None,
) -> None:
    """Measured, base and corrected motion on one clock, with the bodies drawn, for Foxglove."""
    if not mcap:
        raise UsageError("export diagnosis: name the format: --mcap, for Foxglove")
    from gpsim.stages.export import export_diagnosis

    made, notes = export_diagnosis(folder, out, recording, horizon)
    _tell(made, notes, {"diagnosis": folder}, "mcap")


@export_app.command("model")
def model_command(
    folder: Diagnosed,
    out: Path = typer.Option(
        ...,
        "--out",
        help="The new model, as robot_corrected.xml; wrapper, diff and patch.json go beside it.",
    ),
    urdf: bool = typer.Option(
        False, "--urdf", help="Also write URDF; the command lists what URDF cannot express."
    ),
) -> None:
    """The corrected MuJoCo model as MJCF, with a wrapper (only mujoco and numpy) for other effects."""
    from gpsim.stages.export import export_corrected_model, told

    made, notes = export_corrected_model(folder, out, urdf)
    _tell(out, notes, {"diagnosis": folder}, **told(made))


@export_app.command("policy")
def policy_command(
    path: Path = typer.Argument(
        ...,
        metavar="PATH",
        help="An artifact of train-source or train-gp-policy.",
        autocompletion=completion.policies,
    ),
    out: Path = typer.Option(..., "--out", help="The folder to make; it must not exist."),
    words: Words = None,
    monitor: bool = typer.Option(
        False,
        "--monitor",
        help="Add the monitor of a safe deployment to the node; settings select it: experiment=limo.",
    ),
    config_dir: ConfigDir = None,
) -> None:
    """A trained policy as ONNX and, for a vehicle with a goal, nodes for ROS 1 and ROS 2 that run it, or a plan."""
    from gpsim.stages.export import export_policy
    from gpsim.stages.stage import Request

    from .configuration import resolve

    if words and not monitor:
        raise UsageError(
            f"export policy: settings such as {words[0]} belong to --monitor; add it or remove them"
        )
    watched = Request(resolve(words or [], config_dir), shown_words(words, config_dir)) if monitor else None
    _tell(out, export_policy(path, out, watched), {"policy": path})


def view_command(
    folder: Diagnosed,
    out: Path | None = typer.Option(
        None, "--out", help="Save a new Rerun file (.rrd) instead of opening the viewer."
    ),
    recording: Where = None,
    horizon: Horizon = None,
) -> None:
    """View real, base and corrected motion side by side, with their numbers, in Rerun."""
    from gpsim.stages.export import export_diagnosis

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
                    "view: Rerun's viewer cannot open here; save with --out FILE.rrd and view elsewhere: rerun FILE.rrd"
                )
