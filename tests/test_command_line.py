"""Options that every command has, and the other way to call it."""

import subprocess
import sys

import pytest
from gpsim.cli import everywhere, progress
from gpsim.cli.main import main

from gpsim.errors import UsageError

COMMANDS = [
    "", "diagnose", "run", "run full-loop", "report", "collect", "fit-gp", "import", "export", "export policy",
    "export recording", "prove", "prove conceal", "prove diagnose", "prove reveal", "prove answers", "status", "runs",
    "runs list", "runs show", "runs diff", "runs rm", "runs gc",
]  # fmt: skip


def said(monkeypatch, capsys, *words):
    monkeypatch.setattr(sys, "argv", ["gpsim", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code or 0, *capsys.readouterr()


@pytest.mark.parametrize("command", COMMANDS)
def test_h_is_help_and_every_command_can_be_quiet(command, monkeypatch, capsys):
    code, short, _ = said(monkeypatch, capsys, *command.split(), "-h")
    assert (code, short) == said(monkeypatch, capsys, *command.split(), "--help")[:2]
    assert "Usage" in short
    assert "--quiet" in short
    assert "-q" in short


def test_help_waits_for_no_library():
    code = (
        "import sys; from gpsim.cli.main import main\n"
        "sys.argv = ['gpsim', '--help']\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'torch', 'scipy', 'matplotlib', 'pandas', 'hydra', 'omegaconf', 'yaml'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr


def test_the_package_runs_as_the_command_does():
    ended = subprocess.run(
        [sys.executable, "-m", "gpsim", "--version"], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith("gpsim ")
    wrong = subprocess.run(
        [sys.executable, "-m", "gpsim", "diagnose", "nowhere"], capture_output=True, text=True, check=False
    )
    assert wrong.returncode == 2
    assert wrong.stderr.startswith("error: nowhere: no such recording")


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("diagnose {0}/cartt.csv", "cart.csv"),
        ("import {0}/cartt.csv --inspect", "cart.csv"),
        ("diagnose {0}/cart.csv --simulator cartpol", "'cartpole'"),
    ],
)
def test_what_was_meant_is_said(words, meant, tmp_path, monkeypatch, capsys):
    (tmp_path / "cart.csv").write_text("t\n0\n")
    code, _, err = said(monkeypatch, capsys, *words.format(tmp_path).split())
    assert code == 2
    assert f"{meant}?)" in err.partition("did you mean")[2]


@pytest.mark.parametrize("words", ["diagnose -q nowhere", "-q diagnose nowhere", "diagnose nowhere --quiet"])
def test_a_quiet_command_still_says_its_errors(words, monkeypatch, capsys):
    code, out, err = said(monkeypatch, capsys, *words.split())
    assert (code, out) == (2, "")
    assert err.startswith("error: nowhere: no such recording")


@pytest.mark.parametrize(
    ("words", "quiet"),
    [("diagnose -q", True), ("-q diagnose", True), ("diagnose --quiet", True), ("diagnose", False)],
)
def test_quiet_is_heard_wherever_it_stands_and_ends_with_its_command(words, quiet, monkeypatch, capsys):
    def ask(task):
        raise UsageError(f"quiet: {everywhere.QUIET.get()}")

    monkeypatch.setattr("gpsim.stages.diagnose.open_recording", ask)
    _, _, err = said(monkeypatch, capsys, *words.split(), "drive")
    assert err == f"error: quiet: {quiet}\n"
    assert not everywhere.QUIET.get()


def test_a_result_is_printed_though_quiet(monkeypatch, capsys):
    _, out, _ = said(monkeypatch, capsys, "-q", "run", "-q", "full-loop", "-q", "--show-config")
    assert "experiment: cartpole" in out


def test_quiet_before_a_step_of_the_proof_is_no_stray_option(monkeypatch, capsys):
    code, _, err = said(monkeypatch, capsys, "prove", "-q", "answers", "nowhere")
    assert code == 2
    assert "no answers below" in err


@pytest.mark.parametrize("quiet", [False, True])
def test_progress_and_notes_are_what_is_left_out(quiet, monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    token = everywhere.QUIET.set(quiet)
    try:
        with progress.Board() as board:
            board.update("a", 0, 10, "begins")
            now[0] = 60.0
            board.update("a", 5, 10, "half")
            board.finish("a", "made a")
        progress.note("finished")
    finally:
        everywhere.QUIET.reset(token)
    assert capsys.readouterr().err.splitlines() == (
        [] if quiet else ["  a: 50 %, about 1 min left, half", "made a", "finished"]
    )


@pytest.mark.parametrize("where", ["gpsim.cli.options.split_words", "gpsim.cli.main.app"])
def test_an_interruption_is_said_though_quiet(monkeypatch, capsys, where):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(where, interrupted)
    code, _, err = said(monkeypatch, capsys, "diagnose", "x", "--quiet")
    assert (code, err) == (130, f"{progress.INTERRUPTED}\n")


def test_little_is_loaded_before_an_interruption_is_heard():
    """Until then Ctrl-C is a traceback: the package and the file that starts a command import next to nothing."""
    code = "import sys; before = set(sys.modules); import gpsim.cli.entry; print(*sorted(set(sys.modules) - before))"
    loaded = subprocess.run([sys.executable, "-S", "-c", code], capture_output=True, text=True, check=False)
    if "gpsim" not in loaded.stdout.split():  # installed in a way that needs `site`
        loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"tempfile", "urllib", "subprocess", "importlib.resources"} & set(loaded.stdout.split())
