"""Whether a term could act in a region only, told before anything is fitted."""

import numpy as np
import pytest

from gpsim.channels import Channels
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import fit
from gpsim.diagnosis.fitting.score_test import Directions, screened, stronger
from gpsim.diagnosis.selection.gates import _best_run, gated_children, may_be_limited, with_edges
from gpsim.diagnosis.selection.substitution import left_open
from gpsim.diagnosis.setup.candidates import candidates
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.effects import Gate, Place, Term, effect_of
from gpsim.effects.chain import Chain
from gpsim.simulators import make_simulator

from .worlds import World, record

SLIDER = make_simulator("slider")


def limited(force) -> list[str | None]:
    recording = record(World("slider", forces={0: force}), seed=2, episodes=8, steps=155, session=True)
    problem = prepare(recording, SLIDER, recording.parameters).everything
    drag = next(
        c for c in candidates(recording, SLIDER, recording.parameters) if c.family == "viscous_friction"
    )
    hypothesis = Hypothesis().plus(drag.term([1.0]), drag.declared)
    leader = fit(problem, hypothesis, problem.windows.measured[:, 0])
    without = left_open(problem, leader, 0)
    shared = type(without)(**{**vars(without), "variance": leader.variance})
    values = tuple(leader.hypothesis.theta)
    return may_be_limited(Directions(problem, leader), Directions(problem, shared), drag, values)


@pytest.mark.parametrize(
    ("family", "value", "expected"),
    [("actuator_saturation", 3.0, 1.5), ("actuator_rate_limit", 3.0, 1.5), ("actuator_gain", 0.9, 0.8)],
)
def test_twice_as_much_of_a_law_is_half_of_a_limit(family, value, expected):
    (parameter,) = effect_of(family).parameters(Place("force", "N", span=5.0, dt=0.5))
    assert stronger(parameter, value, 2.0) == pytest.approx(expected)
    assert parameter.low <= stronger(parameter, value, 1e9) <= parameter.high


@pytest.mark.parametrize("since", [16.0, 21.0])
def test_a_limit_that_began_late_is_found_from_what_acting_everywhere_made_of_it(since):
    """Diluted, the limit is far too high: stretched like a force it went out of reach, and the fit did not move it."""
    limits = [lambda u, t, h, m: np.where(np.asarray(t)[:, None] >= since, np.clip(u, -1.0, 1.0), u)]
    recording = record(World("slider", filters=limits), seed=2, episodes=10, steps=155, session=True)
    problem = prepare(recording, SLIDER, recording.parameters).everything
    offers = candidates(recording, SLIDER, recording.parameters)
    offer = next(c for c in offers if c.family == "actuator_saturation")
    nothing = fit(problem, Hypothesis(), problem.windows.measured[:, 0])
    directions = Directions(problem, nothing)
    (_, _, start), *_ = screened(directions, [offer])
    plain = fit(problem, Hypothesis().plus(offer.term(start), offer.declared), nothing.starts)
    assert plain.hypothesis.theta[0] > 3.5
    found = with_edges(
        problem, gated_children(problem, directions, [plain], [offer], [None], few=directions)
    )[0]
    assert found.hypothesis.theta[0] == pytest.approx(1.0, abs=0.05)
    assert found.hypothesis.terms[0].gate.since == pytest.approx(since, abs=0.5)


def test_a_law_that_acts_everywhere_is_missed_wherever_it_is_taken_away():
    assert limited(lambda q, v, t: -2.0 * v) == []


def test_a_law_that_acts_in_a_region_or_late_is_not():
    assert "q" in limited(lambda q, v, t: -4.0 * v * (q > np.quantile(q, 0.3)))
    assert None in limited(lambda q, v, t: -2.0 * v * (t > 8.0))


def test_a_run_of_bins_goes_on_over_the_cut_of_a_circle():
    pull = np.array([3.0, 0.0, 0.0, 0.0, 3.0, 3.0])
    assert _best_run(pull, np.eye(6))[:2] == (4, 5)
    assert _best_run(pull, np.eye(6), circle=True) == (4, 6, 81.0 / 6, 81.0 / 12)
    assert _best_run(pull, np.eye(6), suffix=True)[:2] == (4, 5)


@pytest.mark.parametrize("middle", [np.pi, 0.5])
def test_a_region_of_a_heading_is_found_whole_wherever_the_circle_is_cut(middle):
    """A vehicle that turns all round: its heading has no place where it was not."""
    unicycle = make_simulator("unicycle")
    acts = lambda yaw: np.cos(yaw - middle) > np.cos(0.6)  # noqa: E731
    world = World("unicycle", twist=lambda v, s, w: (0.6 * v, s, w), headings=acts)
    recording = record(world, seed=2, episodes=8, steps=155, noise=0.3)
    problem = prepare(recording, unicycle, recording.parameters).everything
    offers = candidates(recording, unicycle, recording.parameters)
    offer = next(c for c in offers if (c.family, c.place.on) == ("actuator_gain", "v_cmd"))
    nothing = fit(problem, Hypothesis(), problem.windows.measured[:, 0])
    directions = Directions(problem, nothing)
    (_, _, start), *_ = screened(directions, [offer])
    plain = fit(problem, Hypothesis().plus(offer.term(start), offer.declared), nothing.starts)
    found = with_edges(problem, gated_children(problem, directions, [plain], [offer], ["yaw"]))[0]
    low, high = found.hypothesis.terms[0].gate.region["yaw"]
    assert found.hypothesis.theta[0] == pytest.approx(0.6, abs=0.02)
    assert high - low == pytest.approx(1.2, abs=0.05)
    assert np.cos((low + high) / 2 - middle) == pytest.approx(1.0, abs=1e-3)


def test_a_second_region_of_an_angle_lies_in_the_turn_of_the_first():
    from gpsim.diagnosis.selection.gates import Proposal, _child

    unicycle = make_simulator("unicycle")
    recording = record(World("unicycle"), seed=2, episodes=6, steps=155)
    problem = prepare(recording, unicycle, recording.parameters).everything
    offers = candidates(recording, unicycle, recording.parameters)
    gain, bias = (next(c for c in offers if c.family == f"actuator_{kind}") for kind in ("gain", "bias"))
    first = Hypothesis().plus(gain.term([0.8]), gain.declared).gated(0, Gate(region={"yaw": (2.5, 3.5)}))
    second = _child(
        problem, first, Proposal(9.0, bias, (0.1,), "yaw", 2.52 - 2 * np.pi, 3.5 - 2 * np.pi, True)
    )
    assert second.terms[1].gate.region["yaw"] == pytest.approx((2.52, 3.5))
    assert not second.is_patchwork()


def test_a_gate_on_a_position_lasts_as_long_in_somebody_elses_simulator():
    """One whose position has a rate of its own: without its rates, nothing would move on within a substep."""

    class Own(type(SLIDER)):
        rate = Channels.of({"q_rate": "m/s", "q_acc": "m/s^2"})

        def rates(self, state, action, parameters, forces=None):
            return np.hstack([state[:, 1:], super().rates(state, action, parameters, forces)])

        def derivative(self, state, rates):
            return np.array(rates)

    terms = (Term("constant_force", "q", {"force": 3.0}, Gate(region={"q": (0.01, 0.5)})),)
    values = [{"force": np.full(5, 3.0)}]
    state, step = np.stack([np.linspace(0, 0.012, 5), np.ones(5)], axis=1), np.full(5, 0.01)
    ends = [
        Chain(simulator, {"mass": 2.0}, terms, "fine", 0.01).advance(
            state, np.zeros((5, 1)), values, step, np.zeros(5)
        )
        for simulator in (SLIDER, Own())
    ]
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-12)
    assert len(np.unique(ends[0][:, 1])) >= 3
