"""Worlds that prove measured curves: laws that no family has, what truly happens, and what counts as right."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gpsim.trials.blinding import Answer
from gpsim.trials.out_of_catalogue import CURVES, MISSES, drawn_law, missed, smooth, true_curve
from gpsim.trials.scoring_parts import score_curve
from gpsim.trials.summary import summarise
from gpsim.trials.truth import run
from gpsim.trials.worlds import FROM, SYSTEMS, Dial, Scales, TrueEffect

from .outside_worlds import bare, slid, world_of
from .test_scoring import WORLD

PLACES = {
    "free_force_of_speed": ("slider", "q", "q_dot"),
    "free_force_of_position": ("pendulum", "theta", "theta"),
    "free_command": ("slider", "force", "force"),
    "free_reading": ("cartpole", "x", "x"),
    "free_turn": ("unicycle", "vehicle", "v"),
}
LAW = {"size": 1.5, "reach": 0.8, "mirror": 0.0, "a0": 0.7, "c0": -0.4, "w0": 0.2, "a1": -0.5, "c1": 0.1, "w1": 0.3,
       "a2": 0.9, "c2": 0.6, "w2": 0.15}  # fmt: skip


def law_by_hand(x):
    z = x / 0.8
    sigmoid = lambda a, c, w: a * (np.tanh((z - c) / w) + np.tanh(c / w))  # noqa: E731
    return 1.5 * (sigmoid(0.7, -0.4, 0.2) + sigmoid(-0.5, 0.1, 0.3) + sigmoid(0.9, 0.6, 0.15))


@cache
def made(kind):
    """A world with the law, and what truly happens in it."""
    system, on, _ = PLACES[kind]
    values = CURVES[kind].drawn(Scales(*bare(system)), on, Dial(np.random.default_rng(1), 0.8))
    world = world_of(system, [TrueEffect(kind, on, values, out_of_catalogue=True, strength="plain")])
    return world, run(world, world.effects)


@pytest.mark.parametrize(
    "shape", ["2 x", "sgn", "x |x|", "cubic", "clip", "dead zone", "asymmetry", "a wave"]
)
def test_what_the_catalogue_has_is_missed_by_nothing(shape):
    x = np.sort(np.random.default_rng(2).normal(size=400))
    reach = np.quantile(np.abs(x), 0.9)
    laws = {
        "2 x": 2 * x,
        "sgn": np.sign(x) + 0.3 * x,
        "x |x|": x * np.abs(x) - 0.2,
        "cubic": x + 0.4 * x**3,
        "clip": np.clip(x, -0.7 * reach, 0.7 * reach),
        "dead zone": np.where(np.abs(x) < 0.3 * reach, 0, x) - x,
        "asymmetry": np.where(x > 0, 1.2, 0.7) * x,
        "a wave": np.sin(np.pi * x / reach + 0.3),
    }
    assert missed(x, laws[shape]) < 1e-12


def test_drawn_laws_are_none_of_the_catalogues_and_come_in_all_shapes():
    x, odd, steady = np.random.default_rng(3).normal(size=1500), 0, 0
    for seed in range(12):
        k = drawn_law(x, 2.0, False, Dial(np.random.default_rng(seed), 0.5))
        grid = np.linspace(-2, 2, 401)
        does = smooth(k, grid)
        assert missed(x[::3], smooth(k, x[::3])) > MISSES / 2
        assert np.sqrt(np.mean(smooth(k, x) ** 2)) == pytest.approx(2.0, rel=0.1)
        assert smooth(k, np.zeros(1))[0] == pytest.approx(0.0, abs=1e-12)
        odd += np.allclose(does, -does[::-1])
        steady += np.all(np.diff(does) >= -1e-9) or np.all(np.diff(does) <= 1e-9)
    assert 2 <= odd <= 10
    assert 2 <= steady <= 10


def test_the_truth_of_a_force_against_scipy():
    states, _ = slid("free_force_of_speed", LAW, [0.0, 1.0], lambda t: 2.0 * np.sin(3 * t), 1.0)
    found = solve_ivp(
        lambda t, s: [s[1], (2.0 * np.sin(3 * t) + law_by_hand(s[1])) / 2.0],
        (0.0, 1.0), [0.0, 1.0], rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    np.testing.assert_allclose(states[-1], found.y[:, -1], atol=2e-6)


@pytest.mark.parametrize("kind", PLACES)
def test_the_answer_says_what_the_law_adds_where_the_recording_went(kind):
    world, truth = made(kind)
    k = world.effects[0].values
    said = true_curve(world, truth)
    at, adds = np.array(said["at"]), np.array(said["adds"])
    assert (said["family"], said["input"]) == (CURVES[kind].quantity, PLACES[kind][2])
    turns = np.array(said["second"]) if kind == "free_turn" else 1.0
    np.testing.assert_allclose(adds, turns * smooth(k, at), atol=1e-4 * np.ptp(adds))
    names = [*SYSTEMS[world.system].names, *SYSTEMS[world.system].action]
    visited = np.concatenate([truth.sampled[:-1], truth.commands], axis=2)
    channel = "v_cmd" if kind == "free_turn" else PLACES[kind][2]
    x = visited[..., names.index(channel)]
    assert x.min() - 1e-5 <= at.min() < at.max() <= x.max() + 1e-5


def answer_of(kind):
    world, truth = made(kind)
    (effect,) = world.effects
    told = {"family": effect.family, "on": effect.on, "outside": True, "parameters": dict(effect.values)}
    curve = true_curve(world, truth)
    return Answer(
        {"stratum": "curves", "effects": [told], "curve": curve, "visible": True},
        [],
        np.zeros(0),
        np.zeros(0, dtype=int),
    )


def curve_of(kind, answer, bend=0.0, **changes):
    """A measured curve of a law, `bend` of its range too high on the right half."""
    curve, k = answer.content["curve"], answer.content["effects"][0]["parameters"]
    reach = np.ptp(curve["adds"])
    if kind == "free_turn":
        v, w = (np.linspace(min(x), max(x), 33) for x in (curve["at"], curve["second"]))
        values = w[None] * (1 + smooth(k, v)[:, None]) + bend * reach * (w > np.median(w))
        own = {
            "input": "w",
            "at": list(w),
            "second": "v",
            "second_at": list(v),
            "values": list(values.ravel()),
        }
    else:
        x = np.linspace(min(curve["at"]), max(curve["at"]), 41)
        base = 0.0 if curve["family"] == "force_curve" else x
        values = base + smooth(k, x) + bend * reach * (x > np.median(curve["at"]))
        own = {"input": curve["input"], "at": list(x), "values": list(values)}
    (effect,) = answer.content["effects"]
    return {"family": curve["family"], "on": effect["on"], "role": "headline", "form": "approximate",
            "probability": 1.0, "odds": {"nats": 50.0}, "parameters": {}, "curve": own | changes}  # fmt: skip


def report_of(*effects, verdict="partial"):
    return {"verdict": verdict, "effects": list(effects), "alternatives": []}


@pytest.mark.parametrize("kind", PLACES)
def test_a_curve_near_the_law_is_right_and_one_a_fifth_off_is_not(kind):
    answer = answer_of(kind)
    near = score_curve(answer, report_of(curve_of(kind, answer)))
    assert near["off"] < 0.03
    assert near["right"]
    assert near["place_right"]
    assert near["curve_right"]
    assert not near["named_wrong"]
    far = score_curve(answer, report_of(curve_of(kind, answer, bend=0.2)))
    assert far["off"] == pytest.approx(0.2 / np.sqrt(2), abs=0.03)
    assert far["place_right"]
    assert not far["curve_right"]
    assert not far["right"]


def test_the_mean_of_a_curve_may_be_told_beside_it():
    answer = answer_of("free_force_of_position")
    curve = curve_of("free_force_of_position", answer)
    curve["curve"]["values"] = [y - 2.0 for y in curve["curve"]["values"]]
    constant = {**curve, "family": "constant_force", "form": "holds", "curve": None,
                "parameters": {"force": {"value": 2.0}}}  # fmt: skip
    assert not score_curve(answer, report_of(curve))["curve_right"]
    found = score_curve(answer, report_of(curve, constant))
    assert found["right"]
    assert not found["named_wrong"]


def test_where_but_two_commands_were_given_no_law_is_told_from_a_line():
    answer = answer_of("free_command")
    truth = answer.content["curve"]
    both = {"at": [truth["at"][0], truth["at"][-1]] * 9, "adds": [truth["adds"][0], truth["adds"][-1]] * 9}
    two = replace(answer, content=answer.content | {"curve": truth | both})
    assert score_curve(answer, None)["identifiable"]
    assert not score_curve(two, None)["identifiable"]


def test_another_input_another_site_and_a_law_that_is_said_to_hold_are_wrong():
    kind = "free_force_of_speed"
    answer = answer_of(kind)
    curve = curve_of(kind, answer)
    law = {**curve, "family": "viscous_friction", "form": "holds", "curve": None}
    other = score_curve(answer, report_of(curve_of(kind, answer, input="q")))
    assert not other["place_right"]
    assert other["off"] is None
    assert not other["right"]
    assert not score_curve(answer, report_of({**curve, "family": "actuator_curve"}))["place_right"]
    named = score_curve(answer, report_of(law, verdict="named"))
    assert named["named_wrong"]
    assert not named["verdict_right"]
    assert score_curve(answer, report_of(curve, law))["named_wrong"]
    nearest = score_curve(answer, report_of({**law, "form": "approximate"}))
    assert not nearest["named_wrong"]
    assert nearest["verdict_right"]
    assert named["identifiable"]
    failed = score_curve(answer, None)
    assert failed["verdict"] == "failed"
    assert not failed["right"]


def test_the_figures_of_curves():
    kind = "free_command"
    answer = answer_of(kind)
    reports = [report_of(curve_of(kind, answer)), report_of(curve_of(kind, answer, bend=0.3)), None]
    scores = [
        score_curve(answer, report) | WORLD | {"trial": str(FROM["curves"] + i)}
        for i, report in enumerate(reports)
    ]
    content = summarise(scores)
    curves = content["curves"]
    assert (curves["n"], curves["failed"], curves["right"]) == (3, 1, 1)
    assert curves["curve_right"] == pytest.approx(1 / 3)
    assert curves["place_right"] == pytest.approx(2 / 3)
    assert curves["named_wrong"] == 0.0
    assert curves["families"] == {
        kind: {"n": 3, "right": 1, "share": 1 / 3, "interval": curves["families"][kind]["interval"]}
    }
    assert curves["misses"] == [str(FROM["curves"] + 1), str(FROM["curves"] + 2)]
    assert content["all"]["n"] == 0
    assert content["goals"]["curves.curve_right"]["got"] == curves["curve_right"]
