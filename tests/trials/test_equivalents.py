"""The rule for equivalents: what no recording of the kind could tell from the truth."""

from dataclasses import replace

import pytest

from gpsim.trials import concealing as concealment
from gpsim.trials.blinding import Answer
from gpsim.trials.drawing import draw
from gpsim.trials.fits import rivals
from gpsim.trials.worlds import TrueEffect

SEED, NUMBER = 5, 10


def concealed_slider(monkeypatch, effects, **how):
    """A slider with these effects, seen by its position alone: the answer and the recording."""

    def drawn(seed, number, attempt=0):
        world = draw(seed, number, attempt)
        assert world.system == "slider"
        usual = {"engine": "rk4", "velocities": "differentiated", "episodes": 10, "steps": 260}
        return replace(world, effects=effects, **(usual | how))

    monkeypatch.setattr(concealment, "draw", drawn)
    concealed = concealment.conceal(SEED, NUMBER)
    content = concealed.answer("")
    return Answer(content, [e.states for e in concealed.clean.episodes], None, None), concealed.recordings[0]


@pytest.fixture
def pushed_and_late(monkeypatch):
    """Pushed and commanded late."""
    effects = (
        TrueEffect("constant_force", "q", {"force": 1.0}, strength="plain"),
        TrueEffect("actuator_delay", "force", {"delay": 0.03}, strength="plain"),
    )
    return concealed_slider(monkeypatch, effects)


def test_what_nobody_asks_for_has_no_rivals(monkeypatch):
    """A dead zone of a speed that is differentiated from positions shows in no reading."""
    effects = (TrueEffect("sensor_dead_zone", "q_dot", {"width": 0.1}, strength="plain"),)
    assert rivals(*concealed_slider(monkeypatch, effects)) == []


@pytest.mark.slow
def test_of_two_pushes_a_gain_and_a_bias_are_an_asymmetry(monkeypatch):
    effects = (
        TrueEffect("actuator_gain", "force", {"gain": 0.8}, strength="plain"),
        TrueEffect("actuator_bias", "force", {"bias": 0.5}, strength="plain"),
    )
    world = concealed_slider(monkeypatch, effects, excitation="bang_bang", steps=210)
    equal = {frozenset(r.claims) for r in rivals(*world) if r.equivalent}
    assert frozenset({("actuator_asymmetry", "force")}) in equal


@pytest.mark.slow
def test_two_effects_may_change_their_places_together(pushed_and_late):
    equal = {frozenset(r.claims) for r in rivals(*pushed_and_late) if r.equivalent}
    bias, push = ("actuator_bias", "force"), ("constant_force", "q")
    late, late_sensor = ("actuator_delay", "force"), ("sensor_delay", "q")
    assert {frozenset({bias, late}), frozenset({push, late_sensor}), frozenset({bias, late_sensor})} <= equal
    assert frozenset({push}) not in equal
    assert frozenset({push, late}) not in equal  # the truth is no rival of itself


@pytest.mark.slow
def test_a_gain_of_a_swinging_pendulum_is_a_mass(monkeypatch):
    """Motions part so fast that a fit from what was measured gets stuck; the truth leads to the other explanation."""
    whole = draw(2027, 770)
    assert (whole.system, [(e.family, e.on) for e in whole.effects]) == (
        "pendulum",
        [("actuator_gain", "torque")],
    )
    short = replace(whole, episodes=10, steps=200)
    monkeypatch.setattr(concealment, "draw", lambda seed, number, attempt=0: short)
    concealed = concealment.conceal(2027, 770)
    content = concealed.answer("")
    answer = Answer(content, [e.states for e in concealed.clean.episodes], None, None)
    equal = {r.claims for r in rivals(answer, concealed.recordings[0]) if r.equivalent}
    assert (("parameter_offset", "mass"),) in equal
