"""A model's MjSpec, from which MJCF is written: of a file, an environment, or a function that returns one."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

from gpsim.errors import Terminated, UsageError
from gpsim.mjcf.loading import file_of_environment, made_by, spec_of_file
from gpsim.mjcf.optional import mujoco, quiet
from gpsim.trust import GYM

ASSETS = ("meshdir", "texturedir")


@quiet()
def spec_of(reference: str) -> Any:
    """A new MjSpec of a simulator's model, compiled once. Raises UsageError."""
    mj = mujoco()
    if not reference.startswith(GYM) and reference.rpartition(":")[0].endswith(".py"):
        made = made_by(reference)
        spec = made if isinstance(made, mj.MjSpec) else _saved(mj, made, reference)
    else:
        path = file_of_environment(reference) if reference.startswith(GYM) else Path(reference)
        spec = spec_of_file(path)
    spec.compile()
    return spec


def _saved(mj: Any, model: Any, reference: str) -> Any:
    """What MuJoCo remembers of the last XML that it read, which must be this model."""
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "model.xml")
        try:
            mj.mj_saveLastXML(path, model)
            spec = mj.MjSpec.from_file(path)
            same = spec.compile().nq == model.nq
        except Terminated:
            raise
        except Exception as error:
            raise UsageError(_no_spec(reference)) from error
    if not same:
        raise UsageError(_no_spec(reference))
    return spec


def _no_spec(reference: str) -> str:
    return (
        f"{reference}: returns a compiled model of which MuJoCo no longer knows the XML; let the function return the "
        "mujoco.MjSpec instead"
    )


def asset_places(spec: Any, folder: Path) -> dict[str, str]:
    """Where meshes and textures are looked for from `folder`: they stay where they are. Empty where there are none."""
    if not any(
        part.file for group in (spec.meshes, spec.textures, spec.hfields, spec.skins) for part in group
    ):
        return {}
    places = {name: Path(spec.modelfiledir or ".") / getattr(spec, name) for name in ASSETS}
    return {name: os.path.relpath(place.resolve(), folder) for name, place in places.items()}
