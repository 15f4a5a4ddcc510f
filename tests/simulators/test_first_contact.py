"""A user's simulator that ends or crashes the process, or answers with complex numbers, is one line that names it."""

import subprocess
import sys

import numpy as np
import pytest

from gpsim.errors import Terminated, UsageError
from gpsim.simulators import make_simulator
from gpsim.stages.stage import blamed
from gpsim.workers import WorkerDiedError

pytestmark = pytest.mark.usefixtures("own_files")

TANK = """
import ctypes, os, sys, multiprocessing
import numpy as np
{top}
class Tank:
    state = {{"level": "m"}}
    action = {{"pump": "V"}}
    parameters = {{"outflow": ("1/s", 0.1, 0.0, 10.0)}}

    def __init__(self):
        {made}

    def rates(self, state, action, p):
        {asked}
        return {{"level": action["pump"] - p["outflow"] * state["level"]}}
"""


def tank(tmp_path, top="", made="pass", asked="pass"):
    path = tmp_path / "mine.py"
    path.write_text(TANK.format(top=top, made=made, asked=asked))
    return f"{path}:Tank"


@pytest.mark.parametrize("where", ["top", "made", "asked"])
@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("os._exit(0)", r"mine\.py: ended the program \(exit code 0\)"),
        ("os._exit(7)", r"mine\.py: ended the program \(exit code 7\)"),
        ("sys.exit(0)", r"mine\.py.* SystemExit: 0"),
        ("ctypes.string_at(0)", r"mine\.py: crashed Python \(SIGSEGV\) at line \d+, in "),
    ],
)
def test_it_is_met_apart(tmp_path, where, what, said):
    with pytest.raises(UsageError, match=said) as caught:
        make_simulator(tank(tmp_path, **{where: what}))
    assert "\n" not in str(caught.value)


def test_batches_are_tried(tmp_path):
    asked = "len(state['level']) > 50 and os._exit(0)"
    with pytest.raises(UsageError, match="ended the program"):
        make_simulator(tank(tmp_path, asked=asked))


def test_what_it_prints_or_refuses_at_a_tried_state_is_no_fault(tmp_path, capfd):
    asked = "print('hello'); assert (state['level'] > -1e-3).all()"
    assert make_simulator(tank(tmp_path, asked=asked)).name.endswith("mine.py:Tank")
    assert capfd.readouterr().out.count("hello") == 1  # here, and not in the other process


def test_its_neighbours_are_found_there_as_here(tmp_path, monkeypatch):
    (tmp_path / "neighbour.py").write_text("RATE = 2.0")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert make_simulator(tank(tmp_path, top="from neighbour import RATE"))


def test_complex_numbers_are_refused(tmp_path):
    with pytest.raises(
        UsageError, match=r"Tank: rates\['level'\] is complex, as 0\.1\+0\.1j; return real numbers"
    ):
        make_simulator(tank(tmp_path, asked="return {'level': action['pump'] + 1j * state['level']}"))
    # Only where a root is taken of a negative number: when it is asked there.
    late = make_simulator(tank(tmp_path, asked="return {'level': np.emath.sqrt(state['level'])}"))
    late.rates(np.ones((2, 1)), np.ones((2, 1)), late.defaults())
    with pytest.raises(UsageError, match="is complex, as 0\\+1j"):
        late.rates(-np.ones((2, 1)), np.ones((2, 1)), late.defaults())


@pytest.mark.parametrize("method", ["rates", "derivative", "measured_rates"])
def test_complex_numbers_of_a_derived_class_are_refused(tmp_path, method):
    path = tmp_path / "mine.py"
    path.write_text(
        "from gpsim.simulators import Slider\n"
        "class Mine(Slider):\n"
        f"    def {method}(self, *given, **named):\n"
        f"        return super().{method}(*given, **named) * (1.0 + 1j)\n"
    )
    with pytest.raises(UsageError, match=rf"mine\.py:Mine: {method} is complex"):
        make_simulator(f"{path}:Mine")


@pytest.fixture
def recording(tmp_path):
    rng, level = np.random.default_rng(0), [0.0]
    pump = rng.normal(size=300)
    for u in pump[:-1]:
        level.append(level[-1] + 0.1 * (1.3 * u - 0.1 * level[-1]))
    rows = [f"0,{0.1 * k:.1f},{x},{u}\n" for k, (x, u) in enumerate(zip(level, pump, strict=True))]
    path = tmp_path / "drive.csv"
    path.write_text("episode,t,level,pump\n" + "".join(rows))
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("os._exit(0)", "ended by itself (exit code 0)"),
        ("ctypes.string_at(0)", "crashed (SIGSEGV)"),
    ],
)
def test_what_ends_a_worker_later_is_put_down_to_the_file(tmp_path, recording, asked, said):
    reference = tank(tmp_path, asked=f"multiprocessing.parent_process() and {asked}")
    words = ["diagnose", str(recording), "--simulator", reference, "--out", "out", "--cores", "2"]
    ended = subprocess.run(
        [sys.executable, "-m", "gpsim", *words], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 2
    assert ended.stderr == (
        f"error: {tmp_path / 'mine.py'}: a worker process {said}, most likely in the code of this file; fix it, then run "
        "again\n"
    )
    assert not (tmp_path / "out").exists()


def test_whose_fault_an_end_is():
    with (
        pytest.raises(UsageError, match=r"^mine\.py: ended the program \(exit code 4\)"),
        blamed("mine.py:Tank"),
    ):
        sys.exit(4)
    with pytest.raises(SystemExit), blamed("cartpole"):
        sys.exit(4)
    with pytest.raises(Terminated), blamed("mine.py:Tank"):
        raise Terminated
    with pytest.raises(WorkerDiedError), blamed("mine.py:Tank"):  # for want of memory
        raise WorkerDiedError("was killed", killed=True)


def test_a_request_to_end_is_not_taken_for_the_users_code(tmp_path):
    asked = (
        "from gpsim.errors import Terminated; state['level'][0] > 5 and (_ for _ in ()).throw(Terminated())"
    )
    found = make_simulator(tank(tmp_path, asked=asked))
    with pytest.raises(Terminated):
        found.rates(np.full((1, 1), 9.0), np.ones((1, 1)), found.defaults())
