"""The command line as a person meets it."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from cli_calls import called

GPSIM = [sys.executable, "-m", "gpsim.cli.main"]
LONG = 300 * "a"
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


@pytest.fixture
def gpsim(monkeypatch, capfd):
    monkeypatch.setenv("COLUMNS", "100")
    return lambda *words: called(monkeypatch, capfd, *words)


def test_help_is_one_line_a_command_at_80_columns(gpsim, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    _, shown, _ = gpsim("--help")
    panels = shown[shown.index("Stages, in order") :].splitlines()
    lines = [line for line in panels if line.startswith("│")]
    assert len(lines) == 22
    for line in lines:
        assert re.match(r"│ [a-z-]+ +[A-Z].*\. +│$", line), line


def test_the_config_folder_is_kept_in_commands(gpsim):
    Path("cfg/gp").mkdir(parents=True)
    Path("cfg/gp/mine.yaml").write_text("n_train: 12\ninputs: [x]\n")
    for command in ("diagnose", "report", "fit-gp"):
        code, _, err = gpsim(command, "gp=mine", "--config-dir", "cfg")
        assert code == 2
        assert re.search(r"make it with: gpsim [\w-]+ gp=mine --config-dir=cfg ", err)
    code, out, _ = gpsim("diagnose", "gp=mine", "--config-dir", "cfg", "--show-config")
    assert code == 0
    assert "n_train: 12" in out


def test_help_lists_the_stages_in_order(gpsim):
    code, shown, _ = gpsim("--help")
    assert code == 0
    places = [shown.index(f"│ {name} ") for name in ORDER]
    assert places == sorted(places)
    assert gpsim("run", "--help")[1].count("full-loop") == 1
    assert gpsim("--version")[1].startswith("gpsim ")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["fit-gp", "gp.n_trian=5"],
            "error: no setting 'gp.n_trian' (did you mean gp.n_train?); gp has: n_train",
        ),
        (
            ["collect", "experiment=cartpol"],
            "error: no 'cartpol' among the choices of experiment (did you mean 'cartpole'?); there are: cartpole",
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
        (
            ["run", "full-loop", "polcy.gamma=1"],
            "error: no setting 'polcy.gamma' (did you mean policy?); --show-config lists all settings",
        ),
        (["evaluate", "evaluate.policies=[Best]"], "error:"),
        (
            ["run", "full-loop", "evaluate.start_seed=-1"],
            "evaluate.start_seed: expected a whole number of at least 0, got -1",
        ),
        (
            ["certify", "evaluate.start_seed=abc"],
            "evaluate.start_seed: expected a whole number of at least 0, got 'abc'",
        ),
        (
            ["run", "full-loop", "evaluate.policies=null"],
            "evaluate.policies: expected a list of texts, as [a, b], got None",
        ),
        (
            ["run", "full-loop", "deploy.safe=true", "evaluate.policies=[Source]"],
            "deploy.policy: 'GP-Sample' is not one of evaluate.policies: Source",
        ),
        (
            ["run", "full-loop", "evaluate.rollouts=0"],
            "evaluate.rollouts: expected a whole number of at least 1, got 0",
        ),
        (["run", "full-loop", "policy=sac"], "policy: this task's actions are discrete; choose policy=ppo"),
        (
            ["run", "full-loop", "policy.observation_scale=[1,2]"],
            "policy.observation_scale: expected 4 positive numbers, or none, got [1.0, 2.0]",
        ),
        (
            ["run", "full-loop", "diagnose.episodes=99"],
            "diagnose.episodes=99: collect.episodes=20 are recorded",
        ),
        (["run", "full-loop", "deployed=x.bag"], "deployed= scores logs of a policy and needs no loop"),
        (["fit-gp", "gp.inputs=[x, sign(x)]"], "gp.inputs=[x, sign(x)]: Hydra cannot read this value"),
        (
            ["fit-gp", "gp.inputs=[x,x_dot"],
            "gp.inputs=[x,x_dot: Hydra cannot read this value; close a list by ]",
        ),
        (["run", "full-loop", "gp.inputs=null"], "gp.inputs: expected a list of texts, as [a, b], got None"),
        (["run", "full-loop", "gp.inputs=[x,speed]"], "no channel 'speed'"),
        (["run", "full-loop", "gp.noise_floor=0"], "gp.noise_floor: bounds of noise_std need 0 < low < high"),
        (["run", "full-loop", "+gp.bounds=3"], "gp: no setting 'bounds'"),
        (["fit-gp", "+sedd=3"], "error: '+sedd=3': nothing reads 'sedd'; settings: seed, runs_dir"),
        (["diagnose", LONG], f"error: {LONG[:80]}...: File name too long"),
        (["import", LONG, "--out", "x"], "File name too long"),
        (["fit-gp", "--config-dir", LONG], "File name too long"),
        (["build-residuals", f"recording={LONG}"], "File name too long"),
        (["run", "full-loop", "sample_noise=3"], "sample_noise: expected true or false, got 3"),
        (["run", "full-loop", "gp.restarts=-1"], "error: gp: restarts must be at least 0, got -1\n"),
        (["run", "full-loop", "gp.patience=0"], "error: gp: patience must be at least 1, got 0\n"),
        (
            ["run", "full-loop", "diagnose.episodes=0"],
            "diagnose.episodes: expected a whole number of at least 1, got 0",
        ),
        (["run", "full-loop", "target=recording"], "target=recording is a log and cannot be driven"),
        (
            ["run", "full-loop", "experiment=limo", "collect.speeds=0"],
            "collect.speeds: expected a whole number of at least 1, got 0",
        ),
        (["collect", "collect.policy=sweep"], "a sweep needs the bounds of speed and turn rate"),
        (
            ["collect", "experiment=limo", "collect.mapping=dart_csv"],
            "collect.mapping=dart_csv needs ",
        ),
        (
            ["run", "full-loop", "experiment=limo", "collect.mapping=dart_csv"],
            "collect.mapping=dart_csv needs ",
        ),
        (
            ["run", "full-loop", "collect.source=nowhere.bag"],
            "collect.source: nowhere.bag: cannot be read (No such file or directory)",
        ),
        (["run", "full-loop", "recording=nowhere"], "error: recording=nowhere: no such folder"),
        (
            ["run", "full-loop", "target=recording", "recording=nowhere"],
            "error: recording=nowhere: no such folder",
        ),
        (
            ["run", "full-loop", "diagnosis=nowhere"],
            "error: nowhere: not an artifact (no such folder); give a folder made by `gpsim diagnose`",
        ),
        (["collect", "collect.source=[]"], "collect.source: name a log, or several as [a.bag, b.bag]"),
        (["collect", "collect.source=3"], "collect.source: expected a list of texts"),
        (["evaluate", "experiment=limo", "deployed=[]"], "deployed: name a log, or several"),
        (["export", "recording", "nowhere", "--out", "x"], "error: nowhere: no such"),
        (["run", "full-loop", "gp.filter=3"], "gp.filter: expected true or false, got 3"),
        (["run", "full-loop", "task.start_range=-1"], "task: start_range must be at least 0, got -1"),
        (["run", "full-loop", "task.max_steps=0"], "task: max_steps must be at least 1, got 0"),
        (["run", "full-loop", "task=goal"], "task goal does not go with simulator cartpole"),
        (["run", "full-loop", "policy.total_steps=0"], "policy: total_steps must be at least 1, got 0"),
        (["run", "full-loop", "policy.n_envs=0"], "policy: n_envs must be at least 1, got 0"),
        (["run", "full-loop", "policy.batch_size=0"], "policy: batch_size must be at least 2, got 0"),
        (["run", "full-loop", "policy.learning_rate=-1"], "policy: learning_rate must be positive, got -1.0"),
        (
            ["run", "full-loop", "policy.hidden=[]"],
            "policy: hidden must name the units of each layer, as [64, 64], got []",
        ),
        (["run", "full-loop", "experiment=limo", "policy.tau=0"], "policy: tau must be positive, got 0.0"),
        (
            ["run", "full-loop", "target=sticking", "target.substeps=0"],
            "target: substeps must be at least 1, got 0",
        ),
        (["run", "full-loop", "target.friction=-3"], "target: friction must be at least 0, got -3"),
        (
            ["run", "full-loop", "target.parameters={}"],
            "target: parameters.gravity must be a positive number, got None",
        ),
        (
            ["run", "full-loop", "target=limo"],
            "target limo does not go with simulator cartpole: its state is (x [m], y [m], yaw [rad])",
        ),
        (
            ["run", "full-loop", "simulator.parameters=null"],
            "simulator.parameters: expected a mapping of numbers, got None",
        ),
        (["run", "full-loop", "simulator.name=3"], "simulator.name: expected a text, got 3"),
        (
            ["run", "full-loop", "collect.changes=null"],
            "collect.changes: expected a list of texts, as [a, b], got None",
        ),
        (
            ["run", "full-loop", "collect.episodes=-1"],
            "collect.episodes: expected a whole number of at least 1, got -1",
        ),
        (
            ["run", "full-loop", "residuals.test_fraction=1"],
            "residuals.test_fraction: expected a number in [0, 1), got 1",
        ),
        (
            ["run", "full-loop", "experiment=limo", "task.goal_radius=2"],
            "task: goal_radius 2 m leaves no room in the arena",
        ),
        (
            ["run", "full-loop", "experiment=limo", "task.evaluation_goal=[1]"],
            "task: evaluation_goal must be two numbers, got [1.0]",
        ),
        (["collect", "collect.policy=random", "runs_dir=/proc/nothing"], "cannot be made"),
    ],
)
def test_mistakes_end_in_one_line_and_exit_code_2(gpsim, words, message):
    code, out, err = gpsim(*words)
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert list(Path().iterdir()) == []


def test_no_traceback_from_the_installed_program(tmp_path):
    words = [*GPSIM, "fit-gp"]
    ended = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert ended.returncode == 2
    assert ended.stderr.startswith("error: ")
    assert ended.stderr.count("\n") == 1


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full")
def test_a_full_disk_behind_the_output_is_one_line(tmp_path):
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(
            [*GPSIM, "collect", "--show-config"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            cwd=tmp_path,
            check=False,
        )
    assert (ended.returncode, ended.stderr) == (2, "error: output: No space left on device\n")


def test_show_config_prints_and_stops(gpsim):
    code, out, _ = gpsim("fit-gp", "gp.n_train=500", "seed=3", "--show-config")
    assert code == 0
    assert "n_train: 500" in out
    assert "seed: 3" in out
    assert list(Path().iterdir()) == []


def test_stages_one_by_one_reuse_refuse_and_name_faults(gpsim):
    tiny = ["budget=smoke", "policy.total_steps=640"]
    assert gpsim("train-source", *tiny)[1] == "train-source: runs/cartpole/train-source/v0001\n"
    assert "already there" in gpsim("train-source", *tiny)[1]
    assert gpsim("collect", *tiny)[0] == 0
    assert gpsim("build-residuals", *tiny)[0] == 0
    assert gpsim("fit-gp", *tiny, "--out", "mine")[1].startswith("fit-gp: mine")
    assert Path("mine/manifest.json").is_file()
    assert "exists already" in gpsim("fit-gp", *tiny, "--out", "mine")[2]

    recording = Path("runs/cartpole/collect/v0001/recording.parquet")
    content = bytearray(recording.read_bytes())
    content[len(content) // 2] ^= 1
    recording.write_bytes(bytes(content))
    code, _, err = gpsim("build-residuals", *tiny, "seed=0")
    assert code == 2
    assert "recording.parquet: changed after it was written" in err


def test_a_recording_of_ones_own(gpsim):
    """A folder with CSV and YAML that gpsim did not make is enough to build residuals from; faults are located."""
    folder = Path("mine")
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
    assert gpsim(*words)[0] == 0
    table.write_text(table.read_text().replace("1,0.06,0.03", "1,0.06,nan"))
    code, _, err = gpsim(*words)
    assert code == 2
    assert "episode 1, row 12, channel x: nan is not finite" in err
