"""How a log was understood, for a person: what was taken for what, or the one line that asks what is not told."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath

from gpsim.recordings import Guess, listed
from gpsim.simulators import SIMULATORS

OPEN = "COLUMN"
"""What stands in a proposed command where only a person knows."""
OF_THE_LOG = ("t", "dt", "files")
"""What is said of a log whatever it is compared with."""
MOST = 12  # candidates that a line lists


def told(found: Guess, path: str, own: Mapping[str, tuple[float, str]]) -> list[str]:
    """A line on what was taken for what, and one on parameters that nobody gave (`own`: value and unit)."""
    path = PurePath(shlex.split(path)[0]).name
    said = ", ".join(f"{name} from {source}{_unit(found, name)}" for name, source in found.taken.items())
    lines = [
        f"{path}: read as {found.system.name}: {said}; to change it: CHANNEL=SOURCE, as {_example(found)}"
    ]
    lines += [f"{path}: {remark}" for remark in found.remarks]
    lines += [f"{path}: {line}" for line in _switched(found)]
    if own:
        values = ", ".join(f"{name} {value:g} {unit}".rstrip() for name, (value, unit) in own.items())
        first = next(iter(own))
        lines.append(f"{found.system.name} as it comes: {values}; yours: parameters.{first}=VALUE")
    return lines


def _switched(found: Guess) -> list[str]:
    """How the log is cut by what may say when the motors were on, unless it is."""
    if found.switch is None:
        return []
    source, words = found.switch
    return [f"{source} may say when the motors were on; if so, add {words}"]


def _unit(found: Guess, name: str) -> str:
    units = {**found.system.state.units, **found.system.action.units}
    return f" [{units[name]}]" if name in units else ""


def _example(found: Guess) -> str:
    """A source with a factor before it."""
    rad = [n for n, unit in found.system.state.units.items() if unit == "rad" and n in found.taken]
    if rad:
        return shlex.quote(f"{rad[0]}=deg*{found.taken[rad[0]].rpartition('*')[2]}")
    name = next((n for n in (*found.system.action.names, *found.system.state.names) if n in found.taken), "x")
    return shlex.quote(f"{name}=0.5*{found.taken.get(name, OPEN).rpartition('*')[2]}")


@dataclass(frozen=True)
class Asking:
    """What was typed. command: before the log; path: of the log, as a shell takes it; words, tail: behind it.

    named: whether the user said which simulator.
    """

    command: str
    path: str
    words: Sequence[str] = ()
    tail: str = ""
    named: bool = False


def asked(typed: Asking, found: Guess, columns: Sequence[str], ready: Sequence[str]) -> str:
    """One line with the command that would do, and what only a person can tell.

    columns: of the log, and its topics; ready: mappings that come with gpsim and fit.
    """
    unknown = not typed.named and any(name in found.missing for name in found.system.state.names)
    name = PurePath(shlex.split(typed.path)[0]).name
    looks = "" if typed.named or unknown else f" that looks like one of {found.system.name}"
    line = f"{name}: a raw log{looks}; say what is what: {_proposed(typed, found, unknown)}"
    if unknown:
        line += f"; columns: {listed(columns)}; NAME and its channels: {_simulators()}"
    else:
        line += f"{_questions(found)} ({_units(found)}; a factor may stand before a source: {_example(found)}"
        others = ", ".join(n for n in SIMULATORS if n != found.system.name)
        line += ")" if typed.named else f"; other simulators: {others}, your own: FILE.py:ClassName)"
    line += "".join(f"; {said}" for said in ([] if unknown else _switched(found)))
    line += f"; if it is the public set {ready[0]}: --mapping {ready[0]} instead" if ready else ""
    inspect = f"; gpsim import --inspect {typed.path} shows what is inside, and proposes a --mapping to edit"
    return line + (inspect if typed.tail else "")


def _proposed(typed: Asking, found: Guess, unknown: bool) -> str:
    """The command, with what only a person knows left open."""
    kept = [word for word in typed.words if word.partition("=")[0] not in found.taken]
    taken = {n: source for n, source in found.taken.items() if n != source or n in found.unclear}
    if unknown:
        taken = {n: source for n, source in taken.items() if n in OF_THE_LOG}
    parts = [typed.command, typed.path, "--simulator", "NAME" if unknown else shlex.quote(found.system.name)]
    parts += [shlex.quote(word) for word in (*kept, *(f"{n}={source}" for n, source in taken.items()))]
    parts += [f"CHANNEL={OPEN} ..."] if unknown else [f"{n}={OPEN}" for n in found.missing]
    return " ".join([*parts, *([typed.tail] if typed.tail else [])])


def _questions(found: Guess) -> str:
    """What only a person can tell, with the candidates: channels that have the same ones together."""
    line = ""
    alike: dict[tuple[str, ...], list[str]] = {}
    for name, names in found.missing.items():
        alike.setdefault(tuple(names), []).append(name)
    for candidates, channels in alike.items():
        line += f"; {', '.join(channels)}: of {_candidates(candidates)}"
    for name, names in found.unclear.items():
        others = [other for other in names if other != found.taken.get(name)]
        line += f"; {name} is {found.taken.get(name)}"
        line += f", or {_candidates(others)}" if others else " by its name alone"
    actions = [name for name in found.system.action.names if name in found.missing]
    return line + (f"; {actions[0]}=none where nobody commanded it" if actions else "")


def _simulators() -> str:
    """Every simulator with its channels."""
    made = [SIMULATORS[name]() for name in SIMULATORS]
    said = [f"{s.name} ({', '.join([*s.state.names, *s.action.names])})" for s in made]
    return f"{', '.join(said)}, or your own: FILE.py:ClassName"


def _candidates(names: Sequence[str]) -> str:
    return listed(names[:MOST]) + (f" and {len(names) - MOST} more" if len(names) > MOST else "")


def _units(found: Guess) -> str:
    units = {**found.system.state.units, **found.system.action.units}
    return ", ".join(f"{name} in {unit}" for name, unit in units.items() if unit)
