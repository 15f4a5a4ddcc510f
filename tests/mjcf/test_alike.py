"""What may stand in another's place: the rotor of a slider is its cart's mass, and one of a hinge is no body's."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
import yaml
from mjcf_models import written

from gpsim.diagnosis.assessment.combinations import sums
from gpsim.diagnosis.fitting import Hypothesis, child_of
from gpsim.diagnosis.report import Estimate
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.setup import alike, offers_of, prepare
from gpsim.effects.own import own_name
from gpsim.reports.diagnosis_text import combination_text
from gpsim.reports.wording import _with_directions
from gpsim.stages.diagnose import Task, open_recording

CART = """<mujoco><option timestep="0.002"/><worldbody>
<body name="cart"><joint name="rail" type="slide" axis="1 0 0"/><inertial mass="2" pos="0 0 0" diaginertia="0.1 0.1 0.1"/>
<body name="pole"><joint name="hinge" type="hinge" axis="0 1 0"/><inertial mass="0.4" pos="0 0 -0.3" diaginertia="0.01 0.01 0.01"/>
</body></body></worldbody>
<actuator><motor name="push" joint="rail"/><motor name="turn" joint="hinge"/></actuator></mujoco>"""
DT, ROTOR, NOISE = 0.01, 0.3, 1e-4


@pytest.fixture(scope="module")
def question(tmp_path_factory):
    """Positions of the cart-pole with a rotor behind the rail that its model lacks."""
    folder, model = tmp_path_factory.mktemp("cart"), mujoco.MjModel.from_xml_string(CART)
    model.dof_armature[0] = ROTOR
    model.opt.timestep /= 4
    data, rng, rows = mujoco.MjData(model), np.random.default_rng(4), ["episode,t,rail,hinge,push,turn"]
    tones, phases = rng.uniform(0.3, 2.0, (2, 5)), rng.uniform(0, 6.3, (2, 5))
    for k in range(1500):
        data.ctrl[:] = np.array([4.0, 0.5]) * np.sin(2 * np.pi * tones * DT * k + phases).sum(axis=1)
        said = (*(data.qpos + NOISE * rng.normal(size=2)), *data.ctrl)
        rows.append(f"0,{DT * k:.2f}," + ",".join(f"{v:.7f}" for v in said))
        mujoco.mj_step(model, data, round(DT / model.opt.timestep))
    (folder / "recording.csv").write_text("\n".join(rows) + "\n")
    meta = {"system": "mjcf", "model": "robot.xml", "dt": DT, "state": {"rail": "m", "hinge": "rad"}}
    meta |= {"action": {"push": "N", "turn": "N m"}, "noise": {"rail": NOISE, "hinge": NOISE}}
    (folder / "recording.yaml").write_text(yaml.safe_dump(meta))
    written(folder, CART)
    recording, simulator = open_recording(Task(folder, None))
    return prepare(recording, simulator, simulator.defaults(), Run())


def _told(question, *said):
    account = Hypothesis()
    for family, on, value in said:
        (candidate,) = [
            c for c in offers_of(question) if (c.family, c.place.on, c.variant) == (family, on, "")
        ]
        account = child_of(account, candidate, (value,))
    return account


def _pairs(question, told):
    found = alike(question.everything, question.recording, told, offers_of(question))
    return {(told.terms[a.told].on, a.other.place.on): a.size for a in found}


def test_a_sliders_rotor_and_its_carts_mass_are_alike_and_their_sum_is_told(question):
    told = _told(question, ("armature", "rail", ROTOR))
    assert _pairs(question, told) == {("rail", "cart.mass"): pytest.approx(ROTOR / 2.0, rel=0.02)}
    (name,) = told.terms[0].values
    (found,) = sums(question, told, ({name: Estimate(ROTOR, 0.29, 0.31, "kg")},))
    assert found.weights == pytest.approx((1.0, 2.0), rel=0.02)
    text = combination_text(_with_directions(found))
    assert "2 · (cart.mass ratio - 1)" in text
    assert "one may stand in the other's place" in text


def test_the_carts_mass_is_its_rotors_rival_as_well_and_no_rotor_of_a_hinge_is_a_body(question):
    said = _pairs(question, _told(question, ("parameter_offset", "cart.mass", 1.0 + ROTOR / 2.0)))
    assert said == {("cart.mass", "rail"): pytest.approx(ROTOR, rel=0.02)}
    assert not _pairs(question, _told(question, ("armature", "hinge", 0.05)))


def test_what_is_fixed_or_one_recordings_own_is_not_asked(question):
    told = _told(question, ("armature", "rail", ROTOR))
    assert not _pairs(question, told.frozen())
    (term,) = told.terms
    own = replace(told, terms=(replace(term, values={own_name(n, 0): v for n, v in term.values.items()}),))
    assert not _pairs(question, own)
