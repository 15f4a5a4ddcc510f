"""Worker processes: a pool that leaves nobody behind, whatever ends the parent."""

from __future__ import annotations

import ctypes
import math
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import ForkingPickler
from typing import Any

from gpsim.errors import CODE, Terminated, UsageError
from gpsim.trust import Lent, lent, take

PR_SET_PDEATHSIG = 1  # of Linux's prctl: the signal that a process gets when its parent is gone
OURS = (None, CODE, -signal.SIGTERM)  # exit codes of workers that run on, or that the pool itself ended
GRACE = 10.0  # s in which a worker that is asked to end may clean up
AT_ONCE = 5.0  # s within which a process that was asked to end is not asked again
A_MOMENT = 1.0  # s within which one Ctrl-C reaches a process by every way it has
LEAKED = "ignore:resource_tracker:UserWarning"
PATIENCE = 20  # looks at the exit codes, a twentieth of a second apart


class Asked:
    """A handler of a signal that raises an exception, Terminated for SIGTERM.

    Asked again at once it does not, so that what cleans up is not interrupted: a worker is asked by whoever asks all of
    the processes, and by its parent.
    """

    def __init__(self, kind: type[BaseException] = Terminated, at_once: float = AT_ONCE) -> None:
        self._kind, self._at_once, self._last = kind, at_once, -math.inf

    def __call__(self, number: int, frame: object) -> None:
        """Raise, unless it has done so within the last seconds."""
        now = time.monotonic()
        if now - self._last > self._at_once:  # later it is asked by somebody who sees that nothing happens
            self._last = now
            raise self._kind


@contextmanager
def _handled(handler: Callable[[int, object], None], numbers: Sequence[int]) -> Iterator[None]:
    """Within it these signals are handled so, in the main thread: elsewhere whose process it is minds them."""
    mine = threading.current_thread() is threading.main_thread()
    before = {number: signal.signal(number, handler) for number in (numbers if mine else ())}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier or signal.SIG_DFL)


@contextmanager
def ends_when_asked() -> Iterator[None]:
    """Within it SIGTERM, and SIGHUP of a terminal that is closed, raise Terminated."""
    already = isinstance(signal.getsignal(signal.SIGTERM), Asked)
    ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN  # as nohup has it
    numbers = [signal.SIGTERM] if ignored else [signal.SIGTERM, signal.SIGHUP]
    with _handled(Asked(), [] if already else numbers):
        yield


def asked_once() -> None:
    """From now on Ctrl-C raises KeyboardInterrupt, SIGTERM and SIGHUP Terminated: once, though several tell of it.

    A terminal, or whoever asks the whole group, tells this process and the one that passes signals on to it.
    """
    terminated = Asked()
    for number, handler in (
        (signal.SIGINT, Asked(KeyboardInterrupt, A_MOMENT)),
        (signal.SIGTERM, terminated),
        (signal.SIGHUP, terminated),
    ):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Within it SIGTERM and Ctrl-C wait for the end of the block.

    For the start of processes: one that is half started would tell of it with a traceback.
    """
    heard: list[int] = []
    # What is ignored or left to the system stays so.
    numbers = [n for n in (signal.SIGTERM, signal.SIGINT) if callable(signal.getsignal(n))]
    try:
        with _handled(lambda number, frame: heard.append(number), numbers):
            yield
    finally:
        for asked in dict.fromkeys(heard):
            signal.raise_signal(asked)


class WorkerDiedError(UsageError):
    """A worker process is gone during a call.

    how: in words, as "crashed (SIGSEGV)"; killed: from outside.
    """

    def __init__(self, how: str, killed: bool) -> None:
        self.how, self.killed = how, killed
        super().__init__(f"a worker process {how}; run the same command to continue")


class WorkerPool(ProcessPoolExecutor):
    """Its workers leave when the parent ends them, though another job be at hand."""

    def submit(self, job: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """As the executor's own; the first starts the processes.

        The job is packed here: the executor does so in a thread, while this one goes on and may change what is sent.
        """
        packed = bytes(ForkingPickler.dumps((job, args, kwargs)))
        with undisturbed():
            return super().submit(_run, packed)


def _run(packed: bytes) -> Any:
    """The executor would take SystemExit for the job's result, begin the next job, or wait for one for ever."""
    job, args, kwargs = ForkingPickler.loads(packed)
    try:
        return job(*args, **kwargs)
    except Terminated:
        os._exit(CODE)
    except SystemExit:
        os._exit(1)


@contextmanager
def worker_pool(count: int, begin: Callable[..., None], *arguments: Any) -> Iterator[WorkerPool]:
    """A pool of `count` spawned processes, each begun by `begin(*arguments)`; none outlives the block.

    Spawned, not forked: torch does not survive a fork, nor does a parent that shows its progress from a thread. A
    worker that was killed, or crashed, raises WorkerDiedError.
    """
    others = multiprocessing.active_children()  # of a program that uses this one as a library
    context = multiprocessing.get_context("spawn")
    if LEAKED not in sys.warnoptions:  # what a killed parent left, the tracker removes, and need not tell
        sys.warnoptions.append(LEAKED)
    pool = WorkerPool(count, context, initializer=_begin, initargs=(lent(), begin, arguments))
    try:
        yield pool
        pool.shutdown()
    except BrokenProcessPool as error:
        raise _died(pool) from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        _end([child for child in multiprocessing.active_children() if child not in others])


def _begin(trusted: Lent, begin: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    """In a new worker: it may run what its parent may."""
    take(trusted)
    begin(*arguments)


def _end(processes: Sequence[BaseProcess]) -> None:
    """Ask them to end and, those that do not, make them."""
    for process in processes:
        process.terminate()
    until = time.monotonic() + GRACE
    for process in processes:
        process.join(max(0.0, until - time.monotonic()))
    for process in processes:
        if process.is_alive():
            process.kill()


def _died(pool: WorkerPool) -> WorkerDiedError:
    """What became of the worker that broke the pool, as far as its exit code says."""
    processes = list((getattr(pool, "_processes", None) or {}).values())  # the executor tells nobody else
    for _ in range(PATIENCE):
        codes = [process.exitcode for process in processes if process.exitcode not in OURS]
        if codes and codes[0] is not None:
            return _told(codes[0])
        time.sleep(0.05)
    return _told(-signal.SIGKILL)


def _told(code: int) -> WorkerDiedError:
    if code == -signal.SIGKILL:  # what Linux does to whoever takes too much
        return WorkerDiedError("was killed (out of memory?)", killed=True)
    if code == -signal.SIGVTALRM:
        return WorkerDiedError("did not come back from a call", killed=False)
    if code < 0:
        return WorkerDiedError(f"crashed ({signal.Signals(-code).name})", killed=False)
    return WorkerDiedError(f"ended by itself (exit code {code})", killed=False)


def begin_worker(parent: int) -> None:
    """Ctrl-C and SIGHUP reach the whole group and the parent ends its workers; without the parent (kill -9) they leave.

    Who is ended by the parent leaves as after an exception, so that temporary folders go with it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, Asked())
    leave_with(parent)


def leave_with(parent: int, number: signal.Signals = signal.SIGKILL) -> None:
    """From now on this process ends, by this signal, when its parent does: nobody waits for the result.

    Linux's kernel sees to it at once; elsewhere, and where it will not, a thread looks every second. The next run
    sweeps what is half-made.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):  # a C library without it
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, number, 0, 0, 0)
    threading.Thread(target=_watch, args=(parent, number), daemon=True).start()


def _watch(parent: int, number: signal.Signals) -> None:
    while os.getppid() == parent:
        time.sleep(1.0)
    os.kill(os.getpid(), number)
