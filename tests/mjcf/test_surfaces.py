"""What moves stands on what does not: friction and stiffness of a contact, against MuJoCo itself run directly."""

import mujoco
import numpy as np
import pytest
from mjcf.test_export_model import apart, exported, native, replayed
from mjcf_models import DOUBLE, SKID, one_by_one, written

from gpsim.diagnosis.setup import not_asked, prepare
from gpsim.diagnosis.setup.offers import candidates
from gpsim.effects import Term
from gpsim.findings import NotAsked
from gpsim.mjcf import load_mjcf
from gpsim.recordings import Episode, Recording
from gpsim.reports.diagnosis_text import not_asked_lines

STILL, STEPS = np.array([0.0, 0.6, -0.001, 0.0]), 400
UNLIKE = SKID.format(floor=0.4, sole=0.7)
ALIKE = SKID.format(floor=0.5, sole=0.5)


def pulled(count):
    """Commands (count, 2) that drag to and fro while it is pressed down more and less."""
    t = 0.001 * np.arange(count)
    return np.stack([9.0 * np.sin(9.0 * t), -4.0 - 3.0 * np.sin(25.0 * t)], axis=1)


def directly(text, change):
    model = mujoco.MjModel.from_xml_string(text)
    change(model)
    return one_by_one(model, STILL, pulled(STEPS), lambda s: (s[0::2], s[1::2]))


def rolled(text, folder, on, ratio):
    simulator = load_mjcf(written(folder, text))
    term = Term("parameter_offset", on, {"ratio": ratio})
    given = ((term,), simulator.defaults(), [{"ratio": np.array([ratio])}])
    step = np.full(1, simulator.own_step)
    return simulator.rolled(*given, STILL[None], pulled(STEPS)[None], step, np.zeros(1))[0]


@pytest.mark.parametrize("ratio", [0.3, 2.0])
def test_friction_is_that_of_the_contact_whichever_geom_decides(ratio, tmp_path):
    def change(model):
        model.geom_priority[0] = 1  # what the floor says alone
        model.geom_friction[0, 0] = ratio * 0.5

    assert apart(directly(ALIKE, change), rolled(ALIKE, tmp_path, "floor.friction", ratio)) < 1e-9
    assert apart(directly(ALIKE, lambda model: None), rolled(ALIKE, tmp_path, "floor.friction", ratio)) > 0.01


def test_the_rougher_geom_decides_unless_one_has_priority(tmp_path):
    def offered(text):
        return set(load_mjcf(written(tmp_path, text)).parameters) - {"gravity", "skid.mass"}

    assert offered(UNLIKE) == {"sole.friction", "floor.solref"}
    assert offered(UNLIKE.replace('<geom name="floor"', '<geom name="floor" priority="1"')) == {
        "floor.friction",
        "floor.solref",
    }
    assert offered(UNLIKE.replace('<geom name="sole"', '<geom name="sole" priority="1"')) == {
        "sole.friction",
        "sole.solref",
    }

    def change(model):
        model.geom_friction[:, 0] = 0.2  # of both: the floor's 0.4 would decide else

    assert apart(directly(UNLIKE, change), rolled(UNLIKE, tmp_path, "sole.friction", 0.2 / 0.7)) < 1e-9


@pytest.mark.parametrize("ratio", [0.4, 2.5])
def test_the_time_constant_is_that_of_the_contact(ratio, tmp_path):
    mixed = ALIKE.replace('<geom name="sole"', '<geom name="sole" solref=".01 1" solmix="3"')

    def change(model):
        model.geom_priority[0] = 1
        model.geom_solref[0, 0] = ratio * (0.25 * 0.02 + 0.75 * 0.01)

    assert apart(directly(mixed, change), rolled(mixed, tmp_path, "floor.solref", ratio)) < 1e-9


FOOTED = ALIKE.replace('pos="0 0 .1"', 'pos="0 0 .15"').replace(
    '<geom name="sole" size=".1" mass="1.5"',
    '<inertial pos="0 0 0" mass="1.5" diaginertia=".1 .1 .1"/><geom name="sole" size=".1" pos="0 0 -.05"',
)


def test_a_foot_reaches_as_far_as_its_geom_and_is_written_out_there(tmp_path):
    def change(model):
        model.geom_pos[1] *= 1.01

    assert apart(directly(FOOTED, change), rolled(FOOTED, tmp_path, "sole.reach", 1.01)) < 1e-9
    _, made = exported(tmp_path, FOOTED, [Term("parameter_offset", "sole.reach", {"ratio": 1.01})])
    assert mujoco.MjModel.from_xml_path(str(made.files["model"])).geom_pos[1] == pytest.approx(
        [0, 0, -0.0505]
    )
    assert "sole.reach" not in load_mjcf(written(tmp_path, ALIKE)).parameters


@pytest.mark.parametrize(
    "change",
    [
        ('friction="0.5"', 'friction="0.5" contype="0" conaffinity="0"'),
        ("</worldbody>", '</worldbody><contact><pair geom1="floor" geom2="sole"/></contact>'),
        ("</worldbody>", '</worldbody><contact><exclude body1="world" body2="skid"/></contact>'),
        ("<worldbody>", '<option><flag contact="disable"/></option><worldbody>'),
    ],
)
def test_what_cannot_touch_or_has_numbers_of_its_own_is_no_parameter(change, tmp_path):
    simulator = load_mjcf(written(tmp_path, ALIKE.replace(*change)))
    assert not [name for name in simulator.parameters if name.startswith(("floor", "sole"))]


def test_a_contact_without_friction_or_with_a_stiffness_has_no_such_parameter(tmp_path):
    smooth = ALIKE.replace("friction=", 'condim="1" friction=')
    assert "floor.friction" not in load_mjcf(written(tmp_path, smooth)).parameters
    stiff = ALIKE.replace('name="sole"', 'name="sole" solref="-1000 -20"')
    assert "floor.solref" not in load_mjcf(written(tmp_path, stiff)).parameters


def test_a_geom_without_a_name_is_called_by_its_body(tmp_path):
    nameless = UNLIKE.replace('name="floor" ', "").replace('name="sole" ', "")
    assert {"skid.friction", "world.solref"} <= set(load_mjcf(written(tmp_path, nameless)).parameters)
    two = nameless.replace("</worldbody>", '<geom type="plane" size="1 1 1" pos="0 0 -5"/></worldbody>')
    assert {"geom0.solref", "geom1.solref"} <= set(load_mjcf(written(tmp_path, two)).parameters)


def recording_of(simulator, heights):
    states = np.zeros((len(heights), 4))
    states[:, 2], states[:, 0] = heights, np.sin(0.1 * np.arange(len(heights)))
    states[:, 1], states[:, 3] = np.gradient(states[:, 0], 0.01), np.gradient(heights, 0.01)
    rng = np.random.default_rng(3)
    episode = Episode("0", 0.01 * np.arange(len(heights)), states, rng.normal(size=(len(heights) - 1, 2)))
    return Recording("mjcf", simulator.state, simulator.action, (episode,), 0.01, {}, "euler")


@pytest.mark.slow
def test_only_what_touches_in_the_recording_is_asked(tmp_path):
    simulator = load_mjcf(written(tmp_path, ALIKE))
    waves = 0.05 * np.sin(0.07 * np.arange(800))

    def asked(recording):
        made = candidates(recording, simulator, simulator.defaults())
        return {c.place.on for c in made if c.place.on.startswith("floor")}

    down, up = (recording_of(simulator, waves + height) for height in (0.0, 0.3))
    assert asked(down) == {"floor.friction", "floor.solref"}
    assert asked(up) == set()
    (entry,) = [e for e in not_asked(prepare(up, simulator, simulator.defaults())) if e.channel == "floor"]
    assert entry == NotAsked(because="nothing touches", channel="floor")
    assert not_asked_lines([entry]) == ["nothing touches floor: its friction and stiffness are not tested"]
    found = not_asked(prepare(down, simulator, simulator.defaults()))
    assert not [e for e in found if e.because == "nothing touches"]


@pytest.mark.parametrize(
    ("text", "on", "said"),
    [
        (ALIKE, "floor.friction", ["geom floor: friction", "geom sole: friction"]),
        (ALIKE, "floor.solref", ["geom floor: solref", "geom sole: solref"]),
        (UNLIKE, "sole.friction", ["geom sole: friction"]),
        (UNLIKE.replace('name="sole" ', ""), "skid.friction", ["geom skid: friction"]),
    ],
)
def test_what_is_exported_replays(text, on, said, tmp_path):
    plant, made = exported(tmp_path, text, [Term("parameter_offset", on, {"ratio": 0.63})])
    assert made.effects[0]["attributes"] == said
    sent = pulled(60)
    assert apart(replayed(plant, STILL, sent), native(made, STILL, sent, plant.substeps)) < 1e-5


def test_a_model_without_a_floor_has_no_surface(tmp_path):
    assert load_mjcf(written(tmp_path, DOUBLE)).body.surfaces == ()
