"""Damage, reproducible by number, and a watch over what the readers do with it: time, memory, kind of exception."""

import resource
import shutil
import signal
import traceback
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import pytest

from gpsim.errors import UsageError
from gpsim.recordings import open_log

SECONDS = 20.0
MEGABYTES = 600
WAYS = ("truncate", "flip", "flip", "zero", "fill", "swap", "insert", "remove")


def damaged(data, way, rng):
    """`fill` makes lengths of 4 294 967 295 wherever it hits."""
    length = int(rng.integers(1, min({"zero": 2048, "fill": 16, "remove": 512}.get(way, 64), len(data)) + 1))
    start = int(rng.integers(0, len(data) - length + 1))
    if way == "truncate":
        return data[:start]
    if way == "flip":
        for position in rng.integers(0, len(data), int(rng.integers(1, 12))):
            data[position] ^= int(rng.integers(1, 256))
    elif way == "swap":
        length = int(rng.integers(1, max(2, min(1024, len(data) // 4))))
        a, b = sorted(int(i) * length for i in rng.choice(len(data) // length, 2, replace=False))
        data[a : a + length], data[b : b + length] = data[b : b + length], data[a : a + length]
    else:
        stop = start if way == "insert" else start + length
        new = {"zero": bytes(length), "fill": b"\xff" * length, "insert": rng.bytes(length), "remove": b""}
        data[start:stop] = new[way]
    return data


def mutate(source, target, number):
    """Copy a bag with damage of kind `number` in one of its files; returns what was done."""
    rng = np.random.default_rng([number, 77])
    victim = target
    if source.is_dir():
        shutil.copytree(source, target)
        files = sorted((p for p in target.iterdir() if p.is_file()), key=lambda p: p.stat().st_size)
        victim = files[int(rng.integers(0, len(files)))] if number % 3 == 0 else files[-1]
    else:
        shutil.copy(source, target)
    way = WAYS[number % len(WAYS)]
    victim.write_bytes(damaged(bytearray(victim.read_bytes()), way, rng))
    return f"{way} in {victim.name}"


class Late(BaseException):
    """Not an Exception, so that no reader can swallow it."""


@contextmanager
def deadline(seconds):
    def ring(*_):
        raise Late

    before = signal.signal(signal.SIGALRM, ring)
    others = signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        signal.setitimer(signal.ITIMER_REAL, *others)  # whoever looks after calls would never look again


@dataclass
class Outcomes:
    """What happened to damaged files; `faults` must stay empty."""

    counts: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)


def watch(path, done, outcomes):
    """Open and read everything, strictly and for salvage; note what is neither a result nor one clear line."""
    for salvage in (False, True):
        name, fault = "salvage" if salvage else "strict", ""
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        try:
            with deadline(SECONDS):
                read_all(path, salvage)
            outcomes.counts[f"{name}: read"] += 1
        except UsageError as error:
            outcomes.counts[f"{name}: refused"] += 1
            said = str(error)
            if "\n" in said or len(said) > 600 or str(path) not in said or ";" not in said:
                fault = f"not one clear line: {said!r}"
        except Late:
            fault = f"more than {SECONDS} s"
        except BaseException:
            fault = traceback.format_exc(limit=-3)
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
        fault = fault or (f"{grown:.0f} MB" if grown > MEGABYTES else "")
        outcomes.faults += [f"{path.name} ({done}, {name}): {fault}"] if fault else []


def refused(path, salvage=False):
    """The one line that a file ends in."""
    outcomes = Outcomes()
    watch(path, "hostile", outcomes)
    assert not outcomes.faults
    with deadline(SECONDS), pytest.raises(UsageError) as caught:
        read_all(path, salvage)
    return str(caught.value)


def read_all(path, salvage):
    log = open_log(path, salvage=salvage)
    log.series({t.name: t.fields for t in log.topics() if t.fields})
