"""What of a machine could be seen, what explains as much, and held-out rollouts beside the true model's."""

import numpy as np
import pytest

from gpsim.simulators import make_simulator
from gpsim.trials.concealing import even_recording
from gpsim.trials.fits import rollouts_over_truth
from gpsim.trials.judged import MachineJudge
from gpsim.trials.truth import run
from gpsim.trials.worlds import TrueEffect

from .outside_worlds import world_of

MASS = TrueEffect("parameter_offset", "mass", {"ratio": 1.4})
DAMPING = TrueEffect("viscous_friction", "q", {"damping": 2.0})
BIAS = TrueEffect("actuator_bias", "force", {"bias": 0.3})
DRAG = TrueEffect("quadratic_drag", "q", {"drag": 1e-9})
TRUTH = (MASS, DAMPING, BIAS, DRAG)
GAIN = TrueEffect("actuator_gain", "force", {"gain": 0.7})
PUSH = TrueEffect("constant_force", "q", {"force": 0.2})
RATE = TrueEffect("actuator_rate_limit", "force", {"rate": 1e4})
SPRING = TrueEffect("spring", "q", {"stiffness": 1.0, "rest_position": 0.0})
NOISE = {"q": 1e-4, "q_dot": 1e-3}


@pytest.fixture(scope="module")
def recordings():
    """The axis without noise, and with it."""
    world = world_of(
        "slider", TRUTH, excitation="multisine", steps=120, episodes=8, parameters={"mass": 2.0}, noise=NOISE,
        noise_known=True, integrator="rk4", held_out=None,
    )  # fmt: skip
    ran = run(world, TRUTH)
    kept = np.full(world.episodes, world.steps + 1)
    return even_recording(world, ran.clean, ran, kept), even_recording(world, ran.measured, ran, kept)


@pytest.fixture(scope="module")
def judge(recordings):
    return MachineJudge(recordings[0], make_simulator("slider"), TRUTH, {"q": 1e-5, "q_dot": 1e-4})


def test_what_is_left_out_is_missed_unless_it_does_nothing(judge):
    mass, damping, bias, drag = judge.seen
    assert min(mass.nats, damping.nats, bias.nats) > 100
    assert abs(drag.nats) < 3
    assert mass.share > 0.01
    assert mass.beyond > 10 > 1 > drag.beyond  # of sensors ten times as quiet as the yardstick


def test_a_gain_stands_for_a_mass_with_the_friction_that_goes_with_it_and_a_spring_for_nothing(judge):
    standing = judge.standing([SPRING, GAIN, DAMPING, PUSH])
    assert standing.stands == {
        ("actuator_gain", "force"): ("parameter_offset", "mass"),
        ("constant_force", "q"): ("actuator_bias", "force"),
    }
    values = {e.family: e.values for e in standing.effects}
    assert values["actuator_gain"]["gain"] == pytest.approx(1 / 1.4, rel=1e-3)
    assert values["viscous_friction"]["damping"] == pytest.approx(2.0 / 1.4, rel=1e-3)
    assert values["constant_force"]["force"] == pytest.approx(0.3 / 1.4, rel=1e-3)
    assert judge.standing([MASS, DAMPING]).effects == TRUTH


def test_a_whole_explanation_is_as_good_or_not(judge):
    assert judge.equivalent([GAIN, DAMPING, PUSH])
    assert not judge.equivalent([GAIN, DAMPING])
    assert not judge.equivalent([SPRING, GAIN, DAMPING, PUSH])  # more parameters
    assert not judge.equivalent([])


def test_rollouts_are_those_of_the_true_model_or_worse(recordings):
    def ratios(said):
        return rollouts_over_truth(recordings[1], make_simulator("slider"), ["6", "7"], TRUTH[:3], said)

    own = ratios(TRUTH[:3])
    assert set(own) == {"q", "q_dot"}
    assert all(0.8 < ratio < 1.25 for ratio in own.values())
    assert max(ratios([MASS, BIAS]).values()) > 2.0
    assert rollouts_over_truth(recordings[1], make_simulator("slider"), [], TRUTH[:3], [MASS]) == {}
