"""What stages take from one another: one simulator throughout, files that count, settings that fit together."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gpsim.cli.configuration import resolve
from made_diagnoses import made_diagnosis, made_remainder

from gpsim.artifacts import Artifact, Recipe, Store
from gpsim.corrected import EffectsPlant, describe
from gpsim.errors import UsageError
from gpsim.files import file_digest
from gpsim.findings import RemainderGp
from gpsim.gp import FitOutcome, FitSettings
from gpsim.recordings import Episode, HeldOut, Recording, read_recording, write_recording
from gpsim.simulators import make_simulator, source_file
from gpsim.stages import (
    building,
    collect,
    diagnose,
    diagnose_loop,
    evaluate,
    fit_gp,
    report,
    train_gp_policy,
    train_source,
)
from gpsim.stages.build_residuals import check_same
from gpsim.stages.building import base_plant
from gpsim.stages.diagnose import read_corrected
from gpsim.stages.safety import judged_episodes
from gpsim.stages.stage import Request


def request(*words: str) -> Request:
    return Request(resolve(list(words), None))


def recording(**changes) -> Recording:
    base = base_plant(resolve([], None))
    rng = np.random.default_rng(0)
    episodes = tuple(
        Episode(str(i), 0.02 * np.arange(101) + 2 * i, rng.normal(size=(101, 4)), rng.normal(size=(100, 1)))
        for i in range(2)
    )
    whole = Recording(
        "cartpole", base.state, base.action, episodes, 0.02, base.parameters, "euler", clock="session"
    )
    return replace(whole, **changes)


def test_a_recording_of_another_simulator_is_refused_with_the_settings_that_would_fit():
    base = base_plant(resolve([], None))
    check_same(recording(), base)
    check_same(recording(parameters={}), base)  # says nothing of them
    check_same(recording(dt=0.0201), base)  # a clock that jitters
    other = recording(dt=0.01, integrator="rk4", parameters={**base.parameters, "cart_mass": 0.23})
    with pytest.raises(UsageError) as caught:
        check_same(other, base)
    wanted = "simulator.dt=0.01 simulator.integrator=rk4 simulator.parameters.cart_mass=0.23"
    assert wanted in str(caught.value)
    fitting = base_plant(resolve(wanted.split(), None))
    check_same(other, fitting)


def diagnosed(tmp_path, plant, config=None, gp=False, found=None):
    """A finished diagnosis of which only the corrected simulator counts, and what was `found` if that is given."""

    def write(folder):
        (folder / "corrected.json").write_text(json.dumps(describe(plant, gp=gp)))
        if found is not None:
            (folder / "diagnosis.json").write_text(json.dumps(found.to_dict()))
        return {}

    recipe = Recipe("diagnose", config or {}, {}, {})
    return Store(tmp_path, "any").publish(recipe, write, out=tmp_path / "diagnosis")


@pytest.mark.parametrize(
    ("name", "dt", "parameters", "message"),
    [
        (
            "slider",
            0.02,
            {},
            "corrects the simulator slider, this experiment's is cartpole; choose a diagnosis of",
        ),
        ("cartpole", 0.1, {}, "choose simulator.dt=0.1, or diagnose a recording with"),
        ("cartpole", 0.02, {"cart_mass": 0.3}, "choose simulator.parameters.cart_mass=0.3, or diagnose"),
        ("cartpole", 0.0201, {}, None),
    ],
)
def test_a_diagnosis_of_another_simulator_is_refused_before_anything_is_trained(
    tmp_path, name, dt, parameters, message
):
    simulator = make_simulator(name)
    plant = EffectsPlant(simulator, simulator.defaults(parameters), (), "euler", 1, dt)
    artifact = diagnosed(tmp_path, plant)
    asked = request("correction=effects", f"diagnosis={artifact.path}")
    if message is None:
        assert train_gp_policy.effects_plant(asked, artifact).dt == dt
        return
    with pytest.raises(UsageError, match=message) as caught:
        train_gp_policy.STAGE.make(replace(asked, out=tmp_path / "policy"))
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "policy").exists()


def test_what_is_held_out_from_a_moment_on_begins_there():
    whole = recording(held_out=HeldOut(time_from=3.0))
    (part,) = judged_episodes(whole, [1])
    assert part.t[0] == pytest.approx(3.0)
    np.testing.assert_array_equal(part.states, whole.episodes[1].states[50:])
    np.testing.assert_array_equal(part.actions, whole.episodes[1].actions[50:])
    (kept,) = judged_episodes(recording(held_out=HeldOut(episodes_from=1)), [1])
    np.testing.assert_array_equal(kept.states, whole.episodes[1].states)


def test_a_users_simulator_counts_with_its_file(tmp_path: Path):
    mine = tmp_path / "mine.py"
    mine.write_text("one = 1\n")
    assert source_file("cartpole") is None
    config = resolve([], None)
    config = {**config, "simulator": {**config["simulator"], "name": f"{mine}:Mine"}}
    before = train_source.recipe(Request(config)).key
    assert train_source.recipe(Request(config)).key == before
    mine.write_text("one = 2\n")
    assert train_source.recipe(Request(config)).key != before
    mine.unlink()
    with pytest.raises(UsageError, match="no file"):
        train_source.recipe(Request(config))


def test_the_noise_floor_is_a_setting_that_decides_the_fit_and_keeps_old_artifacts():
    plain, raised = request(), request("gp.noise_floor=0.05")
    assert building.fit_settings(plain) == FitSettings(restarts=4, minimum_improvement=1e-3)
    assert building.fit_settings(raised).bounds.noise_std.low == 0.05
    # At its default it is no part of the key: artifacts from before it was a setting are found.
    assert "noise_floor" not in plain.section("gp")["gp"]
    assert raised.section("gp")["gp"]["noise_floor"] == 0.05
    report = fit_gp.fit_outputs(
        np.arange(20.0)[:, None], np.ones((20, 1)), building.fit_settings(raised), np.random.default_rng(0)
    )[0].report
    assert report is not None
    assert report.hyper_parameters.noise_std >= 0.05
    # What a fit in trouble advises can be typed.
    advised = re.search(r"(gp\.\w+)", FitOutcome.LINE_SEARCH_FAILED.advice)
    assert advised is not None
    request(f"{advised[1]}=0.01")


def test_settings_that_are_not_finite_are_one_line():
    with pytest.raises(UsageError, match="train-source: a setting is not finite"):
        _ = train_source.recipe(request("task.position_limit=inf")).key


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["policy=sac"], "actions are discrete; choose policy=ppo"),
        (["experiment=limo", "policy=ppo"], "actions are continuous; choose policy=sac"),
        (["policy.observation_scale=[1,2]"], "expected 4 positive numbers, or none, got"),
        (["policy.observation_scale=[1,2,3,0]"], "expected 4 positive numbers, or none, got"),
    ],
)
def test_a_policy_that_does_not_fit_the_task_is_one_line(tmp_path: Path, words, message):
    asked = request(*words)
    with pytest.raises(UsageError, match=message):
        train_source.write(asked, train_source.recipe(asked), tmp_path)


def test_evaluate_warns_where_the_recording_covers_too_little(tmp_path: Path):
    made = Artifact(tmp_path, {"stage": "evaluate"}, "")
    for share, lines in ((0.099, 0), (0.101, 1), (None, 0)):
        content = {"seed": 0, "outside_recording": {"policy": 0.8, "deployed": share}}
        (tmp_path / "evaluation.json").write_text(json.dumps(content))
        assert len(evaluate.notes(made)) == lines
    (tmp_path / "evaluation.json").write_text('{"outside_recording": {"deployed": 0.5}}')
    assert evaluate.notes(made)[0].startswith("warning: 50 % of what the GP policy visits")


def test_the_page_does_not_know_where_its_artifacts_lie():
    """The same artifacts below another folder: the same command on the page."""
    asked = [
        Request(resolve(list(w), None), w)
        for w in (("gp=raw", "runs_dir=a"), ("gp=raw", "runs_dir=b", "seed=0"))
    ]
    assert {report.command_of(one, (0, 1)) for one in asked} == {"gpsim run full-loop gp=raw --seeds 2"}


@pytest.mark.usefixtures("own_files")
def test_a_diagnosis_of_a_users_simulator_wants_the_file_that_was_diagnosed(tmp_path: Path):
    mine = tmp_path / "mine.py"
    text = (
        'class Mine:\n    state, action = {"level": "m"}, {"pump": "V"}\n    parameters = {"k": ("m/s/V", 1.0, 0.0, 9.0)}\n'
        '    def rates(self, state, action, p):\n        return {"level": p["k"] * action["pump"]}\n'
    )
    mine.write_text(text)
    simulator = make_simulator(f"{mine}:Mine")
    plant = EffectsPlant(simulator, simulator.defaults({}), (), "euler", 1, 0.1)

    config = {"simulator": simulator.name, "simulator_file": file_digest(mine)}
    made = diagnosed(tmp_path, plant, config)
    assert read_corrected(made.path).dt == 0.1
    mine.write_text(text.replace('p["k"]', '2.0 * p["k"]'))
    with pytest.raises(
        UsageError, match=r"mine\.py has changed since: diagnose the recording again"
    ) as caught:
        read_corrected(made.path)
    assert "\n" not in str(caught.value)


def test_a_sweep_is_logged_where_its_mapping_will_look():
    moved = [f"state.{channel}.topic=/robot/pose" for channel in ("x", "y", "yaw")]
    plain = resolve(["experiment=limo"], None)
    for changes in ([], moved):
        collect.check(Request({**plain, "collect": {**plain["collect"], "changes": changes}}))
    with pytest.raises(UsageError, match=r"limo_optitrack needs x \(topic /robot/pose\), y \(topic /vrpn"):
        collect.check(Request({**plain, "collect": {**plain["collect"], "changes": moved[:1]}}))


def test_a_sweep_without_a_mapping_is_refused_before_it_is_driven():
    asked = request("experiment=limo", "collect.mapping=null")
    for refused in (collect.recipe, collect.check):
        with pytest.raises(
            UsageError, match="collect.policy=sweep: name the mapping .* collect.mapping=limo"
        ):
            refused(asked)


@pytest.mark.parametrize(("experiment", "velocities"), [("cartpole", "measured"), ("limo", None)])
def test_a_recording_names_velocities_where_its_state_has_some(tmp_path, experiment, velocities):
    words = ("collect.policy=random", "collect.episodes=1", "task.max_steps=5")
    asked = request(f"experiment={experiment}", *words)
    collect.write(asked, collect.recipe(asked), tmp_path)
    assert read_recording(tmp_path).velocities == velocities


def test_a_diagnosis_that_is_given_is_what_train_gp_policy_trains_in(tmp_path):
    simulator = make_simulator("cartpole")
    artifact = diagnosed(tmp_path, EffectsPlant(simulator, simulator.defaults({}), (), "euler", 1, 0.02))
    recipe = train_gp_policy.recipe(request(f"diagnosis={artifact.path}"))
    assert list(recipe.parents) == ["diagnosis"]
    assert recipe.config["correction"] == "effects"
    with pytest.raises(UsageError, match="not an artifact"):
        train_gp_policy.recipe(request("diagnosis=/nowhere"))
    with pytest.raises(UsageError, match="make it with: gpsim train-source variant=source"):
        train_gp_policy.recipe(request())  # the first of what fit-gp needs


@pytest.mark.parametrize("why", [None, "it has no structure"])
def test_where_a_diagnosis_left_the_gaussian_process_out_effects_alone_are_trained_in(tmp_path, why):
    simulator = make_simulator("cartpole")
    process = RemainderGp(why is None, "base" if why is None else None, why)
    found = made_diagnosis(remainder=made_remainder(gp=process))
    plant = EffectsPlant(simulator, simulator.defaults({}), (), "euler", 1, 0.02)
    given = diagnosed(tmp_path, plant, gp=why is None, found=found)
    asked = request("correction=effects+gp", f"diagnosis={given.path}")
    alone = request("correction=effects", f"diagnosis={given.path}")
    assert (train_gp_policy.recipe(asked) == train_gp_policy.recipe(alone)) is (why is not None)
    assert train_gp_policy.STAGE.remarks(alone) == []
    assert [str(why) in remark for remark in train_gp_policy.STAGE.remarks(asked)] == ([True] if why else [])


@pytest.mark.parametrize(("count", "fraction"), [(20, 0.2), (6, 0.2), (3, 0.2), (1, 0.2), (6, 0.5), (6, 0.0)])
def test_the_diagnosis_learns_from_nothing_that_the_loop_holds_out(tmp_path, count, fraction):
    """Where the recording does not say: one rule for both, whatever share the loop holds out."""
    rng = np.random.default_rng(0)
    base = recording()
    episodes = tuple(
        Episode(str(i), 0.02 * np.arange(41) + 2 * i, rng.normal(size=(41, 4)), rng.normal(size=(40, 1)))
        for i in range(count)
    )
    (tmp_path / "recording").mkdir()
    write_recording(replace(base, episodes=episodes), tmp_path / "recording")
    asked = request(f"recording={tmp_path / 'recording'}", f"residuals.test_fraction={fraction}")
    recipe = diagnose_loop.STAGE.recipe(asked)
    usual = fraction in (0.0, 0.2)
    assert recipe.config.get("held_out_share") == (None if usual else fraction)
    if usual:  # the same key as that of a diagnosis that somebody asks for
        task = diagnose.Task(tmp_path / "recording", "cartpole")
        assert recipe.config == diagnose.stage_for(task).recipe(asked).config
