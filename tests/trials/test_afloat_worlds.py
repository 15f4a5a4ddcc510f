"""What floats or stands: dealt and drawn by seed, moved as Newton and Euler say, cut where it falls, concealed."""

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gpsim.recordings import read_recording
from gpsim.trials import concealing as robot_worlds
from gpsim.trials.blinding import recording_digests, write_trial
from gpsim.trials.robots import afloat
from gpsim.trials.robots.afloat import dealt, draw_afloat, items_of
from gpsim.trials.robots.floating import Mover, kept_afloat, run_afloat, turned
from gpsim.trials.robots.models import AFLOAT, layout_of
from gpsim.trials.worlds import FROM, TrueEffect, numbered

pytest.importorskip("mujoco")
DRAG, SQUARE, WIND, LAG = (
    np.array([0.4, 0.25, 0.1]),
    np.array([0.03, 0.02, 0.01]),
    np.array([0.3, -0.2, 0.0]),
    0.03,
)
ALONG = ("surge", "sway", "heave")
EFFECTS = [
    *(TrueEffect("viscous_friction", f"base.{a}", {"damping": d}) for a, d in zip(ALONG, DRAG, strict=True)),
    *(TrueEffect("quadratic_drag", f"base.{a}", {"drag": d}) for a, d in zip(ALONG, SQUARE, strict=True)),
    *(TrueEffect("constant_force", f"base.{a}", {"force": f}) for a, f in zip("xyz", WIND, strict=True)),
    *(TrueEffect("actuator_lag", f"thrust_{i}", {"time_constant": LAG}) for i in range(1, 5)),
    TrueEffect("actuator_gain", "thrust_2", {"gain": 0.9}),
    TrueEffect("parameter_offset", "frame.mass", {"ratio": 1.1}),
    TrueEffect("parameter_offset", "frame.inertia", {"ratio": 1.2}),
]  # fmt: skip
START = np.array([0.1, -0.2, 1.0, 0.9, 0.2, -0.3, 0.1, 1.0, -0.5, 0.3, 0.6, -0.4, 0.8])
START[3:7] /= np.linalg.norm(START[3:7])


@pytest.fixture
def short(monkeypatch):
    """Worlds of few and short episodes."""
    monkeypatch.setattr(afloat, "SECONDS", {"quadrotor": 1.5, "boat": 4.0, "hopper": 1.0, "dog": 1.0})
    monkeypatch.setattr(afloat, "TRANSITIONS", 300)
    monkeypatch.setattr(afloat, "EPISODES", 3)
    monkeypatch.setattr(robot_worlds, "FEWEST", 100)


def world_of(system, effects=(), **more):
    """A world of a robot, from the first number of seed 3 that is dealt it."""
    number = next(
        n for n in range(FROM["afloat"] + 1, FROM["afloat"] + 5) if dealt(3, numbered(n)[1] - 1)[0] == system
    )
    return replace(draw_afloat(3, number), effects=tuple(effects), **more)


def newton_euler(t, s, command):
    """The quadrotor's state and its four rotors, from the numbers of its file."""
    mass, inertia, g = 0.716 * 1.1, np.array([0.007, 0.007, 0.012]) * 1.2, 9.81
    q, v, w, given = s[3:7], s[7:10], s[10:13], s[13:]
    thrust = given * [1.0, 0.9, 1.0, 1.0]
    axes = turned(q)
    along = axes.T @ v
    drag = -(DRAG + SQUARE * np.abs(along)) * along
    force = axes @ drag + axes[:, 2] * thrust.sum() + WIND
    x, y = np.array([0.12, -0.12, -0.12, 0.12]), np.array([0.12, 0.12, -0.12, -0.12])
    turn = np.array([thrust @ y, -thrust @ x, 0.016 * (thrust @ [-1.0, 1.0, -1.0, 1.0])])
    spin = (turn - np.cross(w, inertia * w)) / inertia
    (a, b, c, d), (p, r, u) = q, w
    rates = 0.5 * np.array(
        [-b * p - c * r - d * u, a * p + c * u - d * r, a * r + d * p - b * u, a * u + b * r - c * p]
    )
    return np.concatenate([v, rates, force / mass - [0.0, 0.0, g], spin, (command - given) / LAG])


def test_the_quadrotor_flies_as_newton_and_euler_say():
    mover, command = Mover("quadrotor", EFFECTS), np.array([2.2, 1.9, 2.3, 2.0])
    found = mover.data(*mover.places(START))
    given = mover.sample(found, mover.rest, np.array([mover.rest, command]), 1600)
    begun = np.concatenate([START, mover.rest])
    exact = solve_ivp(newton_euler, (0.0, 0.8), begun, rtol=1e-10, atol=1e-12, args=(command,)).y[:, -1]
    assert np.abs(exact[:13] - START).max() > 0.5
    np.testing.assert_allclose(given, exact[13:], rtol=1e-6)
    np.testing.assert_allclose(mover.state(found), exact[:13], atol=5e-4)
    fine = Mover("quadrotor", EFFECTS, 1.25e-4)  # what is left is of the step
    data = fine.data(*fine.places(START))
    fine.sample(data, fine.rest, np.array([fine.rest, command]), 6400)
    off = [np.abs(m.state(d) - exact[:13]).max() for m, d in ((mover, found), (fine, data))]
    assert off[1] < 0.4 * off[0]


def test_late_commands_act_for_the_rest_of_a_sample():
    late = [TrueEffect("actuator_delay", a, {"delay": 0.025}) for a in layout_of("boat").action]
    mover, other = Mover("boat", late), Mover("boat", ())
    first, second = (m.data(*m.places(START)) for m in (mover, other))
    old, new = np.array([1.0, -1.0]), np.array([-2.0, 3.0])
    mover.sample(first, old, np.array([old, new]), 40)
    other.sample(second, old, old[None], 25)
    other.sample(second, old, new[None], 15)
    np.testing.assert_array_equal(mover.state(first), other.state(second))


def test_each_robot_comes_once_in_four_and_lacks_nothing_once_in_sixteen():
    for block in range(3):
        found = [dealt(5, 16 * block + i) for i in range(16)]
        for cycle in range(4):
            assert {name for name, _, _ in found[4 * cycle : 4 * cycle + 4]} == set(AFLOAT)
        assert Counter(name for name, nothing, _ in found if nothing) == dict.fromkeys(AFLOAT, 1)
        speeds = Counter(name for name, _, twist in found if twist)
        assert speeds == {"quadrotor": 2, "boat": 2, "hopper": 4, "dog": 4}


def test_worlds_are_drawn_by_seed_and_lack_one_to_five_of_what_their_robot_may():
    for number in range(FROM["afloat"] + 1, FROM["afloat"] + 33):
        world = draw_afloat(7, number)
        assert world == draw_afloat(7, number)
        places = {(family, on): name for family, places, name, _ in items_of(world.system) for on in places}
        assert all(set(e.values) == {places[e.family, e.on]} for e in world.effects)
        lacks = {
            e.family if e.family in ("actuator_lag", "actuator_delay") else e.name for e in world.effects
        }
        assert len(lacks) <= 5
        assert (not lacks) == dealt(7, numbered(number)[1] - 1)[1]
        assert not {"actuator_lag", "actuator_delay"} <= lacks
    assert draw_afloat(7, FROM["afloat"] + 1) != draw_afloat(8, FROM["afloat"] + 1)


def test_a_dog_that_is_overloaded_falls_and_is_cut_there(short):
    load = TrueEffect("parameter_offset", "trunk.mass", {"ratio": 5.0})
    world = world_of("dog", [load], episodes=2, steps=300)
    truth = run_afloat(world)
    kept = kept_afloat(truth)
    assert (kept < 301).any()
    e = int(np.argmin(kept))
    assert truth.free[int(kept[e]) - 1, e] == 1.0
    assert not truth.clean[int(kept[e]) :, e].any()


def test_a_concealed_world_is_the_same_bytes_and_its_answer_is_not_public(short, tmp_path):
    number = next(
        n
        for n in range(FROM["afloat"] + 1, FROM["afloat"] + 40)
        if dealt(3, numbered(n)[1] - 1) == ("quadrotor", False, False)
    )
    for out in (tmp_path / "a", tmp_path / "b"):
        (out / "public").mkdir(parents=True)
        write_trial(out, 3, number)
    public = tmp_path / "a" / "public" / str(number)
    assert recording_digests(public) == recording_digests(tmp_path / "b" / "public" / str(number))
    answer = json.loads((tmp_path / "a" / "private" / str(number) / "answer.json").read_text())
    assert (answer["stratum"], answer["afloat"]["model"]) == ("afloat", "quadrotor.xml")
    assert all(e["rollout"] >= 4.0 for e in answer["effects"])
    recording = read_recording(public)
    assert recording.state.names == tuple(f"base.{p}" for p in ("x", "y", "z", "qw", "qx", "qy", "qz"))
    q = recording.episodes[0].states[:, 3:]
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-9)
    assert sorted(p.name for p in public.iterdir()) == ["quadrotor.xml", "recording.csv", "recording.yaml"]
    text = (public / "recording.yaml").read_text()
    assert not any(e["family"] in text for e in answer["effects"])
