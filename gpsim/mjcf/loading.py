"""From a reference to a compiled model: robot.xml, robot.urdf, FILE.py:function, gym:ID. Every fault is one line."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from gpsim import supervision
from gpsim.errors import Terminated, UsageError
from gpsim.files import file_digest, unreadable
from gpsim.mjcf.compiled import check_model
from gpsim.mjcf.faults import compile_fault, one_line
from gpsim.mjcf.model_files import MODEL_FILES, files_of_model
from gpsim.mjcf.optional import mujoco, quiet
from gpsim.mjcf.urdf import apart, completed, is_urdf
from gpsim.simulators import asked
from gpsim.trust import GYM, check_file, check_module

FILMS = "imageio"
ENDLESS = 1000  # steps of an episode where an environment names none


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
    return file.endswith(".py") and Path(file).is_file() and _is_function(Path(file), name)


def load(reference: str) -> Loaded:
    """The model as its files are now; raises UsageError. What was loaded from the same files is not compiled again."""
    source = source_of(reference)
    return _loaded(reference, source.digest)


@lru_cache(maxsize=8)
@quiet()
def _loaded(reference: str, digest: str) -> Loaded:
    step: float | None = None
    notes: tuple[str, ...] = ()
    if reference.startswith(GYM):
        model, step = _of_environment(reference)
    elif ":" in reference and reference.rpartition(":")[0].endswith(".py"):
        model = _of_function(reference)
    else:
        spec, notes = _opened(Path(reference))
        model = _compiled(spec, Path(reference))
    check_model(model, reference)
    return Loaded(model, source_of(reference), step, notes)


def notes_of(reference: str) -> tuple[str, ...]:
    """What of a simulator's model is not as its file says, a line each; none of one that is no MuJoCo model."""
    return load(reference).notes if is_mujoco(reference) else ()


def source_of(reference: str) -> Source:
    """The files that a model is made of; raises UsageError where the first of them is not there."""
    if reference.startswith(GYM):
        path = Path(str(getattr(_environment(reference), "fullpath", "")))
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
    return {_relative(p, base): file_digest(p) for p in sorted(files_of_model(path))}


def _relative(path: Path, base: Path) -> str:
    return Path(os.path.relpath(path, base)).as_posix()


def spec_of_file(path: Path) -> Any:
    """The MjSpec of robot.xml or robot.urdf; raises UsageError."""
    return _opened(path)[0]


def _opened(path: Path) -> tuple[Any, tuple[str, ...]]:
    """The MjSpec of a file, and what of a URDF is not as it says."""
    mj = mujoco()
    try:
        spec = mj.MjSpec.from_file(str(path))
        if not is_urdf(path):
            return spec, ()
        notes = completed(spec, path)
        return spec, (*notes, *apart(spec, spec.compile()))
    except Terminated:
        raise
    except Exception as error:  # parser and compiler raise what they like
        raise compile_fault(path, error) from error


def _compiled(spec: Any, path: Path) -> Any:
    try:
        return spec.compile()
    except Terminated:
        raise
    except Exception as error:  # as above
        raise compile_fault(path, error) from error


def file_of_environment(reference: str) -> Path:
    """The model file of gym:ID."""
    return Path(str(getattr(_environment(reference), "fullpath", "")))


def _of_function(reference: str) -> Any:
    mj, name = mujoco(), reference.rpartition(":")[2]
    model = made_by(reference)
    if isinstance(model, mj.MjSpec):
        try:
            return model.compile()
        except Terminated:
            raise
        except Exception as error:  # as above
            raise UsageError(f"{reference}: {name}() does not compile: {one_line(error)}") from error
    if not isinstance(model, mj.MjModel):
        raise UsageError(
            f"{reference}: {name}() returned {type(model).__name__}; it must return a mujoco.MjModel"
        )
    return model


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


def _of_environment(reference: str) -> tuple[Any, float]:
    found = _environment(reference)
    mj = mujoco()
    if not isinstance(getattr(found, "model", None), mj.MjModel):
        raise UsageError(
            f"--simulator {reference}: {type(found).__name__} is not built on MuJoCo; bring its robot as robot.xml or "
            "robot.urdf, or its equations as FILE.py:ClassName"
        )
    return found.model, float(found.dt)


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
        with _without_pictures():
            found = gymnasium.make(reference.removeprefix(GYM))
            return found.unwrapped, int(getattr(found.spec, "max_episode_steps", None) or ENDLESS)

    supervision.calls(reference)
    return asked(made, "gymnasium", f"--simulator {reference}", failed="cannot make it:")


@contextmanager
def _without_pictures() -> Iterator[None]:
    """Within it Gymnasium's MuJoCo environments are imported without the package that writes their films."""
    if importlib.util.find_spec(FILMS) is not None:
        yield
        return
    sys.modules[FILMS] = ModuleType(FILMS)
    try:
        yield
    finally:
        del sys.modules[FILMS]


def _is_function(path: Path, name: str) -> bool:
    """Whether a Python file defines `name` as a function, at its top level: a class is a system of equations."""
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    except (OSError, SyntaxError, UnicodeDecodeError, ValueError):
        return False
    return any(isinstance(node, ast.FunctionDef) and node.name == name for node in tree.body)
