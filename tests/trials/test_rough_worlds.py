"""Rough worlds: nuisances of small shares, a truth whose share decides, logs as real ones are; plain worlds stay."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest

from gpsim.recordings import read_recording
from gpsim.trials.blinding import ANSWER, PUBLIC, write_trial
from gpsim.trials.concealing import conceal, even_recording, logged
from gpsim.trials.shares import Shares
from gpsim.trials.truth import Replay, run
from gpsim.trials.worlds import FROM, SYSTEMS, Rough, TrueEffect

from .outside_worlds import world_of

DRAWN = [
    pytest.param((7, FROM["rough"] + 1), id="unicycle"),
    pytest.param(
        (6, FROM["rough"] + 3), id="slider", marks=pytest.mark.slow
    ),  # a pendulum's takes half as long
    pytest.param((7, FROM["rough"] + 3), id="pendulum"),
]


@pytest.fixture(scope="module", params=DRAWN)
def concealed(request):
    return conceal(*request.param)


# What is drawn


def test_main_effects_lead_and_nuisances_stay_small(concealed):
    world, rough = concealed.world, concealed.rough
    assert 1 <= len(world.main) <= 3
    assert 2 <= len(world.effects) - len(world.main) <= 4
    assert len(rough["nuisances"]) == len(world.effects) - len(world.main)
    assert all(0.005 <= share <= 0.08 for share in rough["nuisances"])
    assert sum(m["importance"] for m in rough["main"]) == pytest.approx(rough["explained"])
    assert all(m["importance"] > 0.05 for m in rough["main"])
    assert world.excitation in ("tracking", "controller")
    assert world.integrator == "rk4"
    assert len(world.rough.defects) >= 3
    assert Shares(world, run(world, world.effects), np.full(world.episodes, world.steps + 1.0)).late() < 0.04
    assert concealed.recordings[0].transition_count < 8000


MASS, DAMPING, CUBIC, PUSH, RATE = 2.0, 3.0, 4.0, 0.6, 7.0


def test_the_shares_are_those_of_equations_written_down_by_hand():
    """A slider with viscous friction, and a cubic spring and a fan as nuisances."""
    effects = [
        TrueEffect("viscous_friction", "q", {"damping": DAMPING}),
        TrueEffect("hardening_spring", "q", {"cubic": CUBIC}, out_of_catalogue=True),
        TrueEffect(
            "fan",
            "q",
            {"amplitude": PUSH, "frequency": RATE / (2 * np.pi), "phase": 0.3},
            out_of_catalogue=True,
        ),
    ]
    world = world_of("slider", effects, parameters={"mass": MASS}, episodes=5, steps=90, clock="session")
    world = replace(world, noise={"q": 1e-6, "q_dot": 1e-6})
    truth = run(world, effects)
    found = Shares(world, truth, np.full(5, 91.0))

    def rolled(damping, cubic, push):
        out, h = [], 1e-3
        for k in range(0, 41, 6):
            s, wall = truth.sampled[k, 4].copy(), truth.wall[4] + 0.02 * k
            path = []
            for j in range(1000):
                u = truth.commands[k + j // 20, 4, 0]

                def slope(y, t, u=u):
                    fan = push * np.sin(RATE * t + 0.3)
                    return np.array([y[1], (u - damping * y[1] - cubic * y[0] ** 3 + fan) / MASS])

                a = slope(s, wall + j * h)
                b = slope(s + h / 2 * a, wall + j * h + h / 2)
                s = s + h * b
                path.append(s)
            out.append(path[19::20])
        return np.array(out)

    true = rolled(DAMPING, CUBIC, PUSH)
    np.testing.assert_allclose(true[0], truth.sampled[1:51, 4], atol=1e-4)
    squares = lambda *model: np.mean((true - rolled(*model)) ** 2, axis=(0, 1))  # noqa: E731
    before = squares(0.0, 0.0, 0.0)
    spread = np.concatenate([truth.sampled[k : k + 51, 4] for k in range(0, 41, 6)]).std(axis=0)
    weights = before / spread**2
    share = lambda left: weights @ np.clip(left / before, 0, 1) / weights.sum()  # noqa: E731
    assert found.explained(effects[:1]) == pytest.approx(1 - share(squares(DAMPING, 0.0, 0.0)), rel=1e-2)
    assert found.of(effects[1]) == pytest.approx(share(squares(DAMPING, 0.0, PUSH)), rel=1e-2)
    assert found.of(effects[2]) == pytest.approx(share(squares(DAMPING, CUBIC, 0.0)), rel=1e-2)


def test_what_several_effects_hide_is_known_one_by_one():
    """A replay without one of them finds the hidden states of the others."""
    effects = [
        TrueEffect("bouc_wen", "q", {"amplitude": 1.0, "width": 0.05}, out_of_catalogue=True),
        TrueEffect("towed_trolley", "vehicle", {"length": 0.4, "pull": 0.3}, out_of_catalogue=True),
        TrueEffect("rubber_buffer", "q", {"stiffness": 5.0, "time": 0.3}, out_of_catalogue=True),
    ]
    for system, present in (("slider", [effects[0], effects[2]]), ("unicycle", [effects[1]])):
        world = world_of(system, present)
        truth = run(world, present)
        picks = np.array([[7, 33], [1, 2]])
        ends = Replay(world, truth, present).states(picks, 20)
        np.testing.assert_allclose(ends, truth.sampled[picks[0] + 20, picks[1]], atol=1e-9)


# How it is driven


@pytest.mark.parametrize("system", ["slider", "pendulum", "cartpole", "unicycle"])
def test_a_controller_answers_to_what_is_measured(system):
    world = world_of(
        system, excitation="tracking", steps=100, posture="upright" if system == "cartpole" else ""
    )
    quiet = run(world, ())
    loud = run(replace(world, noise=dict.fromkeys(SYSTEMS[system].names, 0.02)), ())
    assert np.abs(quiet.commands[1:] - loud.commands[1:]).max() > 1e-3
    if system == "cartpole":
        assert np.abs(quiet.sampled[..., 2]).max() < 0.5  # it balances


# The log


@pytest.fixture(scope="module")
def even():
    world = world_of("slider", excitation="tracking", steps=600, episodes=5, noise={"q": 1e-4, "q_dot": 1e-3})
    truth = run(world, (), 1e-2)
    return world, even_recording(world, truth.measured, truth, np.full(5, 601.0))


def states_of(recording):
    return np.concatenate([e.states for e in recording.episodes])


def test_a_log_is_the_even_recording_but_for_its_encoders_steps(even):
    world, recording = even
    log = logged(world, Rough(quantum={"q": 0.002}), recording)
    read = states_of(log.recording)
    assert set(log.counts.values()) == {0}
    np.testing.assert_allclose(np.round(read[:, 0] / 0.002) * 0.002, read[:, 0], atol=1e-12)
    assert np.abs(read[:, 0] - states_of(recording)[:, 0]).max() <= 0.001 + 1e-12
    np.testing.assert_array_equal(read[:, 1], states_of(recording)[:, 1])


def test_lost_rows_are_missing_and_their_commands_with_them(even):
    world, recording = even
    log = logged(world, Rough(dropped=0.03), recording)
    assert 5 * 601 - len(states_of(log.recording)) == log.counts["dropped"]
    assert 0.01 < log.counts["dropped"] / (5 * 601) < 0.06
    for before, after in zip(recording.episodes, log.recording.episodes, strict=True):
        rows = np.searchsorted(before.t, after.t)
        np.testing.assert_array_equal(before.states[rows], after.states)
        np.testing.assert_array_equal(before.actions[rows[:-1]], after.actions)
        assert (after.t[0], after.t[-1]) == (before.t[0], before.t[-1])


def test_repeats_say_what_was_said_before_and_swaps_leap(even):
    world, recording = even
    stale = logged(world, Rough(repeated=0.02), recording)
    same = sum((np.diff(e.states, axis=0) == 0).all(axis=1).sum() for e in stale.recording.episodes)
    assert same == stale.counts["repeated"] > 20
    swapped = logged(world, Rough(swapped=0.004, leap={"q": 0.2}), recording)
    off = states_of(swapped.recording) - states_of(recording)
    assert (np.abs(off[:, 0]) > 0.1).sum() == swapped.counts["swapped"] > 2
    assert (off[:, 1] == 0).all()


def test_stamps_jitter_and_drift_and_never_go_back(even):
    world, recording = even
    log = logged(world, Rough(jitter=0.1 * world.dt, drift=1e-3), recording).recording
    for before, after in zip(recording.episodes, log.episodes, strict=True):
        assert (np.diff(after.t) > 0).all()
        late = after.t - before.t - 1e-3 * before.t
        assert np.abs(late).max() <= 0.4 * world.dt + 1e-9
        assert 0.05 * world.dt < late.std() < 0.2 * world.dt
    assert log.episodes[-1].t[-1] / recording.episodes[-1].t[-1] == pytest.approx(1.001, abs=2e-4)


def test_a_late_topic_is_read_late():
    effects = [TrueEffect("viscous_friction", "q", {"damping": 1.0})]
    world = world_of("slider", effects)
    late = replace(world, rough=Rough(late={"q": 0.01, "q_dot": 0.01}))
    truth = run(late, effects)
    fine = truth.fine[truth.per_sample :: truth.per_sample]
    back = truth.fine[truth.per_sample - 10 :: truth.per_sample][: len(fine)]
    np.testing.assert_array_equal(truth.clean[1:], back)
    shares = Shares(late, truth, np.full(4, 61.0))
    assert shares.explained(effects) == pytest.approx(1.0)  # no model is blamed for it
    later = replace(world, rough=Rough(late={"q": 0.02, "q_dot": 0.02}))
    more = Shares(later, run(later, effects), np.full(4, 61.0)).late()
    assert shares.late() > 0.0
    assert more == pytest.approx(4 * shares.late(), rel=0.4)


# What is written


def test_a_rough_world_is_written_and_read_and_the_same_every_time(tmp_path):
    ((seed, number),) = DRAWN[0].values
    digests = [write_trial(tmp_path / name, seed, number) for name in ("one", "two")]
    assert digests[0] == digests[1]
    folders = [tmp_path / name / PUBLIC / str(number) for name in ("one", "two")]
    for file in ("recording.csv", "recording.yaml"):
        assert (folders[0] / file).read_bytes() == (folders[1] / file).read_bytes()
    recording = read_recording(folders[0])
    assert recording.transition_count > 1000
    assert not {"rough", "outside"} & set((folders[0] / "recording.yaml").read_text().split())


PLAIN = {
    (7, 5): (
        "673372a202429b9944c2c0a730fb5519510f25ceda2c0dbeaee246d158208e85",
        "edf9138f5d34b12efacf3b91e2ceb59bad8275da11cfb49ccc9eda4bc8d1cd07",
    ),
    (12, 2): (
        "6f0357184a4b1ba2d5d516564552ebc49ed0f67ffad9174f8dbc861d0aa7cd0b",
        "680b04930b217476f8594fb2a73264b77271e6a4a0f69e8241b9b631ee1d7e8f",
    ),
}


@pytest.mark.parametrize(("seed", "number"), PLAIN)
def test_plain_worlds_are_byte_for_byte_what_they_were(seed, number, tmp_path):
    """Hashes of the version before there were rough worlds, of worlds whose last digits no processor rounds its own way."""
    digest = write_trial(tmp_path, seed, number)
    csv = (tmp_path / PUBLIC / f"{number:04d}" / "recording.csv").read_bytes()
    assert (digest, hashlib.sha256(csv).hexdigest()) == PLAIN[seed, number]
    assert "rough" not in (tmp_path / "private" / f"{number:04d}" / ANSWER).read_text()


# Numbers
