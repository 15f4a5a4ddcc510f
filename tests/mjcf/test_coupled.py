"""A drive that turns with two joints brakes both: the truth is MuJoCo's, with a fixed tendon, at a quarter of the step."""

import mujoco
import numpy as np
import pytest
from mjcf_models import DOUBLE, logged

import gpsim
from gpsim.diagnosis.ladder.robots import TIED, by_inverse_dynamics
from gpsim.diagnosis.setup import offers_of, prepare
from gpsim.effects import Term
from gpsim.mjcf import load_mjcf
from gpsim.stages.diagnose import Task, open_recording

NOISE, DT, SAMPLES = 5e-4, 0.01, 250
SUM, DIFFERENCE = "shoulder+elbow", "shoulder-elbow"
DRY, VISCOUS, ROTOR = 0.08, 0.03, 0.01
OWN = {"dry": (0.1, 0.05), "viscous": (0.05, 0.03)}
GANTRY = """<mujoco><worldbody><body><joint name="x" type="slide" axis="1 0 0"/>
<joint name="y" type="slide" axis="0 1 0"/><geom size=".1"/></body></worldbody></mujoco>"""


def with_drives(*turns, dry=0.0, damping=0.0, rotor=0.0):
    """`DOUBLE` with a drive for each of these, which turns with the shoulder and so often with the elbow."""
    drives = "".join(
        f'<fixed frictionloss="{dry}" damping="{damping}" armature="{rotor}"><joint joint="shoulder" coef="1"/>'
        f'<joint joint="elbow" coef="{second}"/></fixed>'
        for second in turns
    )
    return DOUBLE.replace("</mujoco>", f"<tendon>{drives}</tendon></mujoco>")


def moved(text, dry=(0.0, 0.0), viscous=(0.0, 0.0), inertia=1.0):
    """Rows of three episodes of a model whose joints rub by themselves, too; inertia: times that of the last body."""
    rng, model = np.random.default_rng(7), mujoco.MjModel.from_xml_string(text)
    model.opt.timestep /= 4
    model.dof_frictionloss[:], model.dof_damping[:] = dry, model.dof_damping + np.array(viscous)
    model.body_inertia[-1] *= inertia
    stiff = (-1.0, -2.0 / model.opt.timestep), (0.9999, 0.9999, 0.001, 0.5, 2.0)
    model.dof_solref[:], model.dof_solimp[:] = stiff
    model.tendon_solref_fri[:], model.tendon_solimp_fri[:] = stiff
    data, t, rows = mujoco.MjData(model), DT * np.arange(SAMPLES), []
    for e in range(3):
        tones, phases = rng.uniform(0.15, 2.5, (2, 5, 1)), rng.uniform(0.0, 6.3, (2, 5, 1))
        given = (rng.normal(size=(2, 5, 1)) * np.sin(2 * np.pi * tones * t + phases)).sum(axis=1).T
        given *= [1.2, 0.4] / given.std(axis=0)
        mujoco.mj_resetData(model, data)
        data.qpos[:] = 0.3 * rng.normal(size=2)
        for k, command in enumerate(given):
            data.ctrl[:] = command
            rows.append((e, DT * k, *(data.qpos + NOISE * rng.normal(size=2)), *command))
            mujoco.mj_step(model, data, nstep=round(DT / model.opt.timestep))
    return rows


def recorded(folder, text, **joints):
    """A folder in which `DOUBLE` is believed."""
    state = dict.fromkeys(("shoulder", "elbow"), "rad")
    more = {"noise": dict.fromkeys(state, NOISE)}
    return logged(folder, DOUBLE, moved(text, **joints), DT, state, {"m1": "N m", "m2": "N m"}, **more)


def sized(folder, text, **joints):
    """Family and place -> the size that forces say."""
    recording, simulator = open_recording(Task(recorded(folder, text, **joints), None))
    question = prepare(recording, simulator, simulator.defaults())
    said = by_inverse_dynamics(question.everything, question.recording, offers_of(question))
    return {where: value for where, (value, *_) in said.values.items()}


def test_a_drive_of_two_joints_is_found_beside_their_own_friction(tmp_path):
    found = gpsim.diagnose(recorded(tmp_path, with_drives(1, dry=DRY, damping=VISCOUS), **OWN))
    effects = {(e.family, e.on): e for e in found.effects}
    assert found.verdict == "named"
    for family, name, size in (("coupled_friction", "force", DRY), ("coupled_damping", "damping", VISCOUS)):
        assert effects[family, SUM].parameters[name].value == pytest.approx(size, rel=0.15)
        assert "in a drive that turns with shoulder+elbow" in effects[family, SUM].sentence
    for on, dry in zip(("shoulder", "elbow"), OWN["dry"], strict=True):
        assert effects["coulomb_friction", on].parameters["force"].value == pytest.approx(dry, rel=0.2)
    assert len(effects) == 6


def test_joints_that_rub_by_themselves_have_no_drive_in_common(tmp_path):
    found = gpsim.diagnose(recorded(tmp_path, DOUBLE, dry=OWN["dry"]))
    assert {(e.family, e.on) for e in found.effects} == {
        ("coulomb_friction", j) for j in ("shoulder", "elbow")
    }


@pytest.mark.parametrize(("turns", "on"), [(1, SUM), (-1, DIFFERENCE)])
def test_forces_tell_friction_and_rotor_of_a_drive_and_which_way_it_turns(tmp_path, turns, on):
    values = sized(tmp_path, with_drives(turns, dry=DRY, damping=VISCOUS, rotor=ROTOR), **OWN)
    drive = {where: value for where, value in values.items() if where[0] in TIED}
    sizes = {"coupled_friction": DRY, "coupled_damping": VISCOUS, "coupled_armature": ROTOR}
    assert drive == pytest.approx({(family, on): size for family, size in sizes.items()}, rel=0.15)
    for joint, size in zip(("shoulder", "elbow"), OWN["dry"], strict=True):
        assert values["coulomb_friction", joint] == pytest.approx(size, rel=0.2)


def test_both_drives_of_a_differential_are_told_at_once(tmp_path):
    values = sized(tmp_path, with_drives(1, -1, dry=DRY))
    assert [values["coupled_friction", on] for on in (SUM, DIFFERENCE)] == pytest.approx([DRY, DRY], rel=0.15)


@pytest.mark.parametrize("own", [{}, OWN, {"dry": (0.02, 0.15)}, {**OWN, "inertia": 2.0}])
def test_forces_ask_for_no_drive_where_there_is_none(tmp_path, own):
    assert not {family for family, _ in sized(tmp_path, DOUBLE, **own)} & set(TIED)


def test_simulations_without_a_drive_stay_as_they_are(tmp_path):
    (tmp_path / "robot.xml").write_text(DOUBLE)
    simulator = load_mjcf(str(tmp_path / "robot.xml"))
    term, rows = Term("coupled_friction", SUM, {"force": DRY}), (np.full((1, 4), 0.3), np.ones((1, 50, 2)))
    clock = np.full(1, 0.002), np.zeros(1)
    before = simulator.rolled((), {}, (), *rows, *clock)
    rubbed = simulator.rolled((term,), {}, ({"force": np.array([DRY])},), *rows, *clock)
    assert np.abs(rubbed - before).max() > 0.01
    assert (simulator.rolled((), {}, (), *rows, *clock) == before).all()


def test_a_rotor_has_no_place_where_slides_of_one_body_are_independent(tmp_path):
    """MuJoCo keeps no entry of the mass matrix for them; friction needs none."""
    (tmp_path / "robot.xml").write_text(GANTRY)
    places = load_mjcf(str(tmp_path / "robot.xml")).model_places
    assert set(places["coupled_friction"]) == {"x+y", "x-y"}
    assert places["coupled_friction"]["x+y"].unit == "N"
    assert not places["coupled_armature"]
