"""Whose code runs: what the user names does, what only data name (a recording, a mapping, a diagnosis) does not.

A simulator may be a Python file (`FILE.py:NAME`) or a module (`gym:MODULE:ID`). Whoever is about to run one asks
`check_file` or `check_module`, which refuse it unless the user has named it (`consent`) or trusts what data name
(`trusting`). What was allowed once is remembered by its SHA-256, in a file of the user's own: changed contents are
refused again. MuJoCo models and Gymnasium's registered environments run no code of their file's, and need nothing.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from gpsim.errors import UsageError
from gpsim.private import ExposedError, own_folder, read_own, write_own

GYM = "gym:"
FILE, SCHEMA = "trusted.json", "gpsim.trusted/1"
allowed: set[str] = set()
_everything: ContextVar[bool] = ContextVar("trust", default=False)


@dataclass(frozen=True)
class Lent:
    """What this process may run, for a process that works for it."""

    digests: frozenset[str]
    everything: bool


def lent() -> Lent:
    """What a worker is given."""
    return Lent(frozenset(allowed), _everything.get())


def take(given: Lent) -> None:
    """In a worker: what the process that it works for may run."""
    allowed.update(given.digests)
    _everything.set(given.everything)


@contextmanager
def trusting(everything: bool = True) -> Iterator[None]:
    """Within it what data name is allowed, and remembered; without `everything` nothing changes."""
    before = _everything.set(everything or _everything.get())
    try:
        yield
    finally:
        _everything.reset(before)


def trust_data() -> None:
    """From now on, or until the end of the block `trusting`, what data name is allowed, and remembered."""
    _everything.set(True)


def consent(reference: object) -> None:
    """The user names this simulator or task: what it runs is allowed, and remembered. Of any other name nothing."""
    if not isinstance(reference, str):
        return
    if (module := module_of(reference)) is not None:
        _allow(_module_digest(module), f"module {module}")
    file = Path(reference.rpartition(":")[0])
    if file.suffix == ".py":
        with suppress(OSError):  # whoever loads it says what is wrong
            _allow(hashlib.sha256(file.read_bytes()).hexdigest(), str(file.absolute()))


def check_file(reference: str, content: bytes, option: str = "--simulator") -> None:
    """Raise UsageError unless the file of FILE.py:NAME, which holds `content`, may run.

    option: under which a command line names it.
    """
    file, digest = reference.rpartition(":")[0], hashlib.sha256(content).hexdigest()
    _check(digest, reference, f"the file {file}", str(Path(file).absolute()), option)


def check_module(reference: str) -> None:
    """Raise UsageError unless the module that gym:MODULE:ID imports may run; gym:ID imports none."""
    module = module_of(reference)
    if module is not None:
        _check(_module_digest(module), reference, f"the module {module}", f"module {module}")


def module_of(reference: str) -> str | None:
    """The module that Gymnasium imports to make gym:MODULE:ID; None of any other name."""
    name = reference.removeprefix(GYM)
    return name.partition(":")[0] if reference.startswith(GYM) and ":" in name else None


def _check(digest: str, reference: str, what: str, kept: str, option: str = "--simulator") -> None:
    if digest in allowed:
        return
    known, why = _remembered()
    if _everything.get():
        _allow(digest, kept)
    elif digest not in known:
        named = reference.removesuffix(":")  # a file without a class in it
        raise UsageError(
            f"{named}: not run: {what} would run with your rights, and only data name this version; read it, then "
            f"allow it: --trust (in Python trust=True), or {option} {named}{why}"
        )
    allowed.add(digest)


def _allow(digest: str, what: str) -> None:
    """Allow it here, and remember it where that is possible."""
    if digest in allowed:
        return
    allowed.add(digest)
    with suppress(OSError, ExposedError, RuntimeError), _locked() as path:
        known, _ = _read(path)
        if digest not in known:
            content = {"schema": SCHEMA, "trusted": {**known, digest: what}}
            write_own(path, (json.dumps(content, indent=2) + "\n").encode())


@contextmanager
def _locked() -> Iterator[Path]:
    """The file of what is trusted, which no other process writes meanwhile."""
    folder = own_folder(_folder())
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield folder / FILE
    finally:
        os.close(handle)


def _folder() -> Path:
    """Of the user's settings of gpsim."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "gpsim"


def _remembered() -> tuple[dict[str, str], str]:
    """Digest -> what it was, of what was allowed before; and words to add where that cannot be believed."""
    try:
        folder = _folder()
        return _read(own_folder(folder) / FILE) if folder.is_dir() else ({}, "")
    except (OSError, ExposedError, RuntimeError) as error:
        return {}, f" (earlier permissions cannot be read: {error})"


def _read(path: Path) -> tuple[dict[str, str], str]:
    try:
        content: Any = json.loads(read_own(path))
        known = {str(digest): str(what) for digest, what in content["trusted"].items()}
    except FileNotFoundError:
        return {}, ""
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        return {}, f" (earlier permissions cannot be read: {path}: {error})"
    return known, ""


def _module_digest(name: str) -> str:
    """sha256 of a module's name and of the files that its import runs first: its own, and its packages'."""
    digest, parts = hashlib.sha256(f"module {name}\n".encode()), name.split(".")
    spec = _found(parts[0])
    for last in range(1, len(parts) + 1):
        if spec is None:
            break
        if spec.has_location and spec.origin:
            with suppress(OSError):
                digest.update(Path(spec.origin).read_bytes())
        below = spec.submodule_search_locations
        whole = ".".join(parts[: last + 1])
        spec = None if below is None or last == len(parts) else PathFinder.find_spec(whole, list(below))
    return digest.hexdigest()


def _found(name: str) -> ModuleSpec | None:
    """Where a module that is in no package lies; nothing is imported for it."""
    try:
        return find_spec(name)
    except (ImportError, ValueError):
        return None
