"""Code that only data name does not run: refused in one line, until the user names it or says --trust."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from cli_calls import called
from made_diagnoses import made_diagnosis

import gpsim
from gpsim import trust
from gpsim.artifacts import Recipe, Store
from gpsim.corrected import EffectsPlant, describe
from gpsim.errors import UsageError
from gpsim.files import file_digest, write_json
from gpsim.recordings import Episode, Recording, write_recording
from gpsim.simulators import make_simulator
from gpsim.workers import begin_worker, worker_pool

SYSTEM = """
from pathlib import Path
Path({ran!r}).touch()

class Slider:
    state = {{"q": "m", "q_dot": "m/s"}}
    action = {{"force": "N"}}
    parameters = {{"mass": ("kg", 2.0, 0.1, 10.0)}}
    coordinates = {{"q": "q_dot"}}

    def rates(self, state, action, p, forces):
        return {{"q_dot": (action["force"] + forces["q"]) / p["mass"]}}

def robot():
    raise ValueError("it was called")
"""
REFUSED = "would run with your rights, and only data name this version"


@pytest.fixture(autouse=True)
def config(tmp_path, monkeypatch):
    """The user's settings, of which nothing is known yet; nor does this process know what others have allowed."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setattr(trust, "allowed", set())
    return tmp_path / "config" / "gpsim"


@pytest.fixture
def ran(tmp_path):
    return tmp_path / "ran"


@pytest.fixture
def evil(tmp_path, ran):
    """A stranger's file."""
    path = tmp_path / "evil.py"
    path.write_text(SYSTEM.format(ran=str(ran)))
    return path


def recorded(folder: Path, system: str, model: str | None = None) -> Path:
    """A recording of a slider that names this system."""
    known = make_simulator("slider")
    t, rng = 0.02 * np.arange(61), np.random.default_rng(0)
    states = np.stack([0.1 * np.sin(t), 0.1 * np.cos(t)], axis=1)
    episodes = tuple(Episode(str(i), t, states, rng.normal(size=(60, 1))) for i in range(2))
    folder.mkdir()
    made = Recording(system, known.state, known.action, episodes, 0.02, {}, model=model)
    write_recording(made, folder, "csv")
    return folder


@pytest.fixture
def recording(tmp_path, evil):
    return recorded(tmp_path / "recording", f"{evil}:Slider")


@pytest.fixture
def diagnosis(tmp_path, evil, recording):
    """A diagnosis that corrects a system in the stranger's file."""
    known = make_simulator("slider")
    plant = EffectsPlant(known, known.defaults(), (), "euler", 1, 0.02)

    def write(folder: Path):
        write_json(folder / "diagnosis.json", made_diagnosis(verdict="partial").to_dict())
        write_json(folder / "corrected.json", describe(plant, gp=False) | {"simulator": f"{evil}:Slider"})
        return {}

    said = {
        "recording": {path.name: file_digest(path) for path in recording.iterdir()},
        "simulator": f"{evil}:Slider",
        "simulator_file": file_digest(evil),
        "episodes": None,
    }
    return Store(tmp_path, "any").publish(Recipe("diagnose", said, {}, {}), write).path


NEEDING = [
    "diagnose recording --dry-run",
    "diagnose recording --out out",
    "diagnose new --score DIR --dry-run",
    "diagnose new --score DIR --out out",
    "export model DIR --out out",
    "export diagnosis DIR --mcap --recording recording --out out",
    "train-gp-policy diagnosis=DIR correction=effects",
    "plan DIR --out out",
    "watch recording --diagnosis DIR --once",
]
"""Commands that cannot do without the simulator."""


@pytest.mark.parametrize("words", NEEDING)
def test_no_command_runs_what_only_data_name(words, recording, diagnosis, ran, tmp_path, monkeypatch, capfd):
    recorded(tmp_path / "new", "slider")
    code, _, err = called(monkeypatch, capfd, *words.replace("DIR", str(diagnosis)).split())
    assert code == 2
    [line] = err.splitlines()
    assert line.startswith("error:")
    assert f"evil.py {REFUSED}" in line
    assert "--trust" in line
    assert "--trust (in Python trust=True), or --simulator" in line
    assert not ran.exists()
    assert not Path("out").exists()


@pytest.mark.parametrize(
    "words",
    [
        "status diagnosis=DIR correction=effects",
        "status recording=recording",
        "train-gp-policy diagnosis=DIR correction=effects --dry-run",
        "report diagnosis=DIR correction=effects",
        "runs list",
        "export recording recording --format csv --out out",
    ],
)
def test_nor_does_one_that_only_looks(words, recording, diagnosis, ran, monkeypatch, capfd):
    _, _, err = called(monkeypatch, capfd, *words.replace("DIR", str(diagnosis)).split())
    assert "Traceback" not in err
    assert not ran.exists()


def test_nor_does_one_that_reads_a_log_by_a_strangers_mapping(recording, evil, ran, monkeypatch, capfd):
    mapping = {
        "system": f"{evil}:Slider",
        "rate": "source",
        "time": {"field": "t"},
        "files": "recording.csv",
        "state": {"q": {"field": "q", "unit": "m"}, "q_dot": {"field": "q_dot", "unit": "m/s"}},
        "action": {"force": {"field": "force", "unit": "N"}},
        "episodes": {"by": "column", "field": "episode"},
    }
    Path("mapping.yaml").write_text(json.dumps(mapping))
    Path("log.csv").write_bytes((recording / "recording.csv").read_bytes())
    code, _, err = called(monkeypatch, capfd, "diagnose", "log.csv", "--mapping", "mapping.yaml")
    assert code == 2
    assert REFUSED in err
    assert not ran.exists()


CALLS = {
    "diagnose": lambda recording, diagnosis, **trust: gpsim.diagnose(recording, **trust),
    "fit_gp": lambda recording, diagnosis, **trust: gpsim.fit_gp(recording, **trust),
    "simulator": lambda recording, diagnosis, **trust: gpsim.Diagnosis.load(diagnosis, **trust).simulator,
    "corrected": lambda recording, diagnosis, **trust: gpsim.Diagnosis.load(diagnosis, **trust).corrected(),
    "score": lambda recording, diagnosis, **trust: gpsim.Diagnosis.load(diagnosis, **trust).score(recording),
    "make_env": lambda recording, diagnosis, **trust: gpsim.make_env(
        diagnosis,
        reward=lambda state, action, after: 0.0,
        starts=[[0.0, 0.0]],
        actions={"force": (-1.0, 1.0)},
        **trust,
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_no_public_function_runs_what_only_data_name(name, recording, diagnosis, ran):
    with pytest.raises(UsageError, match=rf"evil\.py {REFUSED}.*trust=True") as caught:
        CALLS[name](recording, diagnosis)
    assert "\n" not in str(caught.value)
    assert not ran.exists()


@pytest.mark.filterwarnings("ignore:q_acc")  # of the fit
@pytest.mark.parametrize("name", ["simulator", "corrected", "make_env", "fit_gp"])
def test_it_runs_where_it_is_trusted(name, recording, diagnosis, ran):
    assert CALLS[name](recording, diagnosis, trust=True)
    assert ran.exists()


def known(config: Path) -> list[str]:
    return list(json.loads((config / trust.FILE).read_text())["trusted"].values())


def forget() -> None:
    """As in another process."""
    trust.allowed.clear()


@pytest.mark.parametrize("words", ["--trust", "--simulator {}:Slider"])
def test_what_was_allowed_is_remembered_until_it_changes(words, recording, evil, config, monkeypatch, capfd):
    ask = ["diagnose", recording, "--dry-run"]
    assert called(monkeypatch, capfd, *ask)[0] == 2
    assert called(monkeypatch, capfd, *ask, *words.format(evil).split())[0] == 0
    assert known(config) == [str(evil)]
    assert config.stat().st_mode & 0o777 == 0o700
    assert (config / trust.FILE).stat().st_mode & 0o777 == 0o600
    forget()
    assert called(monkeypatch, capfd, *ask)[0] == 0
    forget()
    evil.write_text(evil.read_text() + "# changed\n")
    code, _, err = called(monkeypatch, capfd, *ask)
    assert (code, REFUSED in err) == (2, True)


def test_one_file_that_is_named_is_no_leave_for_another(recording, tmp_path, ran, monkeypatch, capfd):
    """The diagnosis is of the stranger's file, the command line names the user's own."""
    mine = tmp_path / "mine.py"
    mine.write_text(SYSTEM.format(ran=str(tmp_path / "mine_ran")))
    gpsim.load_simulator(f"{mine}:Slider")
    with pytest.raises(UsageError, match=REFUSED):
        gpsim.diagnose(recording)
    assert not ran.exists()


@pytest.mark.parametrize("words", ["simulator.name={}:Slider", "--config-dir own simulator=own"])
def test_settings_and_a_folder_of_settings_are_the_users_own(words, evil, config, monkeypatch, capfd):
    Path("own/simulator").mkdir(parents=True)
    settings = {"name": f"{evil}:Slider", "parameters": {}, "integrator": "euler", "dt": 0.02}
    (Path("own/simulator") / "own.yaml").write_text(json.dumps(settings))
    code, _, err = called(monkeypatch, capfd, "train-source", *words.format(evil).split(), "--show-config")
    assert code == 0, err
    assert known(config) == [str(evil)]


def test_a_function_beside_a_recording_is_not_called(tmp_path, evil, ran, monkeypatch, capfd):
    folder = recorded(tmp_path / "recording", "mjcf", model="evil.py:robot")
    evil.rename(folder / "evil.py")
    code, _, err = called(monkeypatch, capfd, "diagnose", folder, "--dry-run")
    assert code == 2
    assert REFUSED in err
    assert not ran.exists()
    _, _, err = called(monkeypatch, capfd, "diagnose", folder, "--dry-run", "--trust")
    assert "it was called" in err


@pytest.mark.parametrize("name", ["evil_module", "evil_package.inner"])
def test_a_module_that_data_name_is_not_imported(name, tmp_path, ran, config, monkeypatch, capfd):
    """`gym:MODULE:ID` makes Gymnasium import MODULE; the packages above it run first."""
    file = tmp_path / "modules" / name.replace(".", "/")
    file.parent.mkdir(parents=True)
    first = file.parent / "__init__.py" if "." in name else file.with_suffix(".py")
    file.with_suffix(".py").touch()
    first.write_text(f"from pathlib import Path\nPath({str(ran)!r}).touch()\n")
    monkeypatch.syspath_prepend(tmp_path / "modules")
    folder = recorded(tmp_path / "recording", "mjcf", model=f"gym:{name}:Any-v0")
    ask = ["diagnose", folder, "--dry-run"]
    code, _, err = called(monkeypatch, capfd, *ask)
    assert code == 2
    assert f"the module {name} {REFUSED}" in err
    assert not ran.exists()
    first.write_text(f"{first.read_text()}# changed\n")
    assert REFUSED not in called(monkeypatch, capfd, *ask, "--simulator", f"gym:{name}:Any-v0")[2]
    assert ran.exists()
    assert known(config) == [f"module {name}"]
    forget()
    assert REFUSED not in called(monkeypatch, capfd, *ask)[2]
    forget()
    first.write_text(f"{first.read_text()}# changed again\n")
    assert REFUSED in called(monkeypatch, capfd, *ask)[2]


@pytest.mark.parametrize("how", ["writable", "link", "another's", "no JSON"])
def test_what_others_may_have_written_is_not_believed(how, recording, evil, ran, config, monkeypatch, capfd):
    kept = config / trust.FILE
    trust.consent(f"{evil}:Slider")
    forget()
    if how == "writable":
        kept.chmod(0o666)
    elif how == "link":
        kept.rename(config / "elsewhere")
        kept.symlink_to(config / "elsewhere")
    elif how == "another's":
        uid = os.getuid()
        monkeypatch.setattr(os, "getuid", lambda: uid + 1)
    else:
        kept.write_text("{")
    code, _, err = called(monkeypatch, capfd, "diagnose", recording, "--dry-run")
    assert code == 2
    assert "earlier permissions cannot be read" in err
    assert not ran.exists()


def of_the_file(reference: str) -> tuple[str, ...]:
    return make_simulator(reference).state.names


def test_workers_may_run_what_their_parent_may_though_nothing_can_be_kept(evil, tmp_path):
    (tmp_path / "config").write_text("a file, not a folder")
    (tmp_path / "other.py").write_text(SYSTEM.format(ran=str(tmp_path / "other_ran")))
    trust.consent(f"{evil}:Slider")
    with worker_pool(1, begin_worker, os.getpid()) as pool:
        assert pool.submit(of_the_file, f"{evil}:Slider").result() == ("q", "q_dot")
        with pytest.raises(UsageError, match=REFUSED):
            pool.submit(of_the_file, f"{tmp_path}/other.py:Slider").result()
    assert not (tmp_path / "other_ran").exists()


def test_a_mujoco_model_loads_no_library_that_it_names(tmp_path):
    """`plugin` names what is loaded already; a file of that name is never opened."""
    pytest.importorskip("mujoco")
    library = tmp_path / "evil.so"
    library.write_bytes(b"")
    model = tmp_path / "robot.xml"
    plugin = f'<extension><plugin plugin="{library}"/></extension>'
    model.write_text(f"<mujoco>{plugin}<worldbody/></mujoco>")
    with pytest.raises(UsageError, match=r"plugin .*evil\.so not found"):
        gpsim.load_simulator(str(model))
