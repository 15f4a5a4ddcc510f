"""Families that a user brings: from a file (FILE.py, FILE.py:Class), a class of the program, or an installed package.

They stand in the registry beside the catalogue's, here and in worker processes, and are asked where somebody says so.
A package names its own in the entry point group `gpsim.effects`.
"""

from __future__ import annotations

import copyreg
import hashlib
import inspect
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from gpsim.effects.effect import Effect
from gpsim.effects.plain import adapted
from gpsim.effects.registry import CATALOGUE, FAMILIES, effect_of
from gpsim.errors import UsageError
from gpsim.simulators import asked, module_of, said
from gpsim.trust import check_file, consent

GROUP = "gpsim.effects"
HERE = "()"
"""The end of the name of a class that this program alone knows."""


@dataclass(frozen=True)
class Brought:
    """One family: what names it, the text of its file ("" where none has it), and the effect."""

    reference: str
    source: str
    effect: Effect

    @property
    def digest(self) -> str:
        """sha256 of the file's text."""
        return hashlib.sha256(self.source.encode()).hexdigest()

    @property
    def from_file(self) -> bool:
        """Whether a file has it, so that another process can load it."""
        return bool(self.source)


_standing: dict[str, Brought] = {}


def standing() -> tuple[Brought, ...]:
    """What stands in the registry beside the catalogue."""
    return tuple(_standing.values())


def brought_of(family: str) -> Brought | None:
    """Where a family is from, if it was brought."""
    return _standing.get(family)


def bring(given: Iterable[Brought]) -> tuple[str, ...]:
    """From now on this process knows these families; their names, for whoever asks for them (`Known.also`).

    One that was brought before under the same name gives way. Raises UsageError where the catalogue has the name.
    """
    names = []
    for one in given:
        family = one.effect.family
        if family in CATALOGUE:
            raise UsageError(
                f"{one.reference}: the catalogue has a family '{family}': call yours otherwise (`family = ...`)"
            )
        if family in names:
            raise UsageError(f"{one.reference}: two effects have the family '{family}': call one otherwise")
        names.append(family)
        _standing[family] = one
        FAMILIES[family] = one.effect
    return tuple(names)


def stand(given: Sequence[tuple[str, str]]) -> None:
    """In a worker: load what its parent has, from the text that the parent read."""
    for reference, source in given:
        bring(load_text(reference, source))


def sources() -> tuple[tuple[str, str], ...]:
    """What a worker is given."""
    return tuple((one.reference, one.source) for one in standing() if one.from_file)


def read_effects(reference: str) -> tuple[Brought, ...]:
    """All families of FILE.py, or the one of FILE.py:Class; raises UsageError for every fault of the file.

    And where it is not trusted (`gpsim.trust`).
    """
    path = Path(reference.rpartition(":")[0] if ".py:" in reference else reference)
    if path.suffix != ".py" or not path.is_file():
        raise UsageError(f"{reference}: no such file of effects; give FILE.py or FILE.py:ClassName")
    try:
        content = path.read_bytes()
        source = content.decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: cannot be read: {said(error)}") from error
    check_file(_named(reference), content, "--effects")
    return load_text(reference, source)


def consent_to(reference: str) -> None:
    """The user names this file of effects: it may run."""
    consent(_named(reference))


def _named(reference: str) -> str:
    return reference if ".py:" in reference else f"{reference}:"


@lru_cache(maxsize=32)
def load_text(reference: str, source: str) -> tuple[Brought, ...]:
    """The families of a file whose text is `source`: what changes meanwhile changes nothing that is under way."""
    file, _, name = reference.rpartition(":") if ".py:" in reference else (reference, "", "")
    module = module_of(Path(file), source, "effects")
    classes = {
        k: v
        for k, v in vars(module).items()
        if isinstance(v, type)
        and v.__module__ == module.__name__
        and not k.startswith("_")
        and hasattr(v, "site")
    }
    if name and name not in classes:
        raise UsageError(f"{file}: no effect '{name}'; it has: {', '.join(classes) or 'none with a `site`'}")
    chosen = {name: classes[name]} if name else classes
    if not chosen:
        raise UsageError(f"{file}: no effect in it: a class with a `site`, `parameters` and a `law`")
    return tuple(Brought(f"{file}:{k}", source, _made(v, f"{file}:{k}")) for k, v in chosen.items())


def _made(found: Any, reference: str) -> Effect:
    """One of a user's class."""
    instance = asked(
        found, f"{reference.rpartition(':')[2]}()", reference, remedy="; it must be made without arguments"
    )
    return asked(lambda: _adapted(instance, reference), "its declaration", reference)


def own_effect(given: Any) -> Brought:
    """A class or an object of the program that runs."""
    name = given.__name__ if inspect.isclass(given) else type(given).__name__
    reference = f"{name}{HERE}"
    instance = asked(given, f"{name}()", reference) if inspect.isclass(given) else given
    return Brought(reference, "", _adapted(instance, reference))


def _adapted(instance: Any, reference: str) -> Effect:
    """The object as an effect. Another process knows it by its family: no module of its own has its class."""
    found = adapted(instance, reference)
    copyreg.pickle(type(found), lambda effect: (effect_of, (effect.family,)))
    return found


def installed() -> tuple[Brought, ...]:
    """What installed packages name in the group `gpsim.effects`; one that fails is a UsageError that names it."""
    out = []
    for point in entry_points(group=GROUP):
        found = asked(point.load, "its import", f"{GROUP} entry point {point.name}", failed="raised")
        out.append(Brought(f"{point.value}", "", own_effect(found).effect))
    return tuple(out)


def origins(families: Iterable[str]) -> dict[str, Mapping[str, str]]:
    """Of brought families what it takes to load them again: where from, and the digest of that file."""
    found = {family: brought_of(family) for family in families}
    return {
        family: {"reference": one.reference, "sha256": one.digest if one.from_file else ""}
        for family, one in found.items()
        if one is not None
    }


def again(origins: Mapping[str, Mapping[str, str]], where: str) -> tuple[Brought, ...]:
    """Such families loaded again; raises UsageError where one has changed, is gone, or lives in a program alone."""
    out: list[Brought] = []
    packages = {one.reference: one for one in installed()} if origins else {}
    for family, told in origins.items():
        reference, digest = str(told["reference"]), str(told["sha256"])
        if family in _standing and not digest and _standing[family].reference == reference:
            continue  # the program that has it is this one
        if not digest:
            if reference not in packages:
                raise UsageError(
                    f"{where}: the effect '{family}' is from {reference}, which is not here: install that package, or "
                    "open it in the program that has it"
                )
            out.append(packages[reference])
            continue
        (one,) = read_effects(reference)
        if one.digest != digest:
            raise UsageError(
                f"{where}: the effect '{family}' is from {reference} as that file was then, and it has changed since: "
                "diagnose the recording again, or bring that file back"
            )
        out.append(one)
    return tuple(out)
