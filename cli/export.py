"""What gpsim made, for other programs: `gpsim export` writes their files, `gpsim view` opens Rerun's viewer."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from gpsim.errors import UsageError

from . import completion
from .answers import answer, say, say_all
from .options import ConfigDir, Words, shown_words

export_app = typer.Typer(
    help="Write a recording, a diagnosis or a policy in the formats of other programs.", no_args_is_help=True
)

Recorded = Annotated[
    Path,
    typer.Argument(
        metavar="PATH",
        help="A recording folder, as made by `gpsim import`.",
        autocompletion=completion.recordings,
    ),
]
Format = Annotated[
    str, typer.Option("--format", help="mcap | csv | parquet", autocompletion=completion.formats)
]
Out = Annotated[Path, typer.Option("--out", help="The file to make; it must not exist.")]


@export_app.callback()
def _export() -> None:
    pass


@export_app.command("recording")
def recording_command(path: Recorded, out: Out, form: Format = "mcap") -> None:
    """Measured channels beside the base simulator's prediction, for Foxglove, PlotJuggler or a spreadsheet."""
    # Imported here: rosbags and pandas take a second to load, and `--help` should not wait for it.
    from gpsim.stages.export import export_recording

    notes = export_recording(path, form, out)
    say(f"export: {out}")
    say_all(notes, "  ")
    answer({"recording": path, "export": out}, format=form, notes=notes)


Diagnosed = Annotated[
    Path, typer.Argument(metavar="DIR", help="A finished diagnosis, as runs/a/diagnose/v0001.")
]
Mcap = Annotated[bool, typer.Option("--mcap", help="Write MCAP for Foxglove, the only format.")]
OutFile = Annotated[
    Path | None, typer.Option("--out", help="The file to make, DIR.mcap by default; it must not exist.")
]
Where = Annotated[
    Path | None,
    typer.Option("--recording", help="Present path of the recording, if it was moved."),
]
Horizon = Annotated[
    float | None,
    typer.Option("--horizon", metavar="SECONDS", help="Length of a rollout; default: as in the diagnosis."),
]


@export_app.command("diagnosis")
def diagnosis_command(
    folder: Diagnosed,
    mcap: Mcap = False,
    out: OutFile = None,
    recording: Where = None,
    horizon: Horizon = None,
) -> None:
    """Measured, base and corrected motion on one clock, with the bodies drawn, for Foxglove."""
    if not mcap:
        raise UsageError("export diagnosis: name the format: --mcap, for Foxglove")
    from gpsim.stages.export_diagnosis import export_diagnosis

    made, notes = export_diagnosis(folder, out, recording, horizon)
    say(f"export: {made}")
    say_all(notes, "  ")
    answer({"diagnosis": folder, "export": made}, format="mcap", notes=notes)


OutModel = Annotated[
    Path,
    typer.Option(
        "--out", help="The new model, as robot_corrected.xml; wrapper, diff and patch.json go beside it."
    ),
]


AsUrdf = Annotated[
    bool, typer.Option("--urdf", help="Also write URDF; the command lists what URDF cannot express.")
]


@export_app.command("model")
def model_command(folder: Diagnosed, out: OutModel, urdf: AsUrdf = False) -> None:
    """The corrected MuJoCo model as MJCF, with a wrapper (only mujoco and numpy) for other effects."""
    from gpsim.stages.export import export_corrected_model, told

    made, notes = export_corrected_model(folder, out, urdf)
    say(f"export: {out}")
    say_all(notes, "  ")
    answer({"diagnosis": folder, "export": out}, notes=notes, **told(made))


Policy = Annotated[
    Path,
    typer.Argument(
        metavar="PATH",
        help="An artifact of train-source or train-gp-policy.",
        autocompletion=completion.policies,
    ),
]
OutFolder = Annotated[Path, typer.Option("--out", help="The folder to make; it must not exist.")]


WithMonitor = Annotated[
    bool,
    typer.Option(
        "--monitor",
        help="Add the monitor of a safe deployment to the node; settings select it: experiment=limo.",
    ),
]


@export_app.command("policy")
def policy_command(
    path: Policy,
    out: OutFolder,
    words: Words = None,
    monitor: WithMonitor = False,
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
    notes = export_policy(path, out, watched)
    say(f"export: {out}")
    say_all(notes, "  ")
    answer({"policy": path, "export": out}, notes=notes)


OutMotion = Annotated[
    Path | None,
    typer.Option("--out", help="Save a new Rerun file (.rrd) instead of opening the viewer."),
]


def view_command(
    folder: Diagnosed, out: OutMotion = None, recording: Where = None, horizon: Horizon = None
) -> None:
    """View real, base and corrected motion side by side, with their numbers, in Rerun."""
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
                    "view: Rerun's viewer cannot open here; save with --out FILE.rrd and view elsewhere: rerun FILE.rrd"
                )
