"""Odd places to run in: a user without a home, a terminal of ASCII alone, a backend that nobody knows; odd names."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gpsim.errors import UsageError
from gpsim.recordings import read_recording

ASCII = {"LC_ALL": "C", "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
NOBODY = """
import os, pwd, sys
for name in ("HOME", "USER", "LOGNAME", "USERNAME", "LNAME"):
    os.environ.pop(name, None)
def unknown(*_):
    raise KeyError("getpwuid(): uid not found: 54321")
pwd.getpwuid = unknown
"""
COMMAND = "from gpsim.cli.main import main\nsys.argv[0] = 'gpsim'\nmain()\n"


def table(folder):
    t = np.arange(100) * 0.02
    rows = [
        f"{a:.2f},{b:.6f},{c:.6f},0\n" for a, b, c in zip(t, np.cos(4 * t), -4 * np.sin(4 * t), strict=True)
    ]
    (folder / "swing.csv").write_text("t,theta,theta_dot,torque\n" + "".join(rows))


def called(*words, before="import sys\n", **environment):
    cleared = {k: v for k, v in os.environ.items() if k not in ("MPLBACKEND", "PYTHONUTF8")}
    return subprocess.run(
        [sys.executable, "-c", before + COMMAND, *words],
        capture_output=True,
        check=False,
        env=cleared | environment,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "environment"),
    [
        ("import sys\n", {"MPLBACKEND": "nosuch"}),
        (NOBODY, {"XDG_CACHE_HOME": "", "MPLCONFIGDIR": ""}),
        ("import sys\n", ASCII),
    ],
    ids=["backend", "nobody", "ascii"],
)
def test_a_recording_is_drawn_there(tmp_path, before, environment):
    table(tmp_path)
    words = (
        "import swing.csv --simulator pendulum --out rec theta=theta theta_dot=theta_dot torque=torque t=t"
    )
    ended = called(*words.split(), before=before, **environment)
    assert ended.returncode == 0, ended.stderr.decode(errors="replace")
    assert b"Traceback" not in ended.stderr
    assert list((tmp_path / "rec").rglob("*.png"))


def test_kernels_find_a_place_without_a_home():
    code = "from pathlib import Path; from gpsim.kernels import compiling\n"
    code += "compiling.ROOM = Path('/proc'); print(compiling.folder()); print(compiling.folder())"
    ended = subprocess.run(
        [sys.executable, "-c", NOBODY + code], capture_output=True, text=True, check=False,
        env={k: v for k, v in os.environ.items() if k not in ("XDG_CACHE_HOME", "NUMBA_CACHE_DIR")},
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    first, second = ended.stdout.splitlines()
    assert first == second
    facts = Path(first).stat()
    assert (facts.st_uid, facts.st_mode & 0o022) == (os.getuid(), 0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ("--help",),
        ("diagnose", "n\u00f6where\u2028\u2713", "--simulator", "pendulum"),
        ("simulators", "show", "pendulum"),
        ("runs", "list"),
        ("fit-gp", "gp.n_tr\u00e4in=3"),
        ("diagnose", "swing.csv", "--simulator", "p\u00e9ndulum"),
    ],
)
def test_a_terminal_of_ascii_alone_gets_ascii(tmp_path, words):
    table(tmp_path)
    ended = called(*words, **ASCII)
    assert ended.returncode in (0, 2)
    assert (ended.stdout + ended.stderr).isascii()
    assert b"Traceback" not in ended.stderr
    if ended.returncode == 2:
        assert ended.stderr.count(b"\n") == 1
        assert ended.stderr.startswith(b"error: ")


ODD = ["a\x1b[2J", "a\nerror: b", "a\r\x00", "a\u202eb", "a\x9b31m"]


@pytest.mark.parametrize("name", ODD)
def test_names_from_data_do_not_reach_the_terminal_as_they_are(tmp_path, name, monkeypatch, capsys):
    from gpsim.cli.main import main

    folder = tmp_path / "rec"
    folder.mkdir()
    quoted = '"' + name.replace("\x00", "") + '"'
    (folder / "recording.csv").write_bytes(f"episode,t,{quoted}\n0,0,1\n0,1,2\n".encode())
    key = '"' + name.encode("unicode_escape").decode() + '"'
    (folder / "recording.yaml").write_text(f"system: pendulum\ndt: 1\nstate: {{{key}: rad}}\naction: {{}}\n")
    monkeypatch.setattr(sys, "argv", ["gpsim", "diagnose", "rec", "--simulator", "pendulum"])
    with pytest.raises(SystemExit) as ended:
        main()
    out, err = capsys.readouterr()
    assert ended.value.code == 2
    assert err.count("\n") == 1
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u202e]", out + err)


@pytest.mark.parametrize("name", ODD)
def test_a_message_is_one_printable_line(name):
    said = str(UsageError(f"channel {name}: is dead"))
    assert said.isprintable()
    assert said.startswith("channel a")
    with pytest.raises(UsageError) as refused:
        read_recording(Path("/nowhere") / name.replace("\x00", ""))
    assert str(refused.value).isprintable()
