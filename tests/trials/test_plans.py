"""Worlds for plans: recorded slowly, played again from rest, and decided by whoever tells the explanations apart."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.stages.prove import numbers_of
from gpsim.trials.concealing import conceal, played
from gpsim.trials.drawing import HIDDEN, box_of, draw_plan
from gpsim.trials.plan_rivals import compared
from gpsim.trials.worlds import FROM, TrueEffect, numbered


def test_every_hidden_effect_comes_once_a_cycle_and_a_seed_gives_the_same_worlds():
    numbers = numbers_of(0, plan=len(HIDDEN))
    assert [numbered(n) for n in numbers] == [("plans", i + 1) for i in range(len(HIDDEN))]
    assert {draw_plan(3, n).effects[-1].family for n in numbers} == set(HIDDEN)
    assert draw_plan(3, numbers[0]) == draw_plan(3, numbers[0])
    assert draw_plan(4, numbers[0]) != draw_plan(3, numbers[0])


@pytest.fixture(scope="module")
def late():
    """A world whose torque is late."""
    number = next(
        n
        for n in range(FROM["plans"] + 1, FROM["plans"] + 9)
        if draw_plan(3, n).effects[-1].family == "actuator_delay"
    )
    return conceal(3, number)


def test_the_first_recording_is_slow_and_stays_in_the_box(late):
    (episode,) = late.recordings[0].episodes
    (low, high), (_, fast) = late.limits["box"].values()
    assert low < episode.states[:, 0].min() < episode.states[:, 0].max() < high
    assert np.abs(np.diff(episode.actions[:, 0])).max() < 0.1 * np.abs(episode.actions).max()
    assert np.abs(late.clean.episodes[0].states[:, 1]).max() < fast


def test_what_is_played_begins_at_rest_and_whoever_leaves_the_box_is_stopped(late):
    still = np.zeros((40, 1))
    hard = np.full((40, 1), 5.0 * np.abs(late.recordings[0].episodes[0].actions).max())
    second, left = played(late.world, np.stack([still, hard], axis=1), box_of(late.world))
    assert left[0] == 40
    assert 0 < left[1] < 40
    noise = late.world.noise["theta"]
    assert np.abs(second.episodes[0].states[:, 0]).max() < 6.0 * noise
    other, _ = played(late.world, still[:, None], box_of(late.world))
    assert not np.array_equal(other.episodes[0].states[:, 0], late.recordings[0].episodes[0].states[:41, 0])


def test_a_truth_that_no_explanation_holds_is_not_compared(late):
    from made_posteriors import LAG_OR_DELAY, made_posterior

    world = replace(late.world, effects=(TrueEffect("spring", "theta", {"stiffness": 1.0}),))
    found = compared(world, late.limits, late.recordings[0], made_posterior(*LAG_OR_DELAY), None)
    assert not found.listed
