"""Calls of a user's code: what they raise, how long they take, and what becomes of copies of the process."""

import os
import signal
import threading
import time

import pytest

from gpsim.errors import Terminated, UsageError
from gpsim.simulators.calls import SETTING, WATCH, NoAnswerError, asked


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    WATCH.stop()
    monkeypatch.setattr("gpsim.simulators.calls.BETWEEN_LOOKS", 0.05)
    monkeypatch.setenv(SETTING, "0.2")
    yield
    WATCH.stop()


def for_ever():
    while True:
        pass


def catching_all():
    while True:
        try:
            for_ever()
        except Exception:
            continue


@pytest.mark.parametrize(
    "function", [for_ever, catching_all, lambda: time.sleep(1e6), threading.Event().wait]
)
def test_what_does_not_return_is_a_line(function):
    with pytest.raises(NoAnswerError) as refused:
        asked(function, "rates", "mine.py:Tank")
    assert str(refused.value) == (
        "mine.py:Tank: rates did not return within 0.2 s; correct it, or set GPSIM_LONGEST_CALL=600 (s)"
    )


def test_many_short_calls_are_no_long_one():
    until = time.monotonic() + 0.6
    while time.monotonic() < until:
        asked(lambda: time.sleep(0.01), "rates", "mine.py:Tank")
    time.sleep(0.3)  # nothing is called: it stops looking
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert signal.getitimer(signal.ITIMER_VIRTUAL) == (0.0, 0.0)


def test_a_programs_own_timer_is_left_alone():
    before = signal.signal(signal.SIGALRM, lambda *_: None)
    signal.setitimer(signal.ITIMER_REAL, 100.0)
    try:
        assert asked(lambda: 3, "rates", "mine.py:Tank") == 3
        WATCH.stop()
        assert signal.getitimer(signal.ITIMER_REAL)[0] > 50.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_a_program_that_takes_the_timer_later_is_not_ended_by_the_other_one():
    assert asked(lambda: 3, "rates", "mine.py:Tank") == 3
    before = signal.signal(signal.SIGALRM, lambda *_: None)
    try:
        WATCH.stop()
        assert signal.getitimer(signal.ITIMER_VIRTUAL) == (0.0, 0.0)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_other_threads_are_not_bounded():
    said = []
    thread = threading.Thread(target=lambda: said.append(asked(lambda: time.sleep(0.5) or 3, "rates", "x")))
    thread.start()
    thread.join()
    assert said == [3]


@pytest.mark.parametrize("kind", [GeneratorExit, BaseException, SystemExit, MemoryError, RecursionError])
def test_whatever_is_raised_is_a_line(kind):
    def raising():
        raise kind("so\nit is")

    with pytest.raises(UsageError, match=rf"^mine\.py:Tank: rates raised {kind.__name__}: so it is$"):
        asked(raising, "rates", "mine.py:Tank")


@pytest.mark.parametrize("kind", [KeyboardInterrupt, Terminated])
def test_being_asked_to_end_is_no_fault_of_the_code(kind):
    def raising():
        raise kind

    with pytest.raises(kind):
        asked(raising, "rates", "mine.py:Tank")


def test_a_copy_that_comes_back_ends_and_is_told():
    with pytest.raises(UsageError, match="returned in a copied process"):
        asked(lambda: os.fork() and os.wait(), "rates", "mine.py:Tank")
    assert asked(lambda: 3, "rates", "mine.py:Tank") == 3


@pytest.mark.parametrize("said", ["soon", "0", "-1", "nan", "inf"])
def test_the_setting_is_a_number_of_seconds(monkeypatch, said):
    monkeypatch.setenv(SETTING, said)
    with pytest.raises(UsageError, match=f"GPSIM_LONGEST_CALL={said}: expected the longest time"):
        asked(lambda: 3, "rates", "mine.py:Tank")
