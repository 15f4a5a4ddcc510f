"""A loop that is given its recording or its diagnosis: it does not make them, and says what it was given."""

import json
from dataclasses import replace
from pathlib import Path

import asking
import numpy as np
import pytest
from made_diagnoses import made_diagnosis

from gpsim.artifacts import Artifact, Recipe, Store
from gpsim.corrected import EffectsPlant, describe
from gpsim.errors import UsageError
from gpsim.recordings import Episode, Recording
from gpsim.recordings.files import write_recording
from gpsim.simulators import make_simulator
from gpsim.stages import evaluate, full_loop, report
from gpsim.stages.building import base_plant, measured_on
from gpsim.stages.stage import Request, Stage

CAR = base_plant(asking.asked("experiment=limo").config)


def asked(*words: str) -> Request:
    return replace(asking.asked("experiment=limo", *words), words=words)


def labels(request: Request) -> list[str]:
    return [job.label for job in full_loop.plan(request, (0, 1))]


def driven(dt: float = 0.1) -> Recording:
    k = np.arange(31)
    states = np.stack([0.01 * k, 0.0 * k, 0.001 * k], axis=1)
    episodes = tuple(Episode(str(i), dt * k, states, np.full((30, 2), 0.1)) for i in range(3))
    return Recording("unicycle", CAR.state, CAR.action, episodes, dt, {}, "euler", clock="episode")


@pytest.fixture
def drive(tmp_path):
    """As `gpsim import` leaves it."""
    recipe = Recipe("import", {}, {}, {})
    write = lambda folder: write_recording(driven(), folder)  # noqa: E731
    return Store(tmp_path, "").publish(recipe, write, out=tmp_path / "drive").path


@pytest.fixture
def diagnosis(tmp_path):
    car = make_simulator("unicycle")
    plant = EffectsPlant(car, car.defaults({}), (), "euler", 1, 0.1)

    def write(folder: Path):
        (folder / "corrected.json").write_text(json.dumps(describe(plant, gp=False)))
        (folder / "diagnosis.json").write_text(json.dumps(made_diagnosis().to_dict()))
        return {}

    return Store(tmp_path, "").publish(Recipe("diagnose", {}, {}, {}), write, out=tmp_path / "known").path


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    """Whatever a stage needs is there, without being made."""
    made = lambda stage, request: Artifact(tmp_path, {"stage": stage.name}, stage.name)  # noqa: E731
    monkeypatch.setattr(Stage, "need", made)
    return Artifact(tmp_path, {"stage": "any"}, "ab")


@pytest.mark.parametrize("target", ["limo", "recording"])
def test_a_recording_that_is_given_is_not_collected(drive, target):
    found = labels(asked(f"target={target}", f"recording={drive}"))
    assert not [label for label in found if label.startswith("collect")]
    assert {"build-residuals · seed 0", "diagnose · seed 1", "evaluate · seed 1"} <= set(found)
    assert ("certify" in found) == (target == "limo")
    if target == "limo":
        assert "collect · seed 0" in labels(asked())


def test_a_diagnosis_that_is_given_is_not_made(diagnosis):
    jobs = {job.label: job for job in full_loop.plan(asked(f"diagnosis={diagnosis}"), (0,))}
    assert not [label for label in jobs if label.startswith("diagnose")]
    assert jobs["Effects · seed 0"].after == ()
    assert "diagnose · seed 0" in labels(asked())


def test_what_is_given_is_opened_before_anything_is_trained(drive, diagnosis, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    write_recording(driven(dt=0.05), other)
    empty = tmp_path / "empty"
    empty.mkdir()
    for words, message in (
        ([f"recording={other}"], r"choose simulator\.dt=0\.05"),
        ([f"recording={empty}"], "recording.yaml"),
        ([f"diagnosis={drive}"], "made by 'import', expected an artifact of 'diagnose'"),
        ([f"diagnosis={diagnosis}", "simulator.dt=0.2"], r"choose simulator\.dt=0\.1"),
    ):
        with pytest.raises(UsageError, match=message) as caught:
            full_loop.plan(asked(*words), (0,))
        assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("stand_in")
def test_the_report_lists_what_was_used(drive, diagnosis):
    plain = [(role, seed) for role, seed, _ in report.artifacts_of(asked(), (0, 1))]
    assert {("collect", 0), ("collect", 1), ("diagnose", 0), ("diagnose", 1)} <= set(plain)
    given = asked(f"recording={drive}", f"diagnosis={diagnosis}")
    found = report.artifacts_of(given, (0, 1))
    roles = [(role, seed) for role, seed, _ in found]
    assert roles[:2] == [("recording", None), ("diagnose", None)]
    assert not {role for role, seed in roles if seed is not None} & {"collect", "diagnose"}
    assert [a.path for _, seed, a in found if seed is None][:2] == [drive, diagnosis]
    settings = report.settings_of(given)
    assert (settings["recording"], settings["diagnosis"]) == (str(drive), str(diagnosis))
    assert "collect" not in settings
    assert {"collect"} == set(report.settings_of(asked())) - set(
        report.settings_of(asked(f"recording={drive}"))
    )
    # One diagnosis for all seeds is said once.
    requests = {seed: given.having(seed=seed) for seed in (0, 1)}
    ((seed, (said,)),) = report.told_by_diagnoses(requests).items()
    assert seed == 0
    assert said.startswith("none: the recording shows no missing physics")


@pytest.mark.usefixtures("stand_in")
def test_a_folder_of_ones_own_has_no_manifest_to_list(tmp_path):
    write_recording(driven(), tmp_path)
    found = report.artifacts_of(replace(asked(), config=asked(f"recording={tmp_path}").config), (0,))
    assert not {role for role, _, _ in found} & {"recording", "collect"}


def test_a_stand_in_that_was_not_recorded_is_said_to_be_measured(drive, tmp_path, monkeypatch):
    assert measured_on(asked()) is None
    for words in ([f"recording={drive}"], ["collect.source=my.bag"]):
        assert "target=recording" in str(measured_on(asked(*words)))
        assert str(measured_on(asked(*words))).startswith("the simulated target limo, not on the recording")
        assert measured_on(asked(*words, "target=recording")) is None
    bare = tmp_path / "bare"
    bare.mkdir()
    write_recording(driven(), bare)
    assert measured_on(asked(f"recording={bare}")) is not None
    # The stand-in's own recording, named: it is what was recorded, unless it was another one.
    config = asked().section("target")
    write = lambda folder: write_recording(driven(), folder)  # noqa: E731
    own = Store(tmp_path, "").publish(Recipe("collect", config, {}, {}), write, out=tmp_path / "own").path
    assert measured_on(asked(f"recording={own}")) is None
    assert measured_on(asked(f"recording={own}", "target.delay=0.2")) is not None


def test_only_what_was_given_changes_what_an_evaluation_is_of(drive, tmp_path, stand_in):
    assert "measured_on" not in evaluate.recipe(asked()).config
    words = evaluate.recipe(asked(f"recording={drive}")).config["measured_on"]
    (tmp_path / "evaluation.json").write_text(json.dumps({"measured_on": words}))
    assert evaluate.notes(stand_in) == [f"measured on {words}"]
