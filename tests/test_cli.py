"""The command line as a person meets it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from gpsim.cli.main import main

GPSIM = [sys.executable, "-m", "gpsim.cli.main"]
ORDER = [
    "train-source",
    "collect",
    "build-residuals",
    "fit-gp",
    "train-gp-policy",
    "certify",
    "evaluate",
    "report",
    "run",
]


def gpsim(*words, cwd, **env):
    return subprocess.run(
        [*GPSIM, *words],
        capture_output=True,
        text=True,
        cwd=cwd,
        env={**os.environ, "COLUMNS": "100", **env},
        check=False,
    )


def test_help_lists_the_stages_in_order(tmp_path):
    shown = gpsim("--help", cwd=tmp_path)
    assert shown.returncode == 0
    places = [shown.stdout.index(f"│ {name} ") for name in ORDER]
    assert places == sorted(places)
    assert gpsim("run", "--help", cwd=tmp_path).stdout.count("full-loop") == 1
    assert gpsim("--version", cwd=tmp_path).stdout.startswith("gpsim ")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["fit-gp", "gp.n_trian=5"], "error: no setting 'gp.n_trian'; gp has: n_train"),
        (
            ["collect", "experiment=cartpol"],
            "error: no 'cartpol' among the choices of experiment; there are: cartpole",
        ),
        (
            ["train-source", "variant=sauce"],
            "error: variant: 'sauce' is not one of source, randomised, target",
        ),
        (["train-source", "seed=x"], "error: seed: expected a whole number of at least 0, got 'x'"),
        (["collect", "seed=3"], "make it with: gpsim train-source seed=3 variant=source"),
        (["fit-gp", "experiment=cartpole"], "make it with: gpsim"),
        (["build-residuals", "recording=nowhere"], "error: recording=nowhere: no such folder"),
        (["collect", "collect.source=nowhere.bag"], "error: nowhere.bag: no such file or folder"),
        (["run", "full-loop", "polcy.gamma=1"], "error: no setting 'polcy.gamma'; the top level has:"),
        (["evaluate", "evaluate.policies=[Best]"], "error:"),
    ],
)
def test_mistakes_end_in_one_line_and_exit_code_2(tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["gpsim", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    shown = capsys.readouterr()
    assert message in shown.err
    assert shown.err.count("\n") == 1
    assert shown.out == ""
    assert list(tmp_path.iterdir()) == []


def test_no_traceback_from_the_installed_program(tmp_path):
    ended = gpsim("fit-gp", cwd=tmp_path)
    assert ended.returncode == 2
    assert ended.stderr.startswith("error: ")
    assert ended.stderr.count("\n") == 1


def test_show_config_prints_and_stops(tmp_path):
    shown = gpsim("fit-gp", "gp.n_train=500", "seed=3", "--show-config", cwd=tmp_path)
    assert shown.returncode == 0
    assert "n_train: 500" in shown.stdout
    assert "seed: 3" in shown.stdout
    assert list(tmp_path.iterdir()) == []


def test_stages_one_by_one_reuse_refuse_and_name_faults(tmp_path):
    tiny = ["budget=smoke", "policy.total_steps=640"]
    made = gpsim("train-source", *tiny, cwd=tmp_path)
    assert made.stdout == "train-source: runs/cartpole/train-source/v0001\n"
    assert "already there" in gpsim("train-source", *tiny, cwd=tmp_path).stdout
    assert gpsim("collect", *tiny, cwd=tmp_path).returncode == 0
    assert gpsim("build-residuals", *tiny, cwd=tmp_path).returncode == 0
    out = gpsim("fit-gp", *tiny, "--out", "mine", cwd=tmp_path)
    assert out.stdout.startswith("fit-gp: mine")
    assert (tmp_path / "mine" / "manifest.json").is_file()
    assert "exists already" in gpsim("fit-gp", *tiny, "--out", "mine", cwd=tmp_path).stderr

    recording = tmp_path / "runs/cartpole/collect/v0001/recording.parquet"
    content = bytearray(recording.read_bytes())
    content[len(content) // 2] ^= 1
    recording.write_bytes(bytes(content))
    refused = gpsim("build-residuals", *tiny, "seed=0", cwd=tmp_path)
    assert refused.returncode == 2
    assert "recording.parquet: changed after it was written" in refused.stderr


def test_a_recording_of_ones_own(tmp_path):
    """A folder with CSV and YAML that gpsim did not make is enough to build residuals from; faults are located."""
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "recording.yaml").write_text(
        "system: cartpole\ndt: 0.02\nstate: {x: m, x_dot: m/s, theta: rad, theta_dot: rad/s}\naction: {force: N}\n"
    )
    rows = [
        f"{e},{0.02 * k},{0.01 * k},{0.5 + e},{0.001 * k * k},{0.1 * k},{10 - 20 * (k % 2)}"
        for e in (0, 1, 2)
        for k in range(9)
    ]
    table = folder / "recording.csv"
    table.write_text("episode,t,x,x_dot,theta,theta_dot,force\n" + "\n".join(rows) + "\n")
    words = ["build-residuals", "recording=mine"]
    assert gpsim(*words, cwd=tmp_path).returncode == 0
    table.write_text(table.read_text().replace("1,0.06,0.03", "1,0.06,nan"))
    ended = gpsim(*words, cwd=tmp_path)
    assert ended.returncode == 2
    assert "episode 1, row 12, channel x: nan is not finite" in ended.stderr
    assert Path("runs") not in list(tmp_path.iterdir())
