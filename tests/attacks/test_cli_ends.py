"""However a command ends, one line says so: what its own code, a model's code or the system does to the process."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

TANK = """
import ctypes, os, sys, time
calls = 0
class Tank:
    state = {{"level": "m"}}
    action = {{"pump": "V"}}
    parameters = {{"outflow": ("1/s", 0.1, 0.0, 10.0)}}
    def rates(self, state, action, p):
        global calls
        calls += 1
        if calls > 200:
            {}
        return {{"level": action["pump"] - p["outflow"] * state["level"]}}
"""
INTERRUPTED = "interrupted: finished artifacts are complete; run the same command to continue\n"


def commanded(code, *words, **options):
    """`gpsim WORDS`, whose command is this code."""
    program = (
        "import ctypes, os, signal, sys, threading, time\n"
        "import gpsim.cli.main as command\n"
        "from gpsim import supervision\n"
        "from gpsim.cli import entry\n"
        f"def main():\n    {code}\n"
        "command.main = main\n"
        "sys.argv[0] = 'gpsim'\n"
        "entry.main()\n"
    )
    return subprocess.run(
        [sys.executable, "-c", program, *words], capture_output=True, text=True, check=False, **options
    )


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("pass", 0),
        ("sys.exit()", 0),
        ("sys.exit(3)", 3),
        ("raise SystemExit(130)", 130),
        # A thread of somebody's that never ends does not keep the command: see LAST_WORDS.
        ("entry.LAST_WORDS = 0.1; threading.Thread(target=time.sleep, args=(1e6,)).start(); sys.exit(2)", 2),
        # What crashes after the command has ended changes nothing.
        ("import atexit; atexit.register(ctypes.string_at, 0); sys.exit(3)", 3),
    ],
)
def test_a_command_that_ends_by_itself_is_not_spoken_for(code, expected):
    ended = commanded(code)
    assert (ended.returncode, ended.stderr) == (expected, "")


def test_a_fault_of_gpsim_is_a_traceback():
    ended = commanded("1 // 0")
    assert ended.returncode == 1
    assert ended.stderr.rstrip().endswith("ZeroDivisionError: integer division or modulo by zero")


CALLS = "supervision.calls('my\\x1b[31m.py')"
KILLED = "error: killed (out of memory?); finished artifacts are complete; run the same command to continue"


@pytest.mark.parametrize(
    ("code", "expected", "said"),
    [
        (f"{CALLS}; os._exit(0)", 2, "error: my[31m.py: ended the program (exit code 0) during a call; "),
        (f"{CALLS}; os.execlp('true', 'true')", 2, "error: my[31m.py: ended the program (exit code 0) "),
        (f"{CALLS}; ctypes.string_at(0)", 2, "error: my[31m.py: crashed Python (SIGSEGV), most likely in the code of"),
        (f"{CALLS}; os.abort()", 2, "error: my[31m.py: crashed Python (SIGABRT)"),
        (f"{CALLS}; os.kill(os.getpid(), signal.SIGVTALRM)", 2, "error: my[31m.py: a call did not return; correct it"),
        ("os.kill(os.getpid(), signal.SIGKILL)", 2, KILLED),
        ("os._exit(0)", 1, "error: ended the program (exit code 0) during a call; run the same command"),
        ("ctypes.string_at(0)", 1, "error: crashed Python (SIGSEGV): a bug in gpsim or in a library; "),
    ],
)  # fmt: skip
def test_who_ends_without_a_word_is_spoken_for(code, expected, said):
    ended = commanded(code, "diagnose", "--json")
    assert ended.returncode == expected
    assert ended.stderr.startswith(said)
    assert ended.stderr.count("\n") == 1
    answer = json.loads(ended.stdout)
    assert (answer["exit_code"], f"error: {answer['error']['message']}\n") == (expected, ended.stderr)


@pytest.fixture
def recording(tmp_path):
    rng, level = np.random.default_rng(0), [0.0]
    pump = rng.normal(size=300)
    for u in pump[:-1]:
        level.append(level[-1] + 0.1 * (1.3 * u - 0.1 * level[-1]))
    rows = [f"0,{0.1 * k:.1f},{x},{u}\n" for k, (x, u) in enumerate(zip(level, pump, strict=True))]
    (tmp_path / "drive.csv").write_text("episode,t,level,pump\n" + "".join(rows))
    return tmp_path / "drive.csv"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("os._exit(0)", "ended the program (exit code 0) during a call"),
        ("ctypes.string_at(0)", "crashed Python (SIGSEGV) at line 12, in rates"),
        pytest.param("os.fork()", "returned in a copied process", marks=pytest.mark.slow),
        pytest.param("raise GeneratorExit", "rates raised GeneratorExit", marks=pytest.mark.slow),
        pytest.param(
            "time.sleep(1e6)", "rates did not return within 1 s; correct it", marks=pytest.mark.slow
        ),
    ],
)
def test_a_model_that_does_so_after_200_calls_is_named(tmp_path, recording, what, said):
    (tmp_path / "mine.py").write_text(TANK.format(what))
    words = ["diagnose", recording, "--simulator", "mine.py:Tank", "--out", "out", "--cores", "1", "--quiet"]
    ended = subprocess.run(
        [sys.executable, "-m", "gpsim", *words],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "GPSIM_LONGEST_CALL": "1"},
    )
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith("error: mine.py")
    assert said in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def heard():
    """`nohup` ignores SIGHUP, a shell's background jobs SIGINT, and so would all that they start."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


WAITING = "print('begun', flush=True); time.sleep(60)"
MANNERLY = (
    "from gpsim.workers import ends_when_asked\n    from gpsim.errors import Terminated\n"
    "    with ends_when_asked():\n        try:\n"
    f"            {WAITING}\n"
    "        except (KeyboardInterrupt, Terminated) as e: print(type(e).__name__, flush=True); sys.exit(7)"
)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
@pytest.mark.parametrize("whom", ["one", "group"])
def test_what_asks_the_parent_to_end_asks_the_command_once(number, whom):
    program = (
        "import sys, time, gpsim.cli.main as command\nfrom gpsim.cli import entry\n"
        f"def main():\n    {MANNERLY}\ncommand.main = main\nentry.main()\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True, preexec_fn=heard,
    )  # fmt: skip
    assert process.stdout.readline() == "begun\n"
    (os.killpg if whom == "group" else os.kill)(process.pid, number)
    if number == signal.SIGKILL:
        out, err = process.communicate(timeout=50)
        assert process.returncode == -signal.SIGKILL
        assert out == (
            "" if whom == "group" else "Terminated\n"
        )  # told by the system that its parent is gone
    else:
        out, err = process.communicate(timeout=50)
        assert process.returncode == 7
        assert out == ("KeyboardInterrupt\n" if number == signal.SIGINT else "Terminated\n")
    assert err == ""


def test_ctrl_c_while_a_command_is_loaded_is_a_line():
    """Sent when the child is there; the interpreter's own first moments are not gpsim's."""
    program = (
        "import sys, time\nfrom gpsim.cli import entry\nclass Slow:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'gpsim.cli.main': print('loading', flush=True); time.sleep(60)\n"
        "sys.meta_path.insert(0, Slow())\nentry.main()\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True, preexec_fn=heard,
    )  # fmt: skip
    assert process.stdout.readline() == "loading\n"
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=50)
    assert (process.returncode, err) == (130, "interrupted: nothing was begun yet\n")


def test_a_command_that_is_killed_leaves_no_word_of_semaphores(tmp_path):
    code = (
        "from gpsim.workers import begin_worker, worker_pool\n"
        "    with worker_pool(2, begin_worker, os.getpid()) as pool:\n"
        "        pool.submit(os.getpid).result(); os.kill(os.getpid(), signal.SIGKILL)"
    )
    ended = commanded(code)
    assert (ended.returncode, ended.stderr) == (2, f"{KILLED}\n")
    time.sleep(0.5)
