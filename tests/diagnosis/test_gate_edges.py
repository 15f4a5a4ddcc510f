"""Edges of gates, and the limits of a search: what it may spend, and what passes for a law patched together."""

import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from made_diagnoses import made_diagnosis, made_effect, made_remainder

from gpsim.channels import wrap_angle
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import fit
from gpsim.diagnosis.fitting.score_test import Directions
from gpsim.diagnosis.report import Estimate, RemainderGp
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.selection import bins
from gpsim.diagnosis.selection import gate_edges as edges_module
from gpsim.diagnosis.selection.bins import bin_edges, range_around
from gpsim.diagnosis.selection.gate_edges import placed
from gpsim.diagnosis.selection.gates import FAR_REACH
from gpsim.diagnosis.settings import read_settings
from gpsim.diagnosis.setup.candidates import candidates
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.effects import Gate, Term
from gpsim.reports.account import account_of
from gpsim.reports.account_lines import account_lines
from gpsim.simulators import Simulator, make_simulator

from .worlds import World, record


def braked(low=0.12, high=0.45, since=None):
    """A slider with friction between two places, or a push since a moment."""
    world = World("slider")
    if since is None:
        world.forces[0] = lambda q, v, t: -3.0 * v * ((q > low) & (q < high))
    else:
        world.forces[0] = lambda q, v, t: 1.5 * (t >= since) + 0 * q
    recording = record(world, seed=3, noise=0.1, episodes=6)
    simulator = make_simulator("slider")
    return recording, simulator, prepare(recording, simulator, simulator.defaults(recording.parameters))


def started(question, simulator, family, values, gate):
    offers = candidates(question.recording, simulator, simulator.defaults({}))
    offer = next(c for c in offers if c.family == family and c.place.on == "q")
    term = Term(family, "q", values, gate, offer.variant)
    problem = question.everything
    return problem, fit(problem, Hypothesis().plus(term, offer.declared), problem.windows.measured[:, 0])


def test_scans_find_edges_that_lie_far_from_where_they_begin():
    _, simulator, question = braked()
    problem, at = started(
        question, simulator, "viscous_friction", {"damping": 2.0}, Gate(region={"q": (0.2, 0.55)})
    )
    found = placed(problem, at, 0, FAR_REACH, 2e-4)
    low, high = found.hypothesis.terms[0].gate.region["q"]
    assert low == pytest.approx(0.12, abs=5e-3)
    assert high == pytest.approx(0.45, abs=5e-3)
    assert found.objective < at.objective


def test_an_onset_is_placed_between_two_samples():
    recording, simulator, question = braked(since=1.4567)
    problem, at = started(question, simulator, "constant_force", {"force": 1.0}, Gate(since=1.7))
    found = placed(problem, at, 0, FAR_REACH, 1e-4)
    assert found.hypothesis.terms[0].gate.since == pytest.approx(1.4567, abs=recording.dt / 4)


@pytest.mark.parametrize(
    ("width", "limit", "levels"), [(1.18, 1.23, True), (1.3, 1.23, True), (0.4, 1.23, False)]
)
def test_a_dead_zone_as_wide_as_a_limit_is_high_is_a_patchwork(width, limit, levels):
    """Trials 225 and 343 of the blind test of seed 2027: a motor of three levels was called so, with a gain."""
    dead = Term("actuator_dead_zone", "force", {"width": width})
    limited = Term("actuator_saturation", "force", {"limit": limit})
    assert Hypothesis((dead, limited), ((), ())).is_patchwork() == levels
    assert not Hypothesis((dead, replace(limited, on="other")), ((), ())).is_patchwork()
    assert not Hypothesis((dead,), ((),)).is_patchwork()


def test_terms_in_two_regions_of_a_channel_are_a_patchwork():
    a = Term("constant_force", "q", {"force": 1.0}, Gate(region={"q": (0.0, 1.0)}))
    b = Term("viscous_friction", "q", {"damping": 1.0}, Gate(region={"q": (1.0, 2.0)}))
    same = Term("viscous_friction", "q", {"damping": 1.0}, Gate(region={"q": (0.0, 1.0)}))
    assert Hypothesis((a, b), ((), ())).is_patchwork()
    assert not Hypothesis((a, same), ((), ())).is_patchwork()
    nearly = replace(same, gate=Gate(region={"q": (-1e-4, 1.02)}))  # its edges were placed by another fit
    assert not Hypothesis((a, nearly), ((), ())).is_patchwork()
    assert Hypothesis((a, replace(same, gate=Gate(region={"q": (0.0, 1.2)}))), ((), ())).is_patchwork()
    assert not Hypothesis((a,), ((),)).is_patchwork()


class Circling(NamedTuple):
    """As much of a problem as bins look at."""

    windows: SimpleNamespace
    simulator: Simulator = make_simulator("unicycle")
    run: Run = Run()

    @classmethod
    def of(cls, yaw):
        measured = np.zeros((1, len(yaw), 3))
        measured[0, :, 2] = yaw
        return cls(SimpleNamespace(measured=measured, valid=np.ones((1, len(yaw)), dtype=np.bool_)))

    def bins_with(self, yaw):
        """In how many bins an angle lies, as gates see it."""
        channels, edges = self.simulator.state + self.simulator.action, bin_edges(self, "yaw")
        states, zero = np.stack([0 * yaw, 0 * yaw, yaw], axis=1), np.zeros(len(yaw))
        shares = [
            Gate(region={"yaw": (low, high)}).share(
                (states, states), np.zeros((len(yaw), 2)), zero, zero, channels, {}
            )
            for low, high in pairwise(edges)
        ]
        return np.sum(shares, axis=0)


def test_bins_of_an_angle_go_once_round_the_circle():
    """A window's angle runs on beyond pi: bins of all that was seen lay two deep around the seam."""
    rng = np.random.default_rng(0)
    yaw = rng.uniform(-np.pi, np.pi, 500) + rng.uniform(-1.0, 1.0, 500)
    round_ = Circling.of(yaw)
    assert bin_edges(round_, "yaw")[[0, -1]] == pytest.approx([-np.pi, np.pi])
    np.testing.assert_array_equal(round_.bins_with(rng.uniform(-4.0, 4.0, 300)), 1.0)


def test_as_many_bins_as_are_asked_for(monkeypatch):
    circling = Circling.of(np.random.default_rng(0).uniform(-0.5, 0.5, 400))
    assert len(bin_edges(circling, "yaw")) == 24 + 1
    settings = read_settings({"gates": {"bins": 6}})
    monkeypatch.setattr(bins, "EDGE_MARGIN", 0.0)
    few = bin_edges(circling._replace(run=Run(settings=settings)), "yaw")
    assert len(few) == 6 + 1
    assert few[[0, -1]] == pytest.approx([-0.5, 0.5], abs=0.01)


def test_bins_of_an_angle_run_on_over_the_seam_where_it_was_visited():
    rng = np.random.default_rng(0)
    yaw = wrap_angle(rng.uniform(np.pi - 0.6, np.pi + 0.5, 400))
    across = Circling.of(yaw)
    edges = bin_edges(across, "yaw")
    assert edges[-1] - edges[0] == pytest.approx(1.21, abs=0.02)
    np.testing.assert_array_equal(across.bins_with(rng.uniform(np.pi - 0.55, np.pi + 0.45, 300)), 1.0)
    ahead = Circling.of(rng.uniform(-0.5, 0.5, 400))
    assert np.abs(bin_edges(ahead, "yaw")).max() < 0.6


def test_edges_of_a_region_move_in_the_turn_in_which_it_lies():
    rng = np.random.default_rng(0)
    round_, across = (Circling.of(rng.uniform(-half, half, 800) + np.pi) for half in (np.pi, 0.6))
    assert range_around(round_, "yaw", (2.8, 3.6)) == pytest.approx((3.2 - np.pi, 3.2 + np.pi))
    first, last = range_around(across, "yaw", (-3.2, -2.9))
    assert first == pytest.approx(-np.pi - 0.66, abs=0.03)
    assert last == pytest.approx(-np.pi + 0.66, abs=0.03)
    assert range_around(across, "yaw", (3.0, 3.3)) == pytest.approx((first + 2 * np.pi, last + 2 * np.pi))


def test_an_edge_that_stays_is_not_looked_at_and_a_fit_that_stands_is_looked_from_once(monkeypatch):
    _, simulator, question = braked(since=1.4567)
    problem, at = started(question, simulator, "constant_force", {"force": 1.0}, Gate(since=1.4567))
    seen = []

    class Noted(Directions):
        def __init__(self, problem, parent):
            seen.append(parent)
            super().__init__(problem, parent)

    monkeypatch.setattr(edges_module, "Directions", Noted)
    placed(problem, at, 0, FAR_REACH, 1e-4)
    assert seen
    assert len({id(parent) for parent in seen}) == len(seen)


def test_a_rollout_that_ran_away_is_told_in_words():
    assert "diverged" in "\n".join(account_lines(account_of(made_diagnosis())))


def test_what_could_not_be_computed_is_told_in_words():
    effect = made_effect(parameters={"stiffness": Estimate(1.0, None, None, "N")})
    remainder = made_remainder(structured=True, p_value=math.nan, gp=RemainderGp(True, "effects", None))
    told = "\n".join(
        account_lines(account_of(made_diagnosis(verdict="partial", effects=(effect,), remainder=remainder)))
    )
    assert "1 ± ? N" in told
    assert "nan" not in told.lower()
