"""Damage, reproducible by number, and a watch over what the readers do with it: time, memory, kind of exception."""

from __future__ import annotations

import resource
import shutil
import signal
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import pytest

from gpsim.errors import UsageError
from gpsim.recordings.readers import open_log

SECONDS = 20.0
MEGABYTES = 600
Mutation = Callable[[bytearray, np.random.Generator], bytearray]


def _span(data, rng, most):
    length = int(rng.integers(1, min(most, len(data)) + 1))
    start = int(rng.integers(0, len(data) - length + 1))
    return start, start + length


def truncate(data, rng):
    return data[: int(rng.integers(0, len(data)))]


def flip(data, rng):
    for position in rng.integers(0, len(data), int(rng.integers(1, 12))):
        data[position] ^= int(rng.integers(1, 256))
    return data


def zero(data, rng):
    start, end = _span(data, rng, 2048)
    data[start:end] = bytes(end - start)
    return data


def fill(data, rng):
    """Lengths of 4 294 967 295 wherever it hits."""
    start, end = _span(data, rng, 16)
    data[start:end] = b"\xff" * (end - start)
    return data


def swap(data, rng):
    length = int(rng.integers(1, max(2, min(1024, len(data) // 4))))
    a, b = sorted(int(i) * length for i in rng.choice(len(data) // length, 2, replace=False))
    data[a : a + length], data[b : b + length] = data[b : b + length], data[a : a + length]
    return data


def insert(data, rng):
    position = int(rng.integers(0, len(data) + 1))
    data[position:position] = rng.bytes(int(rng.integers(1, 64)))
    return data


def remove(data, rng):
    start, end = _span(data, rng, 512)
    del data[start:end]
    return data


MUTATIONS: tuple[Mutation, ...] = (truncate, flip, flip, zero, fill, swap, insert, remove)


def mutate(source, target, number):
    """Copy a bag with damage of kind `number` in one of its files; returns what was done."""
    rng = np.random.default_rng([number, 77])
    if source.is_dir():
        shutil.copytree(source, target)
        files = sorted(p for p in target.iterdir() if p.is_file())
        victim = (
            files[int(rng.integers(0, len(files)))]
            if number % 3 == 0
            else max(files, key=lambda p: p.stat().st_size)
        )
    else:
        shutil.copy(source, target)
        victim = target
    chosen = MUTATIONS[number % len(MUTATIONS)]
    victim.write_bytes(chosen(bytearray(victim.read_bytes()), rng))
    return f"{chosen.__name__} in {victim.name}"


class Late(BaseException):
    """Not an Exception, so that no reader can swallow it."""


@contextmanager
def deadline(seconds):
    def ring(*_):
        raise Late

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@dataclass
class Outcomes:
    """What happened to damaged files; `faults` must stay empty."""

    counts: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)


def watch(path, done, outcomes):
    """Open and read everything, strictly and for salvage; note what is neither a result nor one clear line."""
    for salvage in (False, True):
        name = "salvage" if salvage else "strict"
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        try:
            with deadline(SECONDS):
                log = open_log(path, salvage=salvage)
                series = log.series({t.name: t.fields for t in log.topics() if t.fields})
            read = sum(one.read for one in series.values())
            lost = sum(sum(one.dropped.values()) for one in series.values()) + sum(log.losses.values())
            outcomes.counts[
                f"{name}: {'part' if lost else 'all'} read" if read else f"{name}: nothing read"
            ] += 1
        except UsageError as error:
            outcomes.counts[f"{name}: refused"] += 1
            message = str(error)
            if "\n" in message or len(message) > 600 or str(path) not in message or ";" not in message:
                outcomes.faults.append(f"{path.name} ({done}, {name}): not one clear line: {message!r}")
        except Late:
            outcomes.faults.append(f"{path.name} ({done}, {name}): more than {SECONDS} s")
        except BaseException:
            outcomes.faults.append(f"{path.name} ({done}, {name}): {traceback.format_exc(limit=-3)}")
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
        if grown > MEGABYTES:
            outcomes.faults.append(f"{path.name} ({done}, {name}): {grown:.0f} MB")


def refused(path, salvage=False):
    """The one line that a file ends in."""
    outcomes = Outcomes()
    watch(path, "hostile", outcomes)
    assert not outcomes.faults
    with deadline(20.0), pytest.raises(UsageError) as caught:
        read_all(path, salvage)
    return str(caught.value)


def read_all(path, salvage):
    log = open_log(path, salvage=salvage)
    log.series({t.name: t.fields for t in log.topics() if t.fields})
