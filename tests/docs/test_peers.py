"""The command that runs gpsim beside its peers: it ends well where they are absent, and its page is what its cells say."""

import importlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gpsim.trials.worlds import SYSTEMS, dynamics

ROOT = Path(__file__).resolve().parents[2]
NOBODY = "no_such_package_of_a_peer"


@pytest.fixture
def peers(monkeypatch):
    """benchmarks/peers.py, which stands beside what it imports."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return importlib.import_module("peers")


def command(*words, **more):
    call = [sys.executable, str(ROOT / "benchmarks" / "peers.py"), *words]
    return subprocess.run(call, capture_output=True, text=True, check=False, timeout=120, **more)


def test_it_helps_and_refuses_a_name_that_is_none(tmp_path):
    helped = command("--help", cwd=tmp_path)
    assert (helped.returncode, helped.stderr) == (0, "")
    assert "--keep" in helped.stdout
    refused = command("--ground", "nowhere", cwd=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr.splitlines()[-1].endswith(
        "no ground or peer is called nowhere; --list says which there are"
    )


def test_without_recordings_it_says_so_in_a_line_and_ends_well(tmp_path):
    words = ("--ground", "emps", "--peer", "pysindy", "--recordings", str(tmp_path), "--out", "found")
    ended = command(*words, cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    first, counted, told = ended.stdout.splitlines()
    assert first.startswith("emps: ")
    assert counted == "1 cells, 0 of them done already"
    assert "emps pysindy seed 0 ... absent: " in told
    cell = json.loads((tmp_path / "found" / "emps" / "pysindy-0.json").read_text())
    assert (cell["status"], cell["processor_s"]) == ("absent", 0.0)


def test_a_peer_that_is_not_installed_is_told_in_a_line_and_asked_again_when_it_is(peers, tmp_path, capsys):
    contract = importlib.import_module("peer_grounds.contract")

    def run(task):
        raise AssertionError("it is not there")

    peer = contract.Peer("tiny-peer", "Tiny", run, "black box", needs=(NOBODY,))
    ground = contract.Ground("tiny", "Tiny", "nothing trains", "RMSE", ("RMSE",), (peer,))
    for again, count in ((False, 1), (False, 0), (True, 1)):
        peers.play([(ground, peer, 0)], tmp_path, again)
        lines = capsys.readouterr().out.splitlines()
        said = [
            line for line in lines if f"tiny tiny-peer seed 0 ... absent: not installed: {NOBODY};" in line
        ]
        assert (len(said), len(lines)) == (count, count + 1)
    cell = json.loads((tmp_path / "tiny" / "tiny-peer-0.json").read_text())
    assert cell["versions"][NOBODY] == "not installed"
    page = importlib.import_module("peer_grounds.page")
    assert f"| Tiny | absent: not installed: {NOBODY} | | |" in page.words([ground], [cell])


def test_the_page_is_what_the_cells_say(peers, tmp_path):
    """To the byte; the figure hangs on the version that draws it, and is the same twice."""
    page = importlib.import_module("peer_grounds.page")
    cells, known = json.loads(peers.KEPT.read_text(encoding="utf-8")), list(peers.grounds().values())
    drawn = []
    for name in ("once", "twice"):
        for folder in ("method", "images"):
            (tmp_path / name / "docs" / folder).mkdir(parents=True)
        made, figure = page.write_page(tmp_path / name, known, cells)
        assert made.read_bytes() == (ROOT / "docs" / "method" / "peers.md").read_bytes()
        drawn.append(figure.read_bytes())
    assert drawn[0] == drawn[1]


@pytest.mark.parametrize("system", ["slider", "pendulum", "cartpole"])
def test_mujoco_is_given_the_machines_that_the_worlds_have(peers, system):
    """Accelerations of the written model are those of the equations of motion, in any state."""
    mujoco = pytest.importorskip("mujoco")
    text = importlib.import_module("peer_grounds.worlds_sysid").model_text
    rng, known = np.random.default_rng(1), SYSTEMS[system]
    numbers = {name: float(rng.uniform(*ends)) for name, ends in known.parameters.items()}
    model = mujoco.MjModel.from_xml_string(text(system, numbers, 0.01, "rk4"))
    data = mujoco.MjData(model)
    for state in rng.normal(size=(5, len(known.state))):
        push = rng.normal(size=1)
        data.qpos[:], data.qvel[:], data.ctrl[:] = state[0::2], state[1::2], push
        mujoco.mj_forward(model, data)
        inverse, force = dynamics(system, numbers, state[None], push[None])
        np.testing.assert_allclose(data.qacc, inverse[0] @ force[0], rtol=1e-6, atol=1e-9)
