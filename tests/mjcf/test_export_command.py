"""`gpsim export model` of a finished diagnosis, and the environment that goes by its folder."""

import json
from pathlib import Path

import gymnasium
import pytest
from cli_calls import ANSWER, called
from made_artifacts import made_diagnosis_artifact
from made_diagnoses import made_diagnosis, made_effect
from mjcf_models import DOUBLE, written

from gpsim.artifacts import Store
from gpsim.corrected import EffectsPlant
from gpsim.effects import Term
from gpsim.errors import UsageError
from gpsim.findings import Estimate
from gpsim.mjcf import files_digest, open_simulator
from gpsim.reports.diagnosis_page import page
from gpsim.simulators import make_simulator
from gpsim.stages.diagnosis_files import where_effects_go
from gpsim.stages.export import export_corrected_model

TERMS = (Term("coulomb_friction", "elbow", {"force": 0.05}), Term("actuator_dead_zone", "m1", {"width": 0.3}))
EFFECTS = (
    made_effect(
        family="coulomb_friction", on="elbow", parameters={"force": Estimate(0.05, 0.049, 0.0512, "N m")}
    ),
    made_effect(
        family="actuator_dead_zone",
        on="m1",
        site="actuator",
        parameters={"width": Estimate(0.3, None, None, "N m")},
    ),
)


def diagnosed(folder, reference, terms=(), effects=(), dt=0.01):
    simulator = open_simulator(reference)
    steps = simulator.steps_of(dt) if hasattr(simulator, "steps_of") else 1
    plant = EffectsPlant(simulator, simulator.defaults(), terms, "fine", steps, dt)
    recording = folder / "rec"
    recording.mkdir()
    found = made_diagnosis(verdict="named" if effects else "none", effects=effects)
    return made_diagnosis_artifact(
        Store(folder / "runs", ""), plant, recording, found=found, out=folder / "found"
    )


def test_it_says_where_each_effect_went(tmp_path, monkeypatch, capfd):
    diagnosed(tmp_path, written(tmp_path, DOUBLE), TERMS, EFFECTS)
    words = (
        "export",
        "model",
        str(tmp_path / "found"),
        "--out",
        str(tmp_path / "robot_corrected.xml"),
        "--json",
    )
    code, out, err = called(monkeypatch, capfd, *words)
    assert not code
    content = json.loads(out)
    ANSWER.validate(content)
    assert [e["where"] for e in content["effects"]] == ["attribute", "wrapper"]
    assert "Coulomb friction on elbow: force 0.05 N m (0.049 to 0.0512) -> joint elbow: frictionloss" in err
    assert "actuator dead zone on m1: width 0.3 N m -> wrapper (MJCF has no attribute for it)" in err
    assert "run it with Robot from robot_corrected.py" in err
    made = json.loads((tmp_path / "patch.json").read_text())
    assert made["verdict"] == "named"
    assert (
        "<!-- Coulomb friction on elbow: force 0.05 N m (0.049 to 0.0512) -->"
        in Path(content["paths"]["export"]).read_text()
    )


def test_equations_have_no_model_and_one_line_says_what_to_do_instead(tmp_path):
    diagnosed(tmp_path, "slider", (Term("viscous_friction", "q", {"damping": 1.0}),), dt=0.02)
    with pytest.raises(UsageError, match=r"no MuJoCo model, so there is no XML.*\.corrected\(\)"):
        export_corrected_model(tmp_path / "found", tmp_path / "robot_corrected.xml")
    assert not (tmp_path / "robot_corrected.xml").exists()


def test_a_diagnosis_is_never_changed(tmp_path):
    diagnosed(tmp_path, written(tmp_path, DOUBLE))
    with pytest.raises(UsageError, match="is inside the diagnosis"):
        export_corrected_model(tmp_path / "found", tmp_path / "found" / "robot_corrected.xml")


def test_a_diagnosis_that_named_nothing_gives_the_model_itself(tmp_path):
    diagnosed(tmp_path, written(tmp_path, DOUBLE))
    made, notes = export_corrected_model(tmp_path / "found", tmp_path / "robot_corrected.xml")
    assert "no effect was found: the model is the base" in notes
    assert made.effects == []


def test_a_model_that_has_changed_since_is_refused(tmp_path):
    path = written(tmp_path, DOUBLE)
    simulator = open_simulator(path)
    plant = EffectsPlant(simulator, simulator.defaults(), (), "fine", 5, 0.01)
    (tmp_path / "rec").mkdir()
    made_diagnosis_artifact(
        Store(tmp_path / "runs", ""),
        plant,
        tmp_path / "rec",
        out=tmp_path / "found",
        simulator_file=files_digest(path),
    )
    written(tmp_path, DOUBLE.replace('mass="', 'mass="1'))
    with pytest.raises(UsageError, match="changed since"):
        export_corrected_model(tmp_path / "found", tmp_path / "robot_corrected.xml")


def test_the_environment_goes_by_its_registered_id(tmp_path):
    terms = (Term("coulomb_friction", "hinge", {"force": 0.4}),)
    diagnosed(tmp_path, "gym:InvertedDoublePendulum-v5", terms, dt=0.05)
    env = gymnasium.make(
        "gpsim/Corrected-v0",
        diagnosis=str(tmp_path / "found"),
        task="gym:InvertedDoublePendulum-v5",
        max_steps=7,
    )
    observation, _ = env.reset(seed=0)
    assert observation.shape == (9,)
    ends = [env.step(env.action_space.sample() * 0.0)[2:4] for _ in range(7)]
    assert any(any(end) for end in ends)


def test_the_page_of_a_diagnosis_says_it_too(tmp_path):
    simulator = open_simulator(written(tmp_path, DOUBLE))
    plant = EffectsPlant(simulator, simulator.defaults(), TERMS, "fine", simulator.steps_of(0.01), 0.01)
    lines = where_effects_go(plant, EFFECTS)
    assert "-> joint elbow: frictionloss" in lines[0]
    assert "wrapper" in lines[1]
    text = page(made_diagnosis(verdict="named", effects=EFFECTS), {}, "double", model=lines)
    assert "Where each effect goes in the corrected model" in text
    assert "joint elbow: frictionloss" in text
    assert "Where each effect goes" not in page(made_diagnosis(), {}, "double")
    slider = make_simulator("slider")
    drag = (Term("viscous_friction", "q", {"damping": 1.0}),)
    assert not where_effects_go(EffectsPlant(slider, slider.defaults(), drag, "fine", 1, 0.02), EFFECTS)
