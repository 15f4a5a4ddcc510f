"""Families that a user brings: from a file (FILE.py, FILE.py:Class), a class of the program, or an installed package.

They stand in the registry beside the catalogue's, here and in worker processes, and are asked where somebody says so.
A package names its own in the entry point group `gpsim.effects`. Such a class is a few lines, checked once at the door,
and made a family like any other:

    class Cable:
        '''A dragged cable: it pulls back by its weight for every metre that is paid out.'''

        site = "force"
        parameters = {"weight": ("N/m", 0.0, 50.0, 1.0)}         # unit, low, high, where a fit starts

        def law(self, q, speed, weight):                         # (B,) arrays: one entry a row of the batch
            return -weight * q

Sites and what their law takes before the parameters: see `INPUTS`. Optional: `nothing = {"gain": 1.0}` is the value at
which it does nothing (0 unless said, inf of a limit); `on = ("q",)` names the only places; `memory = ("level",)` gives
an actuator's law arrays that begin at 0 and belong to each run, as `law(self, u, ..., memory, step)`; `of = "speed"`
says what the law is a function of, so that a free curve is held against it; `noun`, `sentence`, `source` are words.
A class that derives from one of `gpsim.effects` is taken as it is.
"""

from __future__ import annotations

import copyreg
import hashlib
import inspect
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import (
    ActuatorEffect,
    DriveEffect,
    Effect,
    ForceEffect,
    FunctionOf,
    ParameterEffect,
    SensorEffect,
    Values,
    VehicleEffect,
)
from gpsim.effects.place import EffectParameter, Place
from gpsim.effects.registry import CATALOGUE, FAMILIES, effect_of
from gpsim.errors import UsageError
from gpsim.simulators import Simulator, asked, module_of, read_only, refuse_complex, said
from gpsim.trust import check_file, consent

GROUP = "gpsim.effects"
HERE = "()"
"""The end of the name of a class that this program alone knows."""
Site = Literal["force", "friction", "actuator", "drive", "parameter", "vehicle", "sensor"]
INPUTS: Mapping[str, tuple[str, ...]] = {
    "force": ("q", "speed"),
    "friction": ("q", "speed"),
    "actuator": ("u",),
    "drive": ("u", "speed"),
    "parameter": ("believed",),
    "vehicle": ("v", "lateral", "w"),
    "sensor": ("y",),
}
"""Site -> what its law takes first: a coordinate's position and speed; a command, at a drive the speed of what it
drives, too; a parameter as it is believed; a vehicle's speed, sideways speed and turn rate; what a sensor reads."""
RETURNS: Mapping[str, str] = {
    "force": "the force on the coordinate",
    "friction": "the largest dry friction force, at least 0",
    "actuator": "what the simulator gets",
    "drive": "what the drive gives",
    "parameter": "the parameter's value",
    "vehicle": "v, lateral and w, three arrays",
    "sensor": "what is read",
}
BASES: Mapping[str, Any] = {
    "force": ForceEffect,
    "friction": ForceEffect,
    "actuator": ActuatorEffect,
    "drive": DriveEffect,
    "parameter": ParameterEffect,
    "vehicle": VehicleEffect,
    "sensor": SensorEffect,
}
STEPS = 0.05  # of a parameter's start: its typical size where that is 0 is this of its bounds
FORM = 'name: (unit, low, high, start), as {"weight": ("N/m", 0.0, 50.0, 1.0)}'


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
                f"{one.reference}: the catalogue already has a family '{family}': rename yours (`family = ...`)"
            )
        if family in names:
            raise UsageError(f"{one.reference}: two effects have the family '{family}': rename one")
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
                    f"{where}: the effect '{family}' is from {reference}, which is not installed: install that "
                    "package, or open the diagnosis in the program that has it"
                )
            out.append(packages[reference])
            continue
        (one,) = read_effects(reference)
        if one.digest != digest:
            raise UsageError(
                f"{where}: the effect '{family}' is from an earlier version of {reference}: diagnose the recording "
                "again, or restore that file"
            )
        out.append(one)
    return tuple(out)


def adapted(instance: Any, reference: str) -> Effect:
    """A user's object as an effect; raises UsageError in one line that names what is at fault."""
    if isinstance(instance, Effect):
        for name in ("family", "function_of"):
            if not isinstance(getattr(instance, name, None), str):
                raise UsageError(f"{reference}: '{name}' is missing, which a family of gpsim.effects needs")
        vars(instance)["asked"] = False  # nobody asks for it but who brought it
        return instance
    said = getattr(instance, "site", None)
    site: Site | None = next((one for one in get_args(Site) if one == said), None)
    if site is None:
        raise UsageError(f"{reference}: 'site' must be one of {', '.join(INPUTS)}, got {said!r}")
    on, declared = getattr(instance, "on", ()), _parameters(instance, reference)
    _check_law(instance, site, reference)
    made: dict[str, Any] = {
        "__doc__": inspect.getdoc(instance) or "",
        "family": _family(instance, reference),
        "function_of": _function_of(instance, reference),
        "order": int(getattr(instance, "order", 50)),
        "gated": bool(getattr(instance, "gated", site not in ("drive", "sensor"))),
        "asked": False,
        "law": staticmethod(instance.law),
        "memory": tuple(getattr(instance, "memory", ())),
        "given": instance,
        "given_site": site,
        "reference": reference,
        "declared": declared,
        "on": (on,) if isinstance(on, str) else tuple(on),
    }
    made |= {name: str(getattr(instance, name, "")) for name in ("noun", "sentence", "source")}
    made |= {"dry": True} if site == "friction" else {}
    made_class: Any = type(type(instance).__name__, (_Plain, BASES[site]), made)
    found: Effect = made_class()
    return found


class _Plain(Effect):
    """A user's object, and how its law is asked."""

    source: ClassVar[str]
    given: ClassVar[Any]
    given_site: ClassVar[Site]
    reference: ClassVar[str]
    declared: ClassVar[tuple[EffectParameter, ...]]
    on: ClassVar[tuple[str, ...]]

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """As the user declares them."""
        return self.declared

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Where its site says; of those the ones that the user names."""
        every = super().places(simulator)  # type: ignore[safe-super]  # the site's class comes after this one
        return tuple(on for on in every if not self.on or on in self.on)

    def weighs(self, values: Mapping[str, Any]) -> bool:
        """No user's friction knows its load."""
        return False

    def ask(self, values: Values, **known: Any) -> Any:
        """What the law says, an array of the inputs' shape each, and then what it remembers."""
        inputs = [known[name] for name in self.inputs[: len(INPUTS[self.given_site])]]
        given = [*inputs, *(values[p.name] for p in self.declared)]
        shape = np.broadcast_shapes(*map(np.shape, given))
        flat = [read_only(np.broadcast_to(a, shape).reshape(-1)) for a in given]
        kept = {name: known[name] for name in self.memory}
        extra = {"memory": kept, "step": read_only(known["step"])} if kept else {}
        said = asked(lambda: self.given.law(*flat, **extra), "law", self.reference)
        several = self.given_site == "vehicle"
        if several and (not isinstance(said, tuple | list) or len(said) != 3):
            raise UsageError(f"{self.reference}: law must return v, lateral and w, got {type(said).__name__}")
        parts = [self._checked(part, shape) for part in (said if several else (said,))]
        if self.given_site == "friction":
            return np.maximum(parts[0], 0.0)
        return (*parts, *kept.values()) if several or kept else parts[0]

    def _checked(self, part: Any, shape: tuple[int, ...]) -> FloatArray:
        try:
            array = np.asarray(part)
        except ValueError:
            array = np.asarray(None)
        refuse_complex(array, "law", self.reference)
        rows = math.prod(shape)
        numbers = np.issubdtype(array.dtype, np.number) or array.dtype == np.bool_
        if array.shape not in ((), (rows,)) or not numbers:
            raise UsageError(
                f"{self.reference}: law must return {rows} numbers, one per row of the batch, got shape {array.shape} "
                f"of {array.dtype}"
            )
        return np.array(np.broadcast_to(array, (rows,)), dtype=np.float64).reshape(shape)


def _family(instance: Any, reference: str) -> str:
    """Its name in diagnosis.json: `family`, or the class's name in lower case with underscores."""
    said = getattr(instance, "family", "") or re.sub(r"(?<!^)(?=[A-Z])", "_", type(instance).__name__).lower()
    if not isinstance(said, str) or not re.fullmatch(r"[a-z][a-z0-9_]*", said):
        raise UsageError(
            f"{reference}: 'family' must consist of lower-case letters, digits and underscores, got {said!r}"
        )
    return said


def _function_of(instance: Any, reference: str) -> FunctionOf:
    said = getattr(instance, "of", "nothing")
    found: FunctionOf | None = next((of for of in get_args(FunctionOf) if of == said), None)
    if found is None:
        raise UsageError(f"{reference}: 'of' must be one of {', '.join(get_args(FunctionOf))}, got {said!r}")
    return found


def _parameters(instance: Any, reference: str) -> tuple[EffectParameter, ...]:
    declared, nothing = getattr(instance, "parameters", None), dict(getattr(instance, "nothing", {}))
    if not isinstance(declared, Mapping) or not declared:
        raise UsageError(f"{reference}: 'parameters' must be {FORM}, got {declared!r}")
    return tuple(
        _parameter(str(n), said, float(nothing.get(n, 0.0)), reference) for n, said in declared.items()
    )


def _parameter(name: str, said: Any, none: float, reference: str) -> EffectParameter:
    try:
        unit, low, high, start = said
        starts = tuple(float(s) for s in (start if isinstance(start, list | tuple) else (start,)))
        low, high = float(low), float(high)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{reference}: parameters['{name}'] must be {FORM}, got {said!r}") from error
    good = math.isfinite(low) and math.isfinite(high) and starts and all(low <= s <= high for s in starts)
    if not isinstance(unit, str) or not good or low >= high:
        raise UsageError(
            f"{reference}: parameters['{name}'] needs a unit and finite numbers low <= start <= high, got {said!r}"
        )
    limit = math.isinf(none)
    if not limit and not low <= none <= high:
        raise UsageError(
            f"{reference}: parameters['{name}'] has no effect at {none:g}, which is outside {low:g} to {high:g}; "
            "widen its bounds, or give that value in 'nothing' (inf for a limit)"
        )
    scale = max(abs(starts[0] - (0.0 if limit else none)), STEPS * (high - low))
    return EffectParameter(name, unit, low, high, starts, scale, 0.0 if limit else none, falls=limit)


def _check_law(instance: Any, site: Site, reference: str) -> None:
    law, declared = getattr(instance, "law", None), getattr(instance, "parameters", {})
    memory = tuple(getattr(instance, "memory", ()))
    if memory and site != "actuator":
        raise UsageError(f"{reference}: only actuators have 'memory'; a law at the site {site} has none")
    expected = [*INPUTS[site], *map(str, declared), *(("memory", "step") if memory else ())]
    if not callable(law):
        raise UsageError(f"{reference}: it needs a method law(self, {', '.join(expected)})")
    taken = [p for p in inspect.signature(law).parameters.values() if p.kind is not p.VAR_KEYWORD]
    first = len(INPUTS[site])
    if len(taken) != len(expected) or [p.name for p in taken[first:]] != expected[first:]:
        raise UsageError(
            f"{reference}: law must take ({', '.join(expected)}), got ({', '.join(p.name for p in taken)})"
        )
