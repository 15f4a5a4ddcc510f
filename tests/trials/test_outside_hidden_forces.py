"""Materials and masses with a hidden state, as physics: momentum, energy, an integrator of its own."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from gpsim.trials.outside import hidden_forces
from gpsim.trials.truth.body import Body
from gpsim.trials.worlds import TrueEffect

from .outside_worlds import H, driven, reference, slid

GREASE = {"damping": 4.0, "time": 0.4, "way": 0.15}
LOAD = {"inertia": 0.9, "gap": 0.1, "stiffness": 400.0, "loss": 0.3}
FLYWHEEL = {"grip": 1.5, "inertia": 0.8, "speed": 0.05}
SLEDGE = {"friction": 2.0, "slack": 0.2, "inertia": 0.4, "stiffness": 250.0, "speed": 0.02}


def test_a_rubber_buffer_is_a_spring_at_first_and_a_damper_in_the_end():
    law = hidden_forces.RubberBuffer({"stiffness": 8.0, "time": 0.5})
    z, v, h = law.begin(np.zeros(1), np.zeros(1)), np.full(1, 0.3), 1e-4
    for step in range(50_000):
        z = z + h * law.drift(v, v, z)
        if step == 99:
            assert law.force(v, v, z)[0] == pytest.approx(-8.0 * 0.3 * 100 * h, rel=0.02)
    assert law.force(v, v, z)[0] == pytest.approx(-8.0 * 0.5 * 0.3, rel=1e-3)


def test_a_rubber_buffer_only_takes_energy():
    effect = TrueEffect("rubber_buffer", "q", {"stiffness": 20.0, "time": 0.3})
    body, t = Body("slider", {"mass": 2.0}, [effect]), np.zeros(1)
    s = np.array([[0.0, 1.0]])
    z, energies = body.begin(s), []
    for _ in range(2000):
        energies.append(s[0, 1] ** 2 + z[0, 0] ** 2 / (2 * 20.0))
        s, z = body.step(s, z, np.zeros((1, 1)), t, t, 1e-3)
    assert (np.diff(energies) < 1e-12).all()
    assert energies[-1] < 0.5 * energies[0]


def test_grease_gels_at_rest_and_thins_in_motion():
    law, v = hidden_forces.ThixotropicGrease(GREASE), np.array([0.0, 0.3, 3.0])
    z = law.begin(v, v)
    assert law.force(v, v, z).tolist() == (-4.0 * v).tolist()
    for _ in range(5000):
        z = z + H * law.drift(v, v, z)
    assert z[:, 0] == pytest.approx(
        1 / (1 + 0.4 * v / 0.15), rel=1e-6
    )  # faster than that it hardly resists more
    gel = z.copy()
    for _ in range(800):
        gel = gel + H * law.drift(v, 0 * v, gel)
    assert 1 - gel[:, 0] == pytest.approx((1 - z[:, 0]) * np.exp(-2.0), rel=5e-3)


def test_grease_on_a_slider_is_integrated_exactly():
    def slope(t, y):
        _, v, z = y
        return [v, (5 * np.sin(6 * t) - 4.0 * z * v) / 2.0, (1 - z) / 0.4 - abs(v) * z / 0.15]

    s, z = driven(
        "slider",
        {"mass": 2.0},
        TrueEffect("thixotropic_grease", "q", GREASE),
        [0.1, 0.0],
        lambda t: 5 * np.sin(6 * t),
        2.0,
    )
    exact = reference(slope, [0.1, 0.0, 1.0], 2.0, 2001)
    # The push is held for a fine step here and not there.
    np.testing.assert_allclose(np.column_stack([s, z[:, 0]]), exact, atol=2e-5)
    assert (z[:, 0] > 0).all()
    assert z[:, 0].max() <= 1.0


def test_a_loose_load_is_integrated_exactly():
    def slope(t, y):
        q, v, p, r = y
        depth, side = max(abs(p - q) - 0.1, 0.0), np.sign(p - q)
        force = 400.0 * side * depth * max(1 + 0.3 * side * (r - v), 0.0)
        return [v, (6 * np.sin(5 * t) + force) / 2.0, r, -force / 0.9]

    effect = TrueEffect("loose_load", "q", LOAD)
    s, z = driven("slider", {"mass": 2.0}, effect, [0.1, 0.5], lambda t: 6 * np.sin(5 * t), 2.0)
    exact = reference(slope, [0.1, 0.5, 0.1, 0.5], 2.0, 2001)
    np.testing.assert_allclose(np.hstack([s, z]), exact, atol=2e-4)
    assert np.abs(z[:, 0] - s[:, 0]).max() > 0.1  # it knocked


def test_a_loose_load_is_not_there_until_it_knocks_and_keeps_the_momentum():
    effect = TrueEffect("loose_load", "q", LOAD)
    body, t, none = Body("slider", {"mass": 2.0}, [effect]), np.zeros(1), np.zeros((1, 1))
    s, z = np.array([[0.0, 1.0]]), np.array([[0.0, 0.0]])
    energies = []
    for step in range(4000):
        if step == 90:
            assert (s[0, 1], z[0, 1]) == (1.0, 0.0)
        energies.append(s[0, 1] ** 2 + 0.45 * z[0, 1] ** 2)
        spring = 200.0 * max(abs(z[0, 0] - s[0, 0]) - 0.1, 0.0) ** 2
        energies[-1] += spring
        s, z = body.step(s, z, none, t, t, H)
        assert 2.0 * s[0, 1] + 0.9 * z[0, 1] == pytest.approx(2.0, rel=1e-9)
    # A buffer that is touched between two stages of a step is met a little early or late.
    assert np.diff(energies).max() < 1e-4
    assert 0.9 * energies[0] > energies[-1] > 2.0 / 2.9 - 1e-6  # what moving together has is left


def test_a_buffer_never_pulls():
    rng, law = np.random.default_rng(0), hidden_forces.LooseLoad(LOAD)
    q, v = rng.uniform(-1, 1, 500), rng.uniform(-20, 20, 500)
    z = np.stack([rng.uniform(-1, 1, 500), rng.uniform(-20, 20, 500)], axis=1)
    force = law.force(q, v, z)
    assert (force * (z[:, 0] - q) >= 0).all()
    assert (force[np.abs(z[:, 0] - q) < 0.1] == 0).all()


def test_a_slipping_flywheel_is_integrated_exactly():
    def slope(t, y):
        _, v, _, r = y
        grip = 1.5 * np.tanh((r - v) / 0.05)
        return [v, (6 * np.sin(5 * t) + grip) / 2.0, r, -grip / 0.8]

    effect = TrueEffect("slipping_flywheel", "q", FLYWHEEL)
    s, z = driven("slider", {"mass": 2.0}, effect, [0.1, 0.5], lambda t: 6 * np.sin(5 * t), 2.0)
    exact = reference(slope, [0.1, 0.5, 0.1, 0.5], 2.0, 2001)
    np.testing.assert_allclose(np.hstack([s, z]), exact, atol=5e-5)
    assert np.abs(z[:, 1] - s[:, 1]).max() > 2 * 0.05  # it slipped


@pytest.mark.parametrize(("push", "acceleration"), [(1.0, 1.0 / 2.8), (20.0, (20.0 - 1.5) / 2.0)])
def test_a_flywheel_comes_along_gently_and_slips_when_jerked(push, acceleration):
    effect = TrueEffect("slipping_flywheel", "q", FLYWHEEL)
    s, z = driven("slider", {"mass": 2.0}, effect, [0.0, 0.0], lambda t: push, 1.5)
    assert (s[-1, 1] - s[-501, 1]) / 0.5 == pytest.approx(acceleration, rel=1e-3)
    momentum = 2.0 * s[:, 1] + 0.8 * z[:, 1]
    np.testing.assert_allclose(momentum, push * H * np.arange(len(s)), atol=1e-9)


def test_a_clutch_never_gives_energy():
    effect = TrueEffect("slipping_flywheel", "q", FLYWHEEL)
    body, t, none = Body("slider", {"mass": 2.0}, [effect]), np.zeros(1), np.zeros((1, 1))
    s, z = np.array([[0.0, 3.0]]), np.array([[0.0, -1.0]])
    energies = []
    for _ in range(3000):
        energies.append(s[0, 1] ** 2 + 0.4 * z[0, 1] ** 2)
        s, z = body.step(s, z, none, t, t, H)
    assert np.diff(energies).max() < 1e-12
    assert energies[-1] == pytest.approx(0.5 * (6.0 - 0.8) ** 2 / 2.8, rel=1e-6)  # what moving together has


def test_a_sledge_is_integrated_exactly():
    def slope(t, y):
        q, v, p, r = y
        rope = 250.0 * np.sign(p - q) * max(abs(p - q) - 0.2, 0.0)
        return [v, (6 * np.sin(4 * t) + rope) / 2.0, r, -(rope + 2.0 * np.tanh(r / 0.02)) / 0.4]

    s, z = slid("towed_sledge", SLEDGE, [0.1, 0.5], lambda t: 6 * np.sin(4 * t), 2.0)
    exact = reference(slope, [0.1, 0.5, 0.1, 0.5], 2.0, 2001)
    np.testing.assert_allclose(np.hstack([s, z]), exact, atol=5e-4)
    assert np.abs(z[:, 0] - s[:, 0]).max() > 0.2  # the rope was taut


def test_a_sledge_is_not_there_within_the_slack_and_then_costs_its_friction():
    s, z = slid("towed_sledge", SLEDGE, [0.0, 0.0], lambda t: 3.0, 6.0)
    first = int(np.argmax(np.abs(z[:, 0] - s[:, 0]) >= 0.2))
    t = H * np.arange(len(s))
    np.testing.assert_allclose(s[:first, 0], 0.75 * t[:first] ** 2, atol=1e-9)
    assert s[first, 0] == pytest.approx(0.2, abs=2e-3)
    momentum = 2.0 * s[:, 1] + 0.4 * z[:, 1]
    lost = cumulative_trapezoid(2.0 * np.tanh(z[:, 1] / 0.02), t, initial=0.0)
    np.testing.assert_allclose(momentum, 3.0 * t - lost, atol=1e-4)
    assert (momentum[-1] - momentum[-1001]) / 1.0 == pytest.approx(3.0 - 2.0, rel=1e-3)


def test_a_sledge_never_gives_energy():
    s, z = slid("towed_sledge", SLEDGE, [0.0, 3.0], lambda t: 0.0, 4.0)
    far = np.maximum(np.abs(z[:, 0] - s[:, 0]) - 0.2, 0.0)
    energy = s[:, 1] ** 2 + 0.2 * z[:, 1] ** 2 + 125.0 * far**2
    # A rope that is taut between two stages of a step only pulls a little early or late.
    assert np.diff(energy).max() < 2e-4
    assert energy[-1] < 0.2 * energy[0]


def test_a_brake_that_fades_grips_as_much_as_its_heat_says():
    k = {"force": 3.0, "speed": 0.01, "fade": 2.0, "typical": 0.5, "time": 0.4}
    law, v = hidden_forces.FadingBrake(k), np.array([0.5, -0.5, 1.0])
    z = law.begin(v, v)
    np.testing.assert_allclose(law.force(v, v, z), -3.0 * np.sign(v))
    for _ in range(400):
        z = z + H * law.drift(v, v, z)
    hot = 2.0 * np.abs(v) / 0.5 * (1 - np.exp(-1.0))
    np.testing.assert_allclose(law.force(v, v, z), -3.0 * np.sign(v) / (1 + hot), rtol=2e-3)


def test_an_energy_sink_keeps_the_momentum_and_takes_energy():
    k = {"inertia": 0.3, "cubic": 500.0, "damping": 0.4}
    states, hidden = slid("energy_sink", k, [0.0, 1.0], lambda t: 0.0, 3.0)
    still, _ = slid("energy_sink", {**k, "damping": 0.0}, [0.0, 1.0], lambda t: 0.0, 0.2)
    assert still[-1, 1] == pytest.approx(1.0)  # it moves along: nothing to transmit
    states, hidden = slid("energy_sink", k, [0.0, 0.0], lambda t: 4.0 * (t < 0.5), 3.0)
    momentum = 2.0 * states[:, 1] + 0.3 * hidden[:, 1]
    assert momentum[-1] == pytest.approx(2.0, rel=1e-6)
    off = hidden[:, 0] - states[:, 0]
    energy = states[:, 1] ** 2 + 0.15 * hidden[:, 1] ** 2 + 125.0 * off**4
    assert (np.diff(energy[501:]) < 1e-9).all()
    assert energy[-1] < energy[501]


def test_an_energy_sink_on_a_slider_is_integrated_exactly():
    def slope(t, y):
        q, v, p, r = y
        pull = 500.0 * (p - q) ** 3 + 0.4 * (r - v)
        return [v, (5 * np.sin(6 * t) + pull) / 2.0, r, -pull / 0.3]

    k = {"inertia": 0.3, "cubic": 500.0, "damping": 0.4}
    states, hidden = slid("energy_sink", k, [0.0, 0.0], lambda t: 5 * np.sin(6 * t), 1.0)
    exact = reference(slope, [0.0, 0.0, 0.0, 0.0], 1.0, len(states))
    np.testing.assert_allclose(np.hstack([states, hidden]), exact, atol=2e-5)
