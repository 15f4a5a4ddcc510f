"""Settings: everything resolves, and every mistake is one line with the alternatives."""

import pickle

import pytest
from gpsim.cli.configuration import as_yaml, resolve

from gpsim.errors import UsageError
from gpsim.policies.training.settings import PpoSettings
from gpsim.settings import build
from gpsim.stages.building import base_plant, make_task, target_plant, training_settings


def test_the_thesis_is_the_default():
    config = resolve([], None)
    assert config["experiment"] == "cartpole"
    assert config["policy"]["total_steps"] == 300_000
    assert config["policy"]["n_envs"] == 10
    assert config["gp"]["n_train"] == 250
    assert config["collect"]["episodes"] == 20
    assert config["target"]["friction"] == 0.9
    task = make_task(config)
    assert (task.angle_limit, task.position_limit, task.max_steps) == (0.2, 2.4, 500)
    assert base_plant(config).parameters == {
        "gravity": 9.8,
        "cart_mass": 1.0,
        "pole_mass": 0.1,
        "pole_half_length": 0.5,
    }


def test_overrides_reach_the_objects():
    words = [
        "task.position_limit=null",
        "target=sticking",
        "policy.gamma=0.9",
        "simulator.parameters.cart_mass=2",
        "seed=3",
    ]
    config = resolve(words, None)
    assert make_task(config).position_limit is None
    assert target_plant(config).contact == "stick"
    assert target_plant(config).parameters["cart_mass"] == 2
    assert training_settings(config).gamma == 0.9
    assert config["seed"] == 3
    assert resolve(["gp=raw"], None)["gp"]["inputs"] == ["x", "x_dot", "theta", "theta_dot", "force"]
    assert resolve(["budget=smoke"], None)["policy"]["total_steps"] < 10_000
    assert resolve(["budget=smoke", "policy.total_steps=77"], None)["policy"]["total_steps"] == 77


def test_a_folder_of_ones_own(tmp_path):
    (tmp_path / "gp").mkdir()
    (tmp_path / "gp" / "mine.yaml").write_text("n_train: 12\ninputs: [x]\n")
    assert resolve(["gp=mine"], tmp_path)["gp"] == {"n_train": 12, "inputs": ["x"]}
    with pytest.raises(UsageError, match="no such folder"):
        resolve([], tmp_path / "absent")
    with pytest.raises(
        UsageError, match=r"no setting 'gp.inputz' \(did you mean gp.inputs\?\); gp has: n_train, inputs"
    ):
        resolve(["gp=mine", "gp.inputz=[x]"], tmp_path)


def test_ones_own_choice_wins_over_the_shipped_one_of_that_name(tmp_path):
    folder = tmp_path / "my, [configs]"  # what Hydra's grammar would stumble over
    (folder / "gp").mkdir(parents=True)
    (folder / "gp" / "jump.yaml").write_text("n_train: 12\ninputs: [x]\n")
    assert resolve([], folder)["gp"] == {"n_train": 12, "inputs": ["x"]}
    assert resolve(["gp=raw"], folder)["gp"] == resolve(["gp=raw"], None)["gp"]
    assert resolve([], None)["gp"]["n_train"] == 250
    (folder / "config.yaml").write_text("seed: 1\n")
    with pytest.raises(UsageError, match=r"its config\.yaml would replace all settings"):
        resolve([], folder)


@pytest.mark.parametrize("content", [b"n_train: [1\n x: {\n", b"- 1\n- 2\n", b"\xff\xfe\x00x: 3"])
def test_a_damaged_file_of_ones_own_is_one_line(tmp_path, content):
    (tmp_path / "gp").mkdir()
    (tmp_path / "gp" / "bad.yaml").write_bytes(content)
    with pytest.raises(UsageError, match="gp") as caught:
        resolve(["gp=bad"], tmp_path)
    assert "\n" not in str(caught.value)


def test_a_setting_that_was_taken_away_is_named_where_it_is_read():
    config = pickle.loads(pickle.dumps(resolve(["~evaluate.episodes"], None)))  # as workers get it
    with pytest.raises(UsageError, match="setting 'evaluate.episodes' is missing"):
        _ = config["evaluate"]["episodes"]
    assert config["simulator"]["parameters"]["gravity"] == 9.8


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["experiment=cartpol"],
            "no 'cartpol' among the choices of experiment \\(did you mean 'cartpole'\\?\\); there are: cartpole",
        ),
        (
            ["gp=rau"],
            "no 'rau' among the choices of gp \\(did you mean 'raw'\\?\\); there are: arrived, chained, chained_limo, double_pendulum, jump, observations, observations_limo, raw, sweep$",
        ),
        (["gp.n_trian=5"], r"no setting 'gp.n_trian' \(did you mean gp.n_train\?\); gp has: n_train, "),
        (["sed=3"], r"no setting 'sed' \(did you mean seed\?\); --show-config lists all settings"),
        (["seed.x=3"], "no setting 'seed.x'"),
        (["gp.n_train"], "'gp.n_train' is not a setting: write key=value"),
        (["seed.x=3"], "no setting 'seed.x'; seed is a value"),
        # Beside the user's own choices, not the plain default's.
        (["experiment=limo", "collect.holdd=3"], r"did you mean collect.hold\?.*collect has: "),
        (
            ["experiment=limo", "policy.n_epochs=3"],
            "no setting 'policy.n_epochs'; policy has: .*gradient_steps",
        ),
        (["policy.n_epoch=3", "experiment=limo", "sed=3"], "policy has: .*gradient_steps"),
        (["=3"], "'=3' is not a setting: write key=value"),
        (["gp=null"], "^gp=null: "),
        (["~gp"], "gp: expected settings"),
        (["evaluate=3"], "evaluate: expected settings, as evaluate.key=value, got 3"),
        (["runs_dir="], "runs_dir: expected a text, got ''"),
        (["simulator=[1]"], "."),
        (["gp.inputs.x=3"], "."),
        (["gp.n_train=[1,"], "."),
        (["target.parameters=${nowhere}"], "."),
    ],
)
def test_mistakes_are_one_line(words, message):
    with pytest.raises(UsageError, match=message) as caught:
        resolve(words, None)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["policy.gamma=high"], "policy.gamma: expected a number, got 'high'"),
        (["policy.n_steps=1.5"], "policy.n_steps: expected a whole number, got 1.5"),
        (["policy.hidden=64"], "policy.hidden: expected a list, got 64"),
    ],
)
def test_wrong_values_name_the_key(words, message):
    with pytest.raises(UsageError, match=message):
        training_settings(resolve(words, None))
    with pytest.raises(UsageError, match="target.contact: 'glue' is not one of chatter, stick"):
        target_plant(resolve(["target.contact=glue"], None))
    with pytest.raises(UsageError, match="policy: no setting 'momentum'"):
        build(PpoSettings, {"momentum": 1}, "policy")


def test_the_shown_configuration_is_the_resolved_one():
    assert "friction: 0.9" in as_yaml(resolve([], None))


OWN = """
from gpsim.simulators import CartPole
from gpsim.simulators import Unicycle

class Same(CartPole):
    pass

class Turned:
    state = {"theta": "rad", "theta_dot": "rad/s", "x": "m", "x_dot": "m/s"}
    action = {"force": "N"}

    def rates(self, state, action, p):
        return {name: action["force"] for name in self.state}

class Degrees(Turned):
    state = {"x": "m", "x_dot": "m/s", "theta": "deg", "theta_dot": "rad/s"}

class Plain(Turned):
    state = {"x": "m", "x_dot": "m/s", "theta": "rad", "theta_dot": "rad/s"}

class Car(Unicycle):
    pass
"""


def with_simulator(name, *words):
    config = resolve(list(words), None)
    return {**config, "simulator": {**config["simulator"], "name": name, "parameters": {}}}


@pytest.mark.usefixtures("own_files")
@pytest.mark.parametrize(
    ("name", "experiment"), [("Same", "cartpole"), ("Plain", "cartpole"), ("Car", "limo")]
)
def test_ones_own_simulator_with_the_same_channels_goes_with_target_and_task(tmp_path, name, experiment):
    (tmp_path / "own.py").write_text(OWN)
    config = with_simulator(f"{tmp_path}/own.py:{name}", f"experiment={experiment}")
    config["target"] = resolve([f"experiment={experiment}"], None)["target"]
    assert target_plant(config).state.names == make_task(config).state.names == base_plant(config).state.names


@pytest.mark.usefixtures("own_files")
@pytest.mark.parametrize(
    ("name", "experiment", "has", "needs"),
    [
        ("ackermann", "limo", r"\(v_cmd \[m/s\], steering \[rad\]\)", r"\(v_cmd \[m/s\], w_cmd \[rad/s\]\)"),
        ("Turned", "cartpole", r"\(theta \[rad\], theta_dot .*\)", r"\(x \[m\], x_dot \[m/s\], .*\)"),
        ("Degrees", "cartpole", r"\(.* theta \[deg\], .*\)", r"\(.* theta \[rad\], .*\)"),
    ],
)
def test_columns_that_mean_something_else_are_refused(tmp_path, name, experiment, has, needs):
    """As many columns are not enough: a turn rate is no steering angle, and an angle no place."""
    (tmp_path / "own.py").write_text(OWN)
    name = name if name == "ackermann" else f"{tmp_path}/own.py:{name}"
    config = with_simulator(name, f"experiment={experiment}")
    config["target"] = resolve([f"experiment={experiment}"], None)["target"]
    for make, what in ((target_plant, "target"), (make_task, "task")):
        with pytest.raises(
            UsageError, match=f"{what} .* is {needs}, the simulator's is {has}; choose"
        ) as caught:
            make(config)
        assert "\n" not in str(caught.value)
