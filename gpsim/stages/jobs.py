"""Independent stages side by side in worker processes; what is finished stays finished, whatever happens."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, replace
from multiprocessing.queues import Queue
from queue import Empty

from gpsim.artifacts import Artifact
from gpsim.errors import UsageError
from gpsim.stages.stage import Request
from gpsim.workers import begin_worker, worker_pool

Update = Callable[[str, int, int, str], None]
"""update(job, done, total, note)"""
Finished = Callable[[str, Artifact, bool], None]
"""finished(job, artifact, existed)"""
Message = tuple[str, int, int, str]


@dataclass(frozen=True)
class Job:
    """One artifact to make: a stage's name and its request, after the jobs labelled `after`."""

    label: str
    stage: str
    request: Request
    after: tuple[str, ...] = ()


def run_jobs(jobs: Sequence[Job], workers: int, update: Update, finished: Finished) -> None:
    """Run every job as soon as what it waits for is done; the first failure stops the rest and is raised.

    Existing artifacts are found, not made again. Version numbers follow the order of `jobs`, not of completion, so
    that the same configuration gives the same folders.
    """
    waiting = {
        job.label: replace(job, request=request) for job, request in zip(jobs, _numbered(jobs), strict=True)
    }
    done: set[str] = set()
    context = multiprocessing.get_context("spawn")
    messages: Queue[Message] = context.Queue()
    running: dict[Future[tuple[Artifact, bool]], str] = {}
    with worker_pool(workers, _start_worker, messages, os.getpid()) as pool:
        while waiting or running:
            for job in [j for j in waiting.values() if done.issuperset(j.after)]:
                if len(running) < workers:
                    del waiting[job.label]
                    running[pool.submit(_work, job.label, job.stage, job.request)] = job.label
            ready, _ = wait(running, timeout=0.2, return_when=FIRST_COMPLETED)
            for message in _drain(messages):
                update(*message)
            for future in ready:
                label = running.pop(future)
                artifact, existed = future.result()
                done.add(label)
                finished(label, artifact, existed)


def _numbered(jobs: Sequence[Job]) -> Iterable[Request]:
    """Every job that is still to be made asks for a version of its own, in the order of the plan."""
    from gpsim.stages.registry import STAGES  # the registry holds this module's callers

    free = {job.stage: job.request.store.free_numbers(job.stage) for job in jobs}
    for job in jobs:
        try:
            existing = job.request.store.find(STAGES[job.stage].keyed(job.request))
        except UsageError:  # a parent is not there yet, so neither is this
            existing = None
        yield job.request if existing else replace(job.request, number=next(free[job.stage]))


_messages: Queue[Message]


def _start_worker(messages: Queue[Message], parent: int) -> None:
    global _messages
    _messages = messages
    begin_worker(parent)


def _work(label: str, stage: str, request: Request) -> tuple[Artifact, bool]:
    from gpsim.stages.registry import STAGES

    def progress(done: int, total: int, note: str) -> None:
        _messages.put((label, done, total, note))

    return STAGES[stage].make(replace(request, progress=progress))


def _drain(messages: Queue[Message]) -> Iterable[Message]:
    while True:
        try:
            yield messages.get_nowait()
        except Empty:
            return
