"""Wrong inputs through the command: one line, exit code 2, no traceback, and it says what to do."""

import shutil
from pathlib import Path

import pytest

CART = Path(__file__).resolve().parents[2] / "data" / "cart.csv"
ROWS = range(60)
TRIED = [
    # a slip of the pen in a command, an option, a value
    ("diagnos data/cart.csv", "gpsim: no such command 'diagnos' (did you mean 'diagnose'?); gpsim -h lists them"),
    ("compare a b", "gpsim: no such command 'compare'; gpsim -h lists them"),
    ("export data", "gpsim export: no such command 'data'; there are: diagnosis, model, policy, recording"),
    ("effects shw spring", "gpsim effects: no such command 'shw' (did you mean 'show'?); there are: check, list, new, show"),
    ("run experiment=cartpole", "gpsim run: no such command 'experiment=cartpole'; there are: full-loop, iterate"),
    ("diagnose data/cart.csv --simulater cartpole", "gpsim diagnose: no such option: --simulater (did you mean '--simulator'?)"),
    ("watch slider.csv --simulator slider --diagnosis found", "gpsim watch: no such option: --simulator; gpsim watch -h lists its options"),
    ("diagnose slider.csv --cores 0", "gpsim diagnose: invalid value for '--cores': "),
    ("certify --out", "option '--out' requires an argument"),
    ("export policy", "gpsim export policy: missing argument 'PATH'; gpsim export policy -h lists its options"),
    ("--nooption", "gpsim: no such option: --nooption"),
    ("diagnose data/cart.csv --simulator cartpol", "unknown simulator 'cartpol' (did you mean 'cartpole'?)"),
    ("simulators show slidr", "unknown simulator 'slidr' (did you mean 'slider'?)"),
    ("effects show viscos_friction", "(did you mean 'viscous_friction'?); `gpsim effects list` names all"),
    # settings
    ("diagnose slider.csv --simulator slider diagnose.serch.beam=1", "no setting 'diagnose.serch.beam'; diagnose.search: was removed"),
    ("diagnose slider.csv --simulator slider diagnose.windos.fewest=9", "(did you mean diagnose.windows?)"),
    ("diagnose slider.csv --simulator slider diagnose.families.only=[viscos_friction]", "(did you mean 'viscous_friction'?)"),
    ("diagnose slider.csv --simulator slider seed=x", "seed: expected a whole number of at least 0, got 'x'"),
    ("diagnose slider.csv --simulator slider gp.x=1", "gp.x=1: not used with a RECORDING; valid settings: "),
    ("evaluate experiment=smok", "no 'smok' among the choices of experiment (did you mean budget=smoke?); there are: "),
    ("evaluate experimnt=limo", "no setting 'experimnt' (did you mean experiment?)"),
    ("fit-gp gp=rawww", "no 'rawww' among the choices of gp (did you mean 'raw'?); there are: "),
    ("collect collect.episodes=x", "collect.episodes: expected a whole number of at least 1, got 'x'"),
    ("train-source variant=targett", "variant: 'targett' is not one of source, randomised, target"),
    ("sweep seed=1,1 evaluate", "seed=1,1: a value is there twice"),
    ("report data", "'data' is not a setting: write key=value, as gp.n_train=500"),
    # files and folders
    ("diagnose data/cartt.csv", "data/cartt.csv: no such recording (did you mean data/cart.csv?); give a folder made by `gpsim import`"),
    ("diagnose data/cart.csv --simulator nofile.py:Tank", "no file nofile.py; give FILE.py:ClassName"),
    ("diagnose data/cart.csv --simulator nofile.xml", "no file nofile.xml; give robot.xml, robot.urdf, FILE.py:function or gym:ID"),
    ("diagnose slider.csv --simulator slider --out data/cart.csv", "data/cart.csv: exists already; artifacts are never overwritten, choose another --out"),
    ("import sliderr.csv", "sliderr.csv: does not exist (did you mean slider.csv?)"),
    ("plan nofolder", "nofolder: not an artifact (no such folder); give a folder made by `gpsim diagnose`"),
    ("plan data", "data: not an artifact (no manifest.json); give a folder made by `gpsim diagnose`"),
    ("plan dat", "dat: not an artifact (no such folder (did you mean data?)); give a folder made by `gpsim diagnose`"),
    ("plan", "plan: name the DIAGNOSIS to plan for, as: gpsim plan found --minutes 2"),
    ("watch slider.csv --diagnosis nofolder", "nofolder: not an artifact (no such folder); give a folder made by `gpsim diagnose`"),
    ("diagnose slider.csv --score nofolder", "give a folder made by `gpsim diagnose`; `gpsim runs list` names those in runs/"),
    ("fit-gp recording=nofolder", "recording=nofolder: no such folder; give a recording folder made by `gpsim import`"),
    ("export recording nofolder --out x", "nofolder: no such recording; give a folder with recording.yaml, made by `gpsim import`"),
    ("effects check nofile.py", "nofile.py: no such file of effects; give FILE.py or FILE.py:ClassName"),
    ("runs show nothing", "nothing: no such artifact"),
    # what is in them
    ("import empty.csv", "empty.csv: no rows: it has column names but no rows; record or export it again"),
    ("import empty.csv --inspect", "empty.csv: no rows: it has column names but no rows; record or export it again"),
    ("diagnose empty.csv --simulator slider", "empty.csv: no rows: it has column names but no rows; record or export it again"),
    ("diagnose none.csv --simulator slider", "none.csv: the file is empty; copy it again"),
    ("diagnose text.csv --simulator slider", "text.csv: no column of numbers; give a table with a column for each channel"),
    ("diagnose nan.csv --simulator slider", "nan.csv: episode 0: a value is not a number: could not convert string to float: 'x'"),
    ("diagnose near.csv --simulator slider", "'q_dott' is similar: rename it to q_dot, or clearly differently"),
    ("diagnose bin.bag --simulator slider", "bin.bag: byte 0: not a ROS 1 bag"),
    ("diagnose slider.csv --simulator slider q=nocolumn", "q=nocolumn: no column or topic 'nocolumn'; there are: t, q, q_dot, force"),
    ("diagnose slider.csv --simulator slider nochannel=q", "nochannel=q: no channel of slider; there are: q, q_dot, force, t, dt"),
    ("effects new Bad-Name", "Bad-Name: use lower-case letters, digits and underscores, as rubber_band"),
]  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Tables that cannot be read as what they are given for."""
    here = tmp_path_factory.mktemp("wrong")
    (here / "data").mkdir()
    shutil.copy(CART, here / "data")
    rows = [f"{i * 0.02:.2f},{0.1 * (i * 0.02) ** 2:.5f},{0.2 * i * 0.02:.4f},0.3" for i in ROWS]
    tables = {
        "slider.csv": ["t,q,q_dot,force", *rows],
        "near.csv": ["t,q,q_dott,force", *rows],
        "nan.csv": ["t,q,q_dot,force", *rows[:9], "0.18,x,0,0.3", *rows[10:]],
        "empty.csv": ["t,q,q_dot,force"],
        "text.csv": ["hello", "world"],
    }
    for name, lines in tables.items():
        (here / name).write_text("\n".join([*lines, ""]))
    (here / "none.csv").write_text("")
    (here / "bin.bag").write_bytes(b"\0\1\2" * 100)
    return here


@pytest.mark.parametrize(("words", "said"), TRIED, ids=[words for words, _ in TRIED])
def test_a_wrong_input_is_one_line_that_says_what_to_do(words, said, folder, gpsim, monkeypatch):
    monkeypatch.chdir(folder)
    code, out, err = gpsim(*words.split())
    (line,) = [line for line in err.splitlines() if not line.startswith("warning: ")]
    assert (code, out) == (2, "")
    assert line.startswith("error: ")
    assert len(line) <= 200  # two lines of a terminal
    assert said in line


def test_a_command_without_its_words_is_help(gpsim):
    code, out, err = gpsim("runs")
    assert code == 2
    assert "COMMAND" in out + err
    assert "list" in out + err
