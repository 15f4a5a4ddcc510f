"""Degrees under the name of radians, and angles counted from the other side, are asked for before any physics."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gpsim.channels import Channels
from gpsim.diagnosis.settings import Settings, read_settings
from gpsim.diagnosis.setup import check_moves, look, prepare
from gpsim.diagnosis.setup.log_facts import check_angles
from gpsim.errors import NoDiagnosis, UsageError
from gpsim.simulators import make_simulator
from gpsim.simulators.user import adapted

from .worlds import World, record

DEGREES = math.degrees(1.0)


def recorded(*factors, shift=0.0, **more):
    """A damped pendulum's states times these factors."""
    made = record(World("pendulum", forces={0: lambda q, v, t: -0.3 * v}), seed=3, episodes=4, steps=150)
    change = lambda states: states * factors + [shift, 0.0]  # noqa: E731
    episodes = tuple(replace(e, states=change(e.states)) for e in made.episodes)
    return replace(made, episodes=episodes, noise={}, held_out=None, **more)


def asked(recording, settings=None):
    simulator = make_simulator("pendulum")
    check_angles(
        recording, simulator, simulator.defaults(recording.parameters), (settings or Settings()).log_facts
    )


@pytest.mark.parametrize(
    ("factors", "shift", "said"),
    [
        ((DEGREES, 1.0), 0.0, r"^theta moves 57\.\d times as fast as theta_dot implies: theta is in degrees"),
        ((1.0, DEGREES), 0.0, r"^theta moves 0\.017\d times .*: theta_dot is in degrees"),
        (
            (DEGREES, DEGREES),
            0.0,
            r"^theta and theta_dot seem to be in degrees: with that, the simulator explains",
        ),
        ((1.0, 1.0), math.pi, r"^theta seems to have an offset of 180 degrees: with that"),
        ((1.0, 1.0), -math.pi, r"^theta seems to have an offset of 180 degrees: with that"),
    ],
)
def test_an_angle_that_is_not_what_it_says_is_asked_for_first(factors, shift, said):
    recording = recorded(*factors, shift=shift)
    with pytest.raises(UsageError, match=said) as refused:
        asked(recording)
    assert "diagnose.log_facts.angles=false" in str(refused.value)
    asked(recording, read_settings({"log_facts": {"angles": False}}))


@pytest.mark.parametrize(
    "recording",
    [
        lambda: recorded(1.0, 1.0),
        lambda: recorded(1.0, 1.0, velocities="differentiated"),
        lambda: recorded(1.0, 1.0, parameters={"gravity": 9.81, "mass": 4.0, "length": 0.5}),  # far off
        lambda: recorded(1.0, 1.0, parameters={"gravity": 9.81, "mass": 1.0, "length": 1.0}),
        lambda: recorded(3.0, 1.0),  # no unit is 3 times another
    ],
)
def test_whatever_else_is_wrong_is_no_matter_of_units(recording):
    asked(recording())


def test_a_diagnosis_asks():
    recording = recorded(DEGREES, DEGREES)
    simulator = make_simulator("pendulum")
    with pytest.raises(UsageError, match="seem to be in degrees"):
        prepare(recording, simulator, simulator.defaults(recording.parameters))


class Arm:
    """Two joints, each with an inertia of its own."""

    state = {"a": "rad", "a_dot": "rad/s", "b": "rad", "b_dot": "rad/s"}  # noqa: RUF012
    action = {"u": "N m"}  # noqa: RUF012
    parameters = {"inertia": ("kg m^2", 1.0, 0.1, 10.0)}  # noqa: RUF012
    coordinates = {"a": "a_dot", "b": "b_dot"}  # noqa: RUF012
    start = {"a_dot": 0.0, "b_dot": 0.0}  # noqa: RUF012

    def rates(self, state, action, p, forces):
        return {"a_dot": (action["u"] + forces["a"]) / p["inertia"], "b_dot": forces["b"] / p["inertia"]}


def positions(b):
    """A recording of both joints' positions; a swings."""
    like = record(World("pendulum"), episodes=2, steps=100)
    episodes = tuple(
        replace(e, states=np.stack([np.sin(e.t), b + 0.0 * e.t], axis=1), actions=-np.sin(e.t[:-1, None]))
        for e in like.episodes
    )
    return replace(
        like,
        state=Channels.of({"a": "rad", "b": "rad"}),
        action=Channels.of({"u": "N m"}),
        episodes=episodes,
        noise={},
    )


def test_one_joint_that_is_held_does_not_say_that_nothing_moves():
    simulator, recording = adapted(Arm(), "arm.py:Arm"), positions(0.4)
    sight = look(recording, simulator)
    assert dict(sight.held) == {"b": 0.4, "b_dot": 0.0}
    check_moves(recording, simulator, sight)
    still = tuple(replace(e, states=0.0 * e.states) for e in recording.episodes)
    recording = replace(recording, episodes=still)
    with pytest.raises(NoDiagnosis, match="nothing moves: a, b never change"):
        check_moves(recording, simulator, look(recording, simulator))
