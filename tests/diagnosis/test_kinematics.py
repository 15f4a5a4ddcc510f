"""What a motion capture says of a geometry: worlds whose truth is known, and a true model of which nothing is said."""

import numpy as np
import pytest
from mjcf_arms import PLANAR, Capture, arm, seen
from mjcf_models import written

from gpsim.kinematics import calibrate
from gpsim.mjcf import in_its_columns, open_simulator
from gpsim.reports.diagnosis_text import found_text, geometry_lines, inseparable_text
from gpsim.residuals import read_table

FRAME_PIVOT = np.array([0.0, 0.0, 0.1])  # of the arm of six: its first joint


def told(folder, believed, truth, how=Capture()):  # noqa: B008
    simulator = open_simulator(written(folder, believed))
    seen(truth, how).to_csv(folder / "log.csv", index=False)
    return calibrate(in_its_columns(read_table(folder / "log.csv", simulator), simulator), simulator)


def named(made, model=True):
    return {(f.place.kind, f.place.on, f.place.axis): f for f in made.told.found if f.model == model}


def holds(found, value):
    """Three standard deviations, as an interval of 90 % is to miss one time in ten."""
    half = (found.size.high - found.size.low) / 2
    assert abs(found.size.value - value) < 3.0 / 1.645 * half


@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_said_of_a_true_planar_arm(tmp_path, seed):
    made = told(tmp_path, arm(PLANAR), arm(PLANAR), Capture(seed=seed, lost=0.1, leaping=0.02))
    assert not made.told.found
    assert made.moved == ()
    assert geometry_lines(made.told)[0].startswith("zeros and lengths agree with the model")


def test_nothing_is_said_of_a_true_arm_of_six_in_errors_that_last(tmp_path):
    made = told(tmp_path, arm(), arm(), Capture(memory=0.9, seconds=20.0))
    assert not named(made)
    assert made.told.independent < 0.3 * made.told.samples


def test_one_wrong_zero_is_that_and_nothing_else(tmp_path):
    made = told(tmp_path, arm(PLANAR), arm(PLANAR, zero=-0.01))
    assert list(named(made)) == [("joint zero", "elbow", "")]
    assert not named(made, model=False)
    holds(named(made)["joint zero", "elbow", ""], 0.01)
    assert made.moved[0].value == pytest.approx(0.01, rel=0.05)
    error = made.told.error["tool"]
    assert error.after < 1.1 * error.noise < error.placed <= error.before


def test_zero_length_tilt_and_delay_of_an_arm_of_six(tmp_path):
    tilt = (0.01, -0.005, 0.0)
    how = Capture(delay=0.02, turned=tilt, lost=0.1, leaping=0.02, dt=0.01, seed=1)
    made = told(tmp_path, arm(), arm(z2=-0.02, l3=0.403), how)
    robot, laboratory = named(made), named(made, model=False)
    assert set(robot) == {("joint zero", "j2", ""), ("body place", "l3", "z")}
    holds(robot["joint zero", "j2", ""], 0.02)
    holds(robot["body place", "l3", "z"], 0.003)
    holds(laboratory["frame turn", "", "x"], 0.01)
    holds(laboratory["frame turn", "", "y"], -0.005)
    holds(laboratory["delay", "", ""], 0.02)
    assert ("frame turn", "", "z") not in laboratory
    assert made.told.error["tool"].after < 1.2 * made.told.error["tool"].noise
    assert found_text(laboratory["delay", "", ""]).startswith("the delay of motion capture is 0.020")


def test_a_frame_that_lies_anywhere(tmp_path):
    how = Capture(turned=(0.2, 0.1, 2.0), moved=(1.0, 2.0, 0.5))
    made = told(tmp_path, arm(), arm(l2=0.103), how)
    assert list(named(made)) == [("body place", "l2", "x")]
    holds(named(made)["body place", "l2", "x"], 0.003)
    turn = [named(made, model=False)["frame turn", "", axis].size.value for axis in "xyz"]
    np.testing.assert_allclose(turn, how.turned, atol=1e-3)


def test_the_first_zero_and_the_bases_turn_are_one(tmp_path):
    """About a vertical axis: the laboratory's is taken, and the account says that only the sum shows."""
    made = told(tmp_path, arm(PLANAR), arm(PLANAR), Capture(turned=(0.0, 0.0, 0.02)))
    assert not named(made)
    (found,) = named(made, model=False).values()
    assert (found.place.kind, found.place.axis) == ("frame turn", "z")
    (other,) = [i for i in found.instead if i.place.kind == "joint zero"]
    assert (other.place.on, other.exact) == ("shoulder", True)
    assert other.value == pytest.approx(0.02, rel=0.05)
    assert "of it and the zero of shoulder (0.02" in found_text(found)
    assert found_text(found).endswith("only the sum shows")
    lines = [inseparable_text(entry) for entry in made.told.inseparable]
    assert "the zero of shoulder and the base's turn about z: only a sum shows" in lines


def test_the_last_zero_and_the_markers_place_are_one(tmp_path):
    made = told(tmp_path, arm(), arm(mark=0.002))
    (found,) = named(made).values()
    assert (found.place.kind, found.place.on) == ("joint zero", "j6")
    assert [(i.place.kind, i.place.axis, i.exact) for i in found.instead] == [("site place", "y", True)]
    assert found.instead[0].value == pytest.approx(0.002, rel=0.1)


def test_an_orientation_tells_the_last_zero_from_the_markers_place(tmp_path):
    made = told(tmp_path, arm(), arm(mark=0.002), Capture(oriented=True))
    assert list(named(made)) == [("site place", "tool", "y")]
    holds(named(made)["site place", "tool", "y"], 0.002)
    assert not [i for i in named(made)["site place", "tool", "y"].instead if i.place.kind == "joint zero"]


def test_a_recording_without_poses_is_asked_nothing(tmp_path):
    simulator = open_simulator(written(tmp_path, arm(PLANAR)))
    table = seen(arm(PLANAR), Capture(seconds=1.0))
    table.drop(columns=["tool.x"]).to_csv(tmp_path / "log.csv", index=False)
    assert (
        calibrate(in_its_columns(read_table(tmp_path / "log.csv", simulator), simulator), simulator) is None
    )
