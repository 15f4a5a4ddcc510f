"""Free curves: a right law holds, a wrong one is only approximate, and the curve beside it is the true one."""

import pickle
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.form import (
    Departure,
    Group,
    forms,
    free_curve,
    free_curves,
    further_input,
    groups_of,
    missing_curve,
)
from gpsim.diagnosis.judgement.laws import _stand_ins
from gpsim.diagnosis.report import Explained, Share
from gpsim.diagnosis.selection import LackOfFit
from gpsim.diagnosis.settings import FormSettings, Settings
from gpsim.effects import Gate, Term
from gpsim.simulators import make_simulator

from .laws import explained, explained_by, gain
from .truths import channel_filter, delayed, sensor
from .worlds import World

DRY_AND_VISCOUS = ("coulomb_friction", "q"), ("viscous_friction", "q")
LOSING = {0: lambda q, v, t: -1.0 * v}


def pushed(function):
    return World("slider", filters=[channel_filter(0, lambda u, t, h, m: function(u))])


def judged(question, laws, curve):
    """The form of a curve's group, to which all belongs that the laws explain."""
    group = curve.group
    share = explained(question, laws.hypothesis) / len(group.terms)
    gained, importance = gain(question, laws, curve), dict.fromkeys(group.terms, share)
    said = forms([group], [gained], [curve.departure], importance, FormSettings())
    assert len(set(said.values())) == 1
    return said[group.terms[0]]


def only(question, laws):
    (group,) = groups_of(laws.hypothesis)
    return free_curve(question.everything, laws, group)


def off(curve, truth):
    """How far a curve is off at most, and its law, in parts of the largest true value; where the data are."""
    inner = slice(2, -2)
    true = truth(np.array(curve.at))
    size = np.abs(true).max()
    return tuple(float(np.abs(np.array(said) - true)[inner].max() / size) for said in (curve.free, curve.law))


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 1.0, 5.0])
def test_friction_that_is_named_right_holds(noise):
    world = World("slider", forces=LOSING, grips={0: lambda q, v, n: 1.2 + 0 * v})
    question, laws = explained_by(world, *DRY_AND_VISCOUS, noise=noise)
    curve = only(question, laws)
    assert curve.group.terms == (0, 1)
    assert judged(question, laws, curve) == "holds"
    assert abs(gain(question, laws, curve).share) < 0.02
    assert curve.departure.low < 0.02
    if noise <= 1.0:
        assert off(curve.curve, lambda v: -1.2 * np.sign(v) - v)[0] < 0.03


def test_stick_and_slip_that_is_named_right_holds():
    def friction(v):
        return 0.6 + 1.2 * np.exp(-((v / 0.2) ** 2))

    world = World("slider", grips={0: lambda q, v, n: friction(v)})
    question, laws = explained_by(world, ("stribeck_friction", "q"))
    curve = only(question, laws)
    assert judged(question, laws, curve) == "holds"
    assert off(curve.curve, lambda v: -np.sign(v) * friction(v))[0] < 0.03


def test_a_cubic_spring_that_a_linear_one_stands_for_is_approximate_and_its_curve_is_cubic():
    question, laws = explained_by(World("slider", forces={0: lambda q, v, t: -4 * q**3}), ("spring", "q"))
    curve = only(question, laws)
    assert judged(question, laws, curve) == "approximate"
    free, law = off(curve.curve, lambda q: -4 * q**3)
    assert free < 0.04 < 0.1 < law
    said = curve.curve
    assert (said.quantity, said.unit, said.input, said.input_unit) == ("force on q", "N", "q", "m")
    assert said.effects == (("spring", "q"),)


def test_friction_that_grows_with_the_root_of_speed_is_seen_beside_a_quadratic_one():
    def friction(v):
        return -2 * np.sign(v) * np.sqrt(np.abs(v))

    world = World("slider", forces={0: lambda q, v, t: friction(v)})
    question, laws = explained_by(world, ("quadratic_drag", "q"))
    curve = only(question, laws)
    assert judged(question, laws, curve) == "approximate"
    free, law = off(curve.curve, friction)
    assert free < 0.15 < 0.3 < law  # it is steepest where the speed hardly ever is: at 0


def test_a_jump_of_friction_at_rest_is_in_the_curve():
    """Of Stribeck friction that Coulomb friction stands for."""

    def friction(v):
        return -np.sign(v) * (0.6 + 1.2 * np.exp(-((v / 0.3) ** 2)))

    world = World("slider", grips={0: lambda q, v, n: np.abs(friction(np.where(v == 0, 1e-9, v)))})
    question, laws = explained_by(world, ("coulomb_friction", "q"))
    curve = only(question, laws)
    assert judged(question, laws, curve) == "approximate"
    at, beside = np.array(curve.curve.at), np.array(curve.curve.free)
    (before,), (after,) = beside[at == at[at < 0].max()], beside[at == at[at > 0].min()]
    assert before == pytest.approx(1.8, rel=0.2)
    assert after == pytest.approx(-1.8, rel=0.2)
    free, law = off(curve.curve, friction)
    assert free < law / 2


@pytest.mark.slow
def test_a_soft_threshold_is_not_a_dead_zone_and_its_curve_has_no_jump():
    def soft(u):
        return u - 1.5 * np.tanh(u / 1.5)

    question, laws = explained_by(pushed(soft), ("actuator_dead_zone", "force"))
    curve = only(question, laws)
    assert judged(question, laws, curve) == "approximate"
    assert off(curve.curve, soft)[0] < 0.05


@pytest.mark.parametrize(
    ("family", "truth"),
    [
        ("actuator_dead_zone", lambda u: u * (np.abs(u) > 1.5)),
        ("actuator_saturation", lambda u: np.clip(u, -3.6, 3.6)),
        ("actuator_asymmetry", lambda u: np.where(u > 0, 0.8, 1.1) * u),
    ],
)
def test_actuators_that_are_named_right_hold(family, truth):
    question, laws = explained_by(pushed(truth), (family, "force"))
    curve = only(question, laws)
    assert judged(question, laws, curve) == "holds"
    assert np.abs(np.array(curve.curve.free) - np.array(curve.curve.law)).max() < 0.1


def test_a_curve_acts_behind_the_delay_that_is_named_beside_its_law():
    late = delayed(0.05)
    world = World("slider", filters=[channel_filter(0, lambda u, t, h, m: 3 * np.tanh(late(u, t, h, m) / 3))])
    question, laws = explained_by(world, ("actuator_delay", "force"), ("actuator_gain", "force"))
    untested, group = groups_of(laws.hypothesis)
    assert not untested.testable
    curve = free_curve(question.everything, laws, group)
    assert off(curve.curve, lambda u: 3 * np.tanh(u / 3))[0] < 0.05
    assert gain(question, laws, curve).low > 0.0
    assert free_curve(question.everything, laws, untested) is None


def test_sliding_out_of_curves_by_another_law_is_approximate():
    question, laws = explained_by(
        World("unicycle", twist=lambda v, s, w: (v, s - 0.1 * w, w)), ("lateral_slip", "vehicle")
    )
    curve = only(question, laws)
    assert judged(question, laws, curve) == "approximate"
    assert off(curve.curve, lambda w: -0.1 * w)[0] < 0.1
    assert (curve.curve.quantity, curve.curve.input) == ("v_lateral", "w")


def test_understeer_that_is_named_right_holds():
    question, laws = explained_by(
        World("unicycle", twist=lambda v, s, w: (v, s, w / (1 + 0.6 * v**2))), ("understeer", "vehicle")
    )
    assert judged(question, laws, only(question, laws)) == "holds"


@pytest.mark.parametrize(
    ("reads", "form"), [(lambda y: 1.1 * y, "holds"), (lambda y: y + 0.3 * y**3, "approximate")]
)
def test_a_scale_holds_where_it_is_one(reads, form):
    world = World("slider", sensors=[sensor(0, lambda y, t: reads(y))])
    question, laws = explained_by(world, ("sensor_scale", "q"))
    curve = only(question, laws)
    assert judged(question, laws, curve) == form
    assert off(curve.curve, reads)[0] < 0.15


def test_a_further_input_multiplies_the_curve():
    world = World("slider", grips={0: lambda q, v, n: 0.5 + 3 * q**2})
    question, laws = explained_by(world, ("coulomb_friction", "q"))
    lack = LackOfFit("q_acc", ("q", "q_dot"), 100.0, 1e-30, True)
    groups = groups_of(laws.hypothesis)
    (plain,), (both,) = (free_curves(question.everything, laws, groups, such) for such in (None, lack))
    assert (plain.further, both.further) == (None, "q")
    assert set(both.curve.given) == {"q"}
    assert abs(gain(question, laws, plain).share) < 0.01
    assert gain(question, laws, both).share > 0.05  # its interval goes by how a processor rounds


def test_a_further_input_multiplies_the_curve_of_a_command():
    """A vehicle that slows down in curves, of which an actuator's gain was named."""
    world = World("unicycle", twist=lambda v, s, w: (v * (1 - 0.3 * np.abs(w)), s, w))
    question, laws = explained_by(world, ("actuator_gain", "v_cmd"), episodes=10)
    (group,) = groups_of(laws.hypothesis)
    curve = free_curve(question.everything, laws, group, "w_cmd")
    assert gain(question, laws, curve).low > 0.1
    at, given = np.array(curve.curve.at), curve.curve.given["w_cmd"]
    assert np.abs(np.array(curve.curve.free) - at * (1 - 0.3 * abs(given))).max() < 0.1 * np.abs(at).max()


def test_what_is_missing_is_drawn_without_a_name():
    world = World("pendulum", forces={0: lambda q, v, t: 0.3 * np.sin(6 * q)})
    question, nothing = explained_by(world, episodes=10)
    lack = LackOfFit("theta_acc", ("theta",), 100.0, 1e-30, True)
    curve = missing_curve(question.everything, nothing, lack)
    assert curve.curve.effects == ()
    assert (curve.curve.quantity, curve.curve.unit) == ("theta_acc", "rad/s^2")
    at = np.array(curve.curve.at)
    inertia = 1.0 * 0.5**2
    right = np.corrcoef(curve.curve.free, 0.3 * np.sin(6 * at) / inertia)[0, 1]
    assert right > 0.9
    assert gain(question, nothing, curve).low > 0.0


def test_what_is_missing_of_two_inputs_is_drawn_over_the_first():
    world = World("unicycle", twist=lambda v, s, w: (v * (1 - 0.3 * np.abs(w)), s, w))
    question, nothing = explained_by(world, episodes=10)
    lack = LackOfFit("v", ("w_cmd", "v_cmd"), 100.0, 1e-30, True)
    said = missing_curve(question.everything, nothing, lack).curve
    assert (said.input, set(said.given)) == ("w_cmd", {"v_cmd"})
    true = -0.3 * np.abs(np.array(said.at)) * said.given["v_cmd"]
    np.testing.assert_allclose(said.free, true, atol=0.15 * np.abs(true).max() + 0.01)


def test_the_band_holds_the_truth():
    inside = []
    for seed in range(4):
        question, laws = explained_by(
            World("slider", forces={0: lambda q, v, t: -4 * q**3}), ("spring", "q"), seed=seed
        )
        said = only(question, laws).curve
        true = -4 * np.array(said.at) ** 3
        inside.append(np.mean((np.array(said.low) <= true) & (true <= np.array(said.high))))
    assert np.mean(inside) > 0.75
    width = np.array(said.high) - np.array(said.low)
    assert width.max() < np.abs(true).max() / 2


def test_a_curve_can_be_sent_to_another_process():
    question, laws = explained_by(
        World("slider", grips={0: lambda q, v, n: 1.2 + 0 * v}), ("coulomb_friction", "q"), episodes=5
    )
    curve = only(question, laws)
    again = pickle.loads(pickle.dumps(curve))
    assert again.hypothesis == curve.hypothesis
    assert gain(question, laws, again) == gain(question, laws, curve)


def test_an_input_that_stands_still_has_no_curve():
    question, laws = explained_by(pushed(lambda u: u + 0.5), ("actuator_bias", "force"), episodes=5)
    problem = question.everything
    still = problem.on(problem.windows)
    still.windows.actions[:] = 1.0
    (group,) = groups_of(laws.hypothesis)
    assert free_curve(still, laws, group) is None


def test_a_law_that_does_nothing_is_not_infinitely_far_off():
    """A dead zone that is narrower than any command."""
    question, laws = explained_by(pushed(lambda u: u), ("actuator_dead_zone", "force"), episodes=5)
    narrow = replace(laws, hypothesis=laws.hypothesis.having(np.array([1e-6])))
    (group,) = groups_of(narrow.hypothesis)
    curve = free_curve(question.everything, narrow, group)
    assert curve.departure.low < FormSettings().departs
    assert curve.departure.size < 1.0
    np.testing.assert_allclose(curve.curve.free, curve.curve.at, atol=0.2)  # of commands up to 8 N


def said(*terms):
    return Hypothesis(tuple(terms), tuple(() for _ in terms))


def term(family, on, gate=None, **values):
    return Term(family, on, values, gate or Gate())


def test_laws_of_one_input_at_one_place_are_one_group():
    groups = groups_of(
        said(
            term("coulomb_friction", "x"),
            term("viscous_friction", "theta"),
            term("viscous_friction", "x"),
            term("spring", "x"),
            term("actuator_gain", "force"),
            term("actuator_delay", "force"),
            term("actuator_lag", "force"),
            term("actuator_saturation", "force"),
            term("parameter_offset", "cart_mass"),
            term("parameter_offset", "gravity"),
            term("stribeck_friction", "x"),
        )
    )
    assert [(g.of, g.terms) for g in groups] == [
        ("speed", (0, 2, 10)),
        ("speed", (1,)),
        ("position", (3,)),
        ("command", (4, 7)),
        ("nothing", (5, 6)),
        ("nothing", (8, 9)),
    ]
    assert [g.dry for g in groups[:3]] == [True, False, False]


def test_what_acts_elsewhere_or_later_is_a_group_of_its_own_and_a_region_of_its_own_input_is_part_of_a_law():
    late, here = Gate(since=3.0), Gate({"q": (0.0, 0.4)})
    groups = groups_of(
        said(
            term("viscous_friction", "q"),
            term("viscous_friction", "q", late),
            term("local_friction_patch", "q", here),
            term("quadratic_drag", "q", here),
        )
    )
    assert [(g.terms, g.gate) for g in groups] == [
        ((0,), Gate()),
        ((1,), late),
        ((2,), Gate()),
        ((3,), here),
    ]


def test_parts_of_a_twist_are_apart():
    groups = groups_of(
        said(term("understeer", "vehicle"), term("lateral_slip", "vehicle"), term("steering_bias", "vehicle"))
    )
    assert [(g.changes, g.terms) for g in groups] == [("w", (0, 2)), ("v_lateral", (1,))]


def test_only_the_terms_that_count_are_grouped():
    hypothesis = said(term("coulomb_friction", "q"), term("viscous_friction", "q"))
    assert [g.terms for g in groups_of(hypothesis, {1})] == [(1,)]


@pytest.mark.parametrize(
    ("on", "significant", "further"),
    [
        (("x", "x_dot"), True, "x"),
        (("x_dot", "theta"), True, "theta"),
        (("x_dot",), True, None),
        (("x", "theta"), True, None),
        (("x", "x_dot"), False, None),
    ],
)
def test_the_other_of_two_inputs_multiplies_a_curve_only_beside_its_own(on, significant, further):
    (group,) = groups_of(said(term("coulomb_friction", "x")))
    lack = LackOfFit("x_acc", on, 100.0, 0.0, significant)
    assert further_input(make_simulator("cartpole"), group, lack) == further


SPEED = Group("force", "q", "speed", (0, 1))
LATE = Group("actuator", "force", "nothing", (2,))
IMPORTANCE = {0: 0.3, 1: 0.2, 2: 0.4}


NEAR, FAR = Departure(0.1, 0.05, 0.15), Departure(0.4, 0.35, 0.45)


@pytest.mark.parametrize(
    ("gained", "apart", "form"),
    [
        (Share(0.06, 0.051, 0.07), NEAR, "approximate"),
        (Share(0.06, 0.049, 0.07), NEAR, "holds"),
        (Share(0.20, None, None), FAR, "holds"),
        (Share(0.02, 0.004, 0.03), FAR, "approximate"),
        (Share(0.02, 0.002, 0.03), FAR, "holds"),
        (None, None, "untested"),
    ],
)
def test_a_law_is_approximate_where_its_curve_surely_explains_a_tenth_more_or_is_another(gained, apart, form):
    assert forms([SPEED], [gained], [apart], IMPORTANCE, FormSettings()) == {0: form, 1: form}


@pytest.mark.parametrize(
    ("missing", "speed", "form"),
    [
        (None, 0.0, "untested"),
        (Share(0.05, 0.041, 0.06), 0.0, "approximate"),
        (Share(0.05, 0.039, 0.06), 0.0, "untested"),
        (Share(0.05, 0.041, 0.06), 0.06, "untested"),  # the curve of another's law explains it
    ],
)
def test_what_has_no_curve_is_untested_unless_a_tenth_more_is_missing_beside_it(missing, speed, form):
    gains = [Share(speed, speed - 0.01, speed + 0.01), None]
    assert forms([SPEED, LATE], gains, [NEAR, None], IMPORTANCE, FormSettings(), missing)[2] == form


@pytest.mark.parametrize(
    ("settings", "form"),
    [
        ({}, "approximate"),
        ({"approximate": 0.2}, "holds"),
        ({"approximate": 0.2, "departs": 0.04}, "approximate"),
    ],
)
def test_what_is_only_approximate_is_a_setting(settings, form):
    gains = [Share(0.06, 0.051, 0.07)]
    assert forms([SPEED], gains, [NEAR], IMPORTANCE, FormSettings(**settings))[0] == form


@pytest.mark.parametrize(
    ("share", "region", "bent"),
    [
        (Share(0.95, 0.92, 0.97), {}, set()),
        (Share(0.70, 0.60, 0.91), {}, set()),  # not surely much without a name
        (Share(0.85, 0.80, 0.88), {}, {1}),
        (Share(0.95, 0.92, 0.97), {"x": (0.0, 1.0)}, {1}),
    ],
)
def test_a_parameter_beside_much_without_a_name_or_in_a_region_only_stands_in(share, region, bent):
    account = said(
        term("viscous_friction", "theta", damping=1.0),
        term("parameter_offset", "cart_mass", Gate(region=region), ratio=1.2),
    )
    question = SimpleNamespace(run=SimpleNamespace(settings=Settings()))
    judgement = SimpleNamespace(leader=SimpleNamespace(hypothesis=account), structured=True)
    worth = SimpleNamespace(
        share=share, importance=(Share(0.9), Share(0.1)), explained=Explained(rollout=share)
    )
    assert _stand_ins(question, judgement, worth, groups_of(account)) == bent
    assert _stand_ins(question, judgement, worth, groups_of(account, among=[0])) == set()


@pytest.mark.parametrize(
    ("share", "importance", "bent"),
    [
        (Share(0.70, 0.60, 0.80), (0.45, 0.25), {0, 1}),
        (Share(0.85, 0.80, 0.88), (0.70, 0.15), {1}),  # the first is five times what is left and more
        (Share(0.95, 0.92, 0.97), (0.90, 0.05), set()),
    ],
)
def test_what_is_not_much_more_than_what_has_no_name_only_stands_in(share, importance, bent):
    account = said(term("viscous_friction", "theta", damping=1.0), term("actuator_gain", "force", gain=0.9))
    question = SimpleNamespace(run=SimpleNamespace(settings=Settings()))
    judgement = SimpleNamespace(leader=SimpleNamespace(hypothesis=account), structured=True)
    worth = SimpleNamespace(
        share=share, importance=tuple(map(Share, importance)), explained=Explained(rollout=share)
    )
    assert _stand_ins(question, judgement, worth, groups_of(account)) == bent
