"""Tracking of trainings: event files beside the artifacts, never in them, and none unless asked for.

An artifact is made of its recipe alone, byte for byte; event files hold wall-clock times. So they lie in a folder of
their own, and `track` is part of no recipe.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from gpsim.artifacts import Recipe
from gpsim.errors import UsageError
from gpsim.files import disk_errors
from gpsim.settings import choice
from gpsim.stages.stage import Request

TRACKERS = ("tensorboard",)
FOLDER = "tracking"


def check(request: Request) -> bool:
    """Whether trainings are tracked; raises UsageError where that is asked for and cannot be."""
    asked = request.config["track"]
    if asked is None:
        return False
    choice(asked, TRACKERS, "track")
    if find_spec("tensorboard") is None:
        raise UsageError("track=tensorboard: TensorBoard is not installed; pip install 'gpsim[tensorboard]'")
    return True


def events_of(request: Request, recipe: Recipe, purpose: str) -> Path | None:
    """An empty folder for the event files of one training, or None; those of an earlier try at it are removed.

    It is named by the recipe: <runs_dir>/<experiment>/tracking/train-source-source-seed0-1f0c9ab2.
    """
    if not check(request):
        return None
    name = f"{purpose.replace('/', '-')}-seed{request.seed}-{recipe.key[:8]}"
    folder = request.store.root / request.store.experiment / FOLDER / name
    with disk_errors(folder):
        for earlier in folder.rglob("events.out.tfevents.*"):
            earlier.unlink()
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def remarks(request: Request) -> list[str]:
    """Where event files lie and how they are looked at."""
    if not check(request):
        return []
    place = request.store.root / request.store.experiment / FOLDER
    return [f"event files of what was trained: tensorboard --logdir {place}"]
