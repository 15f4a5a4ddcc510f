"""From a reference to a compiled model: robot.xml, robot.urdf, FILE.py:function, gym:ID. Every fault is one line."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import os
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from gpsim import supervision
from gpsim.errors import Terminated, UsageError
from gpsim.files import file_digest, unreadable
from gpsim.limits import MODEL_BODIES, MODEL_JOINTS, allowed, more
from gpsim.mjcf.model_files import MODEL_FILES, compile_fault, files_of_model, one_line
from gpsim.mjcf.optional import mujoco, quiet
from gpsim.mjcf.urdf import apart, completed
from gpsim.simulators import asked
from gpsim.trust import GYM, check_file, check_module

FILMS = "imageio"
ENDLESS = 1000  # steps of an episode where an environment names none
ASSETS = ("meshdir", "texturedir")
SHORTEST, LONGEST = 1e-6, 1.0  # s, the steps of models
FINITE = ("qpos0", "body_", "jnt_", "dof_", "actuator_", "geom_")
"""Fields of a model, or how their names begin, in which every number is finite."""


@dataclass(frozen=True)
class Source:
    """Where a model comes from: reference, files (name -> sha256), and the control step it was made for, if it says."""

    reference: str
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """One hash of all files and their names."""
        said = "\n".join(f"{name} {value}" for name, value in sorted(self.files.items()))
        return hashlib.sha256(said.encode()).hexdigest()


@dataclass(frozen=True)
class Loaded:
    """A compiled model and its source; control_step: s, of the environment that it came from, None of a file.

    notes: what of it is not as its file says, a line each.
    """

    model: Any
    source: Source
    control_step: float | None = None
    notes: tuple[str, ...] = ()


def is_mujoco(reference: str) -> bool:
    """Whether a simulator's name means a MuJoCo model: by its ending, `gym:`, or a function in a Python file."""
    if reference.startswith(GYM) or reference.lower().endswith(MODEL_FILES):
        return True
    file, _, name = reference.rpartition(":")
    if not (file.endswith(".py") and Path(file).is_file()):
        return False
    try:
        tree = ast.parse(Path(file).read_text(encoding="utf-8"))
    except (OSError, SyntaxError, UnicodeDecodeError, ValueError):
        return False
    # A class at its top level is a system of equations.
    return any(isinstance(node, ast.FunctionDef) and node.name == name for node in tree.body)


def load(reference: str) -> Loaded:
    """The model as its files are now; raises UsageError. What was loaded from the same files is not compiled again."""
    return _loaded(reference, source_of(reference).digest)


@lru_cache(maxsize=8)
@quiet()
def _loaded(reference: str, digest: str) -> Loaded:
    step: float | None = None
    notes: tuple[str, ...] = ()
    if reference.startswith(GYM):
        found = _environment(reference)
        if not isinstance(getattr(found, "model", None), mujoco().MjModel):
            raise UsageError(
                f"--simulator {reference}: {type(found).__name__} is not based on MuJoCo; give its robot as robot.xml "
                "or robot.urdf, or its equations as FILE.py:ClassName"
            )
        model, step = found.model, float(found.dt)
    elif ":" in reference and reference.rpartition(":")[0].endswith(".py"):
        model, name = made_by(reference), reference.rpartition(":")[2]
        try:
            model = model.compile() if isinstance(model, mujoco().MjSpec) else model
        except Terminated:
            raise
        except Exception as error:  # the compiler raises what it likes
            raise UsageError(f"{reference}: {name}() does not compile: {one_line(error)}") from error
        if not isinstance(model, mujoco().MjModel):
            raise UsageError(
                f"{reference}: {name}() returned {type(model).__name__}; it must return a mujoco.MjModel"
            )
    else:
        model, notes = _of_file(Path(reference), compiling=True)
    _check_model(model, reference)
    return Loaded(model, source_of(reference), step, notes)


def notes_of(reference: str) -> tuple[str, ...]:
    """What of a simulator's model is not as its file says, a line each; none of one that is no MuJoCo model."""
    return load(reference).notes if is_mujoco(reference) else ()


def source_of(reference: str) -> Source:
    """The files that a model is made of; raises UsageError where the first of them is not there."""
    if reference.startswith(GYM):
        path = _file_of_environment(reference)
        return Source(reference, _digests(path) if path.is_file() else {})
    file = reference.rpartition(":")[0]
    path = Path(file if file.endswith(".py") else reference)
    if not path.is_file():
        raise UsageError(
            f"--simulator {reference}: no file {path}; give robot.xml, robot.urdf, FILE.py:function or gym:ID"
        )
    return Source(reference, {path.name: file_digest(path)} if path.suffix == ".py" else _digests(path))


def _digests(path: Path) -> dict[str, str]:
    """Of a model's file and all that it names, as far as they are there; raises UsageError, see `files_of_model`."""
    base = path.resolve().parent
    return {Path(os.path.relpath(p, base)).as_posix(): file_digest(p) for p in sorted(files_of_model(path))}


def _of_file(path: Path, *, compiling: bool) -> tuple[Any, tuple[str, ...]]:
    """The MjSpec of robot.xml or robot.urdf, or its model, and what of a URDF is not as it says; raises UsageError."""
    notes: tuple[str, ...] = ()
    try:
        spec = mujoco().MjSpec.from_file(str(path))
        if path.suffix.lower() == ".urdf":
            notes = tuple(completed(spec, path))
            notes = (*notes, *apart(spec, spec.compile()))
        return spec.compile() if compiling else spec, notes
    except Terminated:
        raise
    except Exception as error:  # parser and compiler raise what they like
        raise compile_fault(path, error) from error


def made_by(reference: str) -> Any:
    """What the function of FILE.py:function returns; raises UsageError."""
    file, _, name = reference.rpartition(":")
    try:
        content = Path(file).read_bytes()
    except OSError as error:
        raise unreadable(Path(file), error) from error
    check_file(reference, content)
    module = ModuleType(f"user_model_{Path(file).stem}")
    module.__file__ = str(Path(file).resolve())
    sys.modules[module.__name__] = module  # dataclasses look there

    def made() -> Any:
        exec(compile(content, file, "exec"), vars(module))
        return getattr(module, name)()

    supervision.calls(file)
    return asked(made, f"{name}()", reference)


def _file_of_environment(reference: str) -> Path:
    return Path(str(getattr(_environment(reference), "fullpath", "")))


@lru_cache(maxsize=4)
def _environment(reference: str) -> Any:
    return new_environment(reference)[0]


def new_environment(reference: str) -> tuple[Any, int]:
    """A new environment gym:ID without its wrappers, and the steps of its episodes; raises UsageError.

    Gymnasium imports the module of gym:MODULE:ID, which may run whatever it likes.
    """
    mujoco()
    check_module(reference)
    import gymnasium

    def made() -> tuple[Any, int]:
        # Its MuJoCo environments are imported without the package that writes their films, where that is not there.
        lacking = importlib.util.find_spec(FILMS) is None
        if lacking:
            sys.modules[FILMS] = ModuleType(FILMS)
        try:
            found = gymnasium.make(reference.removeprefix(GYM))
            return found.unwrapped, int(getattr(found.spec, "max_episode_steps", None) or ENDLESS)
        finally:
            if lacking:
                del sys.modules[FILMS]

    supervision.calls(reference)
    return asked(made, "gymnasium", f"--simulator {reference}", failed="cannot make it:")


@quiet()
def spec_of(reference: str) -> Any:
    """A new MjSpec of a simulator's model, compiled once. Raises UsageError."""
    mj = mujoco()
    if not reference.startswith(GYM) and reference.rpartition(":")[0].endswith(".py"):
        made = made_by(reference)
        spec = made if isinstance(made, mj.MjSpec) else _saved(mj, made, reference)
    else:
        path = _file_of_environment(reference) if reference.startswith(GYM) else Path(reference)
        spec, _ = _of_file(path, compiling=False)
    spec.compile()
    return spec


def _saved(mj: Any, model: Any, reference: str) -> Any:
    """What MuJoCo remembers of the last XML that it read, which must be this model."""
    fault = UsageError(
        f"{reference}: returns a compiled model without its XML; return the mujoco.MjSpec instead"
    )
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "model.xml")
        try:
            mj.mj_saveLastXML(path, model)
            spec = mj.MjSpec.from_file(path)
            same = spec.compile().nq == model.nq
        except Terminated:
            raise
        except Exception as error:
            raise fault from error
    if not same:
        raise fault
    return spec


def asset_places(spec: Any, folder: Path) -> dict[str, str]:
    """Where meshes and textures are looked for from `folder`: they stay where they are. Empty where there are none."""
    groups = (spec.meshes, spec.textures, spec.hfields, spec.skins)
    if not any(part.file for group in groups for part in group):
        return {}
    places = {name: Path(spec.modelfiledir or ".") / getattr(spec, name) for name in ASSETS}
    return {name: os.path.relpath(place.resolve(), folder) for name, place in places.items()}


def _check_model(model: Any, where: str) -> None:
    """Raises UsageError for a model that no simulation can be made of. where: what the message calls it."""
    step = float(model.opt.timestep)
    if not SHORTEST <= step <= LONGEST:
        raise UsageError(
            f"{where}: its timestep is {step:g} s, gpsim takes steps of {SHORTEST:g} to {LONGEST:g} s; "
            "mend timestep in <option>"
        )
    for what, found, limit in (
        ("bodies", int(model.nbody), MODEL_BODIES),
        ("degrees of freedom", int(model.nv), MODEL_JOINTS),
    ):
        if found > allowed(limit):
            raise UsageError(
                f"{where}: it has {found} {what}, the limit is {allowed(limit)}; {more(found, limit)}"
            )
    try:  # MuJoCo takes any bytes for a name, and Python cannot ask for one that is no text
        bytes(model.names).decode()
    except UnicodeDecodeError as error:
        raise UsageError(
            f"{where}: a name in it is not valid UTF-8; save the model's files as UTF-8"
        ) from error
    fields = {name: getattr(model, name) for name in dir(model) if name.startswith(FINITE)}
    for name, values in (fields | {"gravity": model.opt.gravity}).items():
        if isinstance(values, np.ndarray) and values.dtype.kind == "f" and np.isnan(values).any():
            row = int(np.argwhere(np.isnan(values))[0][0])
            raise UsageError(f"{where}: {name} of number {row} is not a number (nan); fix it in the model")
    try:  # MuJoCo ends a simulation, not only a step, where its memory is too small for what touches
        mujoco().mj_forward(model, mujoco().MjData(model))
    except Terminated:
        raise
    except Exception as error:
        raise UsageError(f"{where}: MuJoCo cannot simulate it: {one_line(error)}") from error
