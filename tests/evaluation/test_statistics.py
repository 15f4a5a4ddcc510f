"""Statistics against closed forms and scipy."""

import json

import numpy as np
import pytest
from scipy import stats

from gpsim.channels import Channels
from gpsim.evaluation.predictions import OneStep, compare
from gpsim.evaluation.returns import (
    bootstrap_interval,
    episode_returns,
    interquartile_mean,
    start_sets,
    summarise_seeds,
)
from gpsim.files import plain
from gpsim.simulators import SimulatorPlant, make_simulator
from gpsim.targets.cartpole import FrictionCartPole
from gpsim.tasks import Balance, Start

CARTPOLE = make_simulator("cartpole")
PLANT = SimulatorPlant(CARTPOLE, CARTPOLE.defaults(), "euler", 0.02)


def test_interquartile_mean_is_the_mean_of_the_middle_half():
    assert interquartile_mean(np.array([0.0, 1, 2, 3, 4, 5, 6, 1000])) == pytest.approx(3.5)
    for n in (1, 2, 3, 5, 10, 101):
        values = np.random.default_rng(n).normal(size=n)
        assert interquartile_mean(values) == pytest.approx(stats.trim_mean(values, 0.25))


def test_bootstrap_covers_the_mean_as_often_as_it_says():
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(200):
        low, high = bootstrap_interval(rng.normal(3.0, 1.0, 40), lambda v: float(v.mean()), draws=400)
        covered += low <= 3.0 <= high
    assert stats.binomtest(covered, 200, 0.94).pvalue > 1e-3


def test_seeds_that_share_their_starts_say_no_more_of_them_than_one():
    """Five seeds that solve the same half of 200 starts know that half no better than one of them."""
    one = (np.arange(200) < 100).astype(float)[None]
    mean = lambda v: float(v.mean())  # noqa: E731
    low, high = bootstrap_interval(np.repeat(one, 5, axis=0), mean)
    alone = bootstrap_interval(one, mean)
    assert high - low == pytest.approx(alone[1] - alone[0], rel=0.1)


def test_one_step_scores_of_a_calibrated_model():
    rng, n = np.random.default_rng(0), 20_000
    mean = rng.normal(size=(n, 1)) * 5
    latent, noise = np.full((n, 1), 0.03), np.array([0.01])
    actual = mean + rng.normal(size=(n, 1)) * 0.2
    result = OneStep(actual, mean, latent, noise, np.repeat(np.arange(20), n // 20))
    scores = result.scores(0, rng, sample_noise=True)
    for level, share in scores["coverage"].items():
        assert share == pytest.approx(float(level), abs=0.012)
    assert scores["negative_log_likelihood"] == pytest.approx(0.5 * np.log(2 * np.pi * np.e * 0.04), abs=0.02)
    assert scores["mean"]["rmse"] == pytest.approx(0.2, rel=0.02)
    assert scores["sample"]["rmse"] == pytest.approx(0.2 * np.sqrt(2), rel=0.02)
    function_only = result.scores(0, rng, sample_noise=False)
    assert function_only["sample"]["rmse"] == pytest.approx(np.sqrt(0.04 + 0.03), rel=0.02)


@pytest.mark.filterwarnings("error")
def test_rollouts_that_run_away_are_counted_and_leave_the_others_readable():
    channels = Channels.of({"x": "m", "yaw": "rad"})
    target = np.zeros((20, 5, 2))
    paths = np.full((20, 5, 2), 0.5)
    paths[0, 3:], paths[1, 4:, 1] = np.nan, np.inf
    found = plain(compare(paths, target, channels))
    assert found["not_finite"] == 2
    assert found["bands"]["x"]["median"] == [0.5] * 5
    assert found["rms"] == {"x": None, "yaw": None}
    json.dumps(found, allow_nan=False)
    assert compare(target, target, channels)["not_finite"] == 0


def test_the_average_over_seeds_knows_no_number_that_one_seed_lacks():
    evaluations = [evaluation(0, 0.1), evaluation(1, None), {**evaluation(2, 0.2), "rollout": {"new": 3}}]
    summary = summarise_seeds(evaluations, {}, {}, "cartpole")
    assert summary["one_step"]["x_acc"]["mean"]["nrmse"] is None
    assert summary["outside_recording"] == {"policy": 0.0}
    assert summary["rollout"]["new"] is summary["rollout"]["horizon_s"] is None


def evaluation(seed, nrmse_value):
    return {
        "seed": seed,
        "outside_recording": {"policy": 0.0},
        "one_step": {"x_acc": {"mean": {"nrmse": nrmse_value}}},
        "one_step_random": {"transitions": 10},
        "rollout": {"horizon_s": 2.0, "Source": {"bands": {"x": {"median": [0.0, float(seed)]}}}},
    }


def test_the_three_sets_of_starts_and_the_average_over_seeds():
    returns = {
        "Source": np.array([[100.0, 50, 20, 10], [100, 50, 20, 10]]),
        "Target": np.array([[500.0, 30, 30, 30], [500, 500, 30, 30]]),
    }
    certified = np.array([True, True, True, False])
    sets = start_sets(returns, certified, 500)
    assert sets["returns"].tolist() == [True, True, False, False]
    assert sets["returns_all"].all()
    summary = summarise_seeds([evaluation(0, 0.1), evaluation(1, 0.3)], returns, sets, "cartpole")
    assert summary["share"] == {"returns": 0.5, "returns_all": 1.0, "returns_certified": 0.75}
    assert summary["returns"]["Target"]["mean"] == pytest.approx(np.mean([500, 30, 500, 500]))
    assert summary["returns"]["Target"]["by_seed"] == [265.0, 500.0]
    assert summary["returns"]["Source"]["episodes"] == 4
    assert summary["one_step"]["x_acc"]["mean"]["nrmse"] == pytest.approx(0.2)
    assert summary["rollout"]["Source"]["bands"]["x"]["median"] == [0.0, 0.5]
    # What no policy survived is not solved, however far it got.
    assert not start_sets(returns, certified, 600)["returns"].any()
    assert (start_sets(returns, certified, None)["returns"] == certified).all()  # no return means solved
    without = start_sets({"Source": returns["Source"]}, certified, 500)
    assert without["returns"].tolist() == certified.tolist()


def test_what_has_fallen_runs_away_without_a_warning():
    """Another one plays on: the floats of what is observed overflow, and then those of the state."""

    class Runaway(FrictionCartPole):
        def step(self, state, action, memory, rng):
            return state * 1e20

    plant = Runaway({"gravity": 9.8, "cart_mass": 1.0, "pole_mass": 0.1, "pole_half_length": 0.5}, 0.9, 0.02)
    start = Start(np.array([[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]), np.zeros((2, 0)))
    returns = episode_returns(plant, Balance(), lambda o: np.zeros(len(o), dtype=np.int64), start, None)
    assert returns.tolist() == [500.0, 1.0]
