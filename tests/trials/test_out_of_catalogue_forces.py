"""Forces and inertias outside the catalogue against energies, formulas and another integrator, written here anew."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid, solve_ivp

from gpsim.trials.bodies import Body, Now
from gpsim.trials.out_of_catalogue import KINDS
from gpsim.trials.worlds import SYSTEMS, TrueEffect, dynamics

from .outside_worlds import BOB, CART, H, driven

PARAMETERS = {"slider": {"mass": 2.0}, "pendulum": BOB, "cartpole": CART}
UNEVEN = {"amplitude": 0.9, "wave_number": 6.0, "phase": 0.5}
GOVERNOR = {"inertia": 0.08, "turn": 9.0, "damping_ratio": 0.3}
UNDAMPED = {"inertia": 0.02, "turn": 9.0, "damping_ratio": 0.0}
TANK = {"inertia": 1.5, "time": 0.7}
CHAIN = {"density": 1.6, "edge": 0.3}


def pushed(kind, on, system, values, s, wall):
    """(B, C) what a kind adds to the generalised forces: by how fast a body at s gathers speed, times its mass."""
    body, none = Body(system, PARAMETERS[system], [TrueEffect(kind, on, values)]), np.zeros((len(s), 1))
    later, _ = body.step(s, body.begin(s), Now(none, 0 * wall, wall), 1e-8)
    inverse, own = dynamics(system, PARAMETERS[system], s, none)
    return np.linalg.solve(inverse, ((later - s)[:, 1::2] / 1e-8)[:, :, None])[:, :, 0] - own


def downhill(energy):
    """The force whose potential is energy(q)."""
    return lambda q, v, t: (energy(q - 1e-5) - energy(q + 1e-5)) / 2e-5


def gusts(q, v, t):
    n = np.arange(12)[:, None]
    frequency, phase = 0.1 * 30 ** ((n + 0.37 * np.sin(7 * n + 0.4)) / 11.5), 1e3 * np.sin(0.5 * (n + 1))
    return 2 / np.sqrt(6) * np.sin(2 * np.pi * frequency * t + phase).sum(axis=0)


FORCES = [
    ("cogging", {"amplitude": 1.5, "wave_number": 5.0, "phase": 0.4}, downhill(lambda q: -0.3 * np.cos(5 * q + 0.4))),
    ("hardening_spring", {"cubic": 2.0}, downhill(lambda q: 0.5 * q**4)),
    ("magnetic_detent", {"amplitude": 3.0, "centre": 0.1, "reach": 0.2},
     downhill(lambda q: -0.6 * np.exp(0.5 - 12.5 * (q - 0.1) ** 2))),
    ("soft_stop", {"edge": 0.3, "stiffness": 8.0, "loss": 0.6},
     lambda q, v, t: np.where(v > -1 / 0.6, -8 * np.maximum(q - 0.3, 0) ** 1.5 * (1 + 0.6 * v), 0)),
    ("toggle_spring", {"stiffness": 40.0, "centre": 0.1, "aside": 0.15, "rest": 0.35},
     downhill(lambda q: 20 * (np.hypot(q - 0.1, 0.15) - 0.35) ** 2)),
    ("magnetic_bumper", {"amplitude": 5.0, "edge": 0.4, "reach": 0.2},
     downhill(lambda q: 5 * 0.2**4 / 3 / (0.6 - np.minimum(q, 0.4)) ** 3 + 5 * np.maximum(q - 0.4, 0))),
    ("exponential_aero", {"amplitude": 0.2, "speed": 0.5}, lambda q, v, t: 0.2 * (1 - np.exp(2 * abs(v))) * np.sign(v)),
    ("speed_ripple", {"amplitude": 2.0, "speed": 0.1}, lambda q, v, t: -2 * np.sin(10 * v)),
    ("eddy_brake", {"amplitude": 3.0, "speed": 0.7}, lambda q, v, t: -4.2 * v / (0.49 + v**2)),
    ("shear_thinning", {"damping": 3.0, "speed": 0.1, "exponent": 0.4},
     lambda q, v, t: -3 * v / (1 + 100 * v**2) ** 0.3),
    ("one_way_damper", {"damping": 2.0, "side": 1.0}, lambda q, v, t: np.where(v > 0, -2 * v, 0)),
    ("one_way_damper", {"damping": 2.0, "side": -1.0}, lambda q, v, t: np.where(v < 0, -2 * v, 0)),
    ("dragged_cable", {"drag": 3.0, "anchor": 0.2, "speed": 0.05}, lambda q, v, t: -3 * abs(q - 0.2) * np.tanh(20 * v)),
    ("running_belt", {"force": 1.5, "belt": 0.7, "speed": 0.05}, lambda q, v, t: 1.5 * np.tanh(20 * (0.7 - v))),
    ("drag_crisis", {"drag": 2.0, "loss": 0.8, "critical": 1.0, "width": 0.05},
     lambda q, v, t: -2 * v * abs(v) * (1 - 0.8 / (1 + np.exp(-20 * (abs(v) - 1))))),
    ("fan", {"amplitude": 2.0, "frequency": 1.5, "phase": 0.4}, lambda q, v, t: 2 * np.sin(3 * np.pi * t + 0.4)),
    ("gusts", {"amplitude": 2.0, "phase": 0.4}, gusts),
    ("fading_damping", {"damping": 2.0, "time": 10.0}, lambda q, v, t: -v * (0.2 + 4 * np.exp(-t / 10))),
    ("vibrating_pivot", {"lever": 0.4, "acceleration": 3.0, "frequency": 1.5},
     lambda q, v, t: -1.2 * np.sin(3 * np.pi * t) * np.sin(q)),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "values", "force"), FORCES)
def test_a_force_is_its_formula_or_the_slope_of_its_energy(kind, values, force):
    s, t = np.random.default_rng(0).uniform([-1.5, -2], [1.5, 2], (300, 2)), np.linspace(0, 30, 300)
    found = pushed(kind, "theta", "pendulum", values, s, t)[:, 0]
    np.testing.assert_allclose(found, force(*s.T, t), rtol=1e-5, atol=2e-5)
    assert np.abs(found).max() > 0.5


PLACES, SPEEDS = 1e-5 * np.eye(4)[::2], 1e-5 * np.eye(4)[1::2]


def slopes(of, s, columns):
    """(B, 2) how of(x, v, a, w) changes with both places or both speeds of a cart-pole."""
    return np.stack([(of(*(s + d).T) - of(*(s - d).T)) / 2e-5 for d in columns], axis=1)


COUPLED = [  # energies, whose slopes in the places are forces; losses (Rayleigh's), whose slopes in the speeds are
    ("gyroscopic", {"coupling": 0.7}, lambda s: s[:, 1::2] @ [[0.0, -0.7], [0.7, 0.0]]),
    ("tip_sail", {"drag": 0.3, "length": 0.8}, lambda s: -slopes(
        lambda x, v, a, w: 0.1 * np.hypot(v + 0.8 * w * np.cos(a), 0.8 * w * np.sin(a)) ** 3, s, SPEEDS)),
    ("tip_tether", {"stiffness": 12.0, "length": 0.8, "rest": 0.6}, lambda s: -slopes(
        lambda x, v, a, w: 6 * np.maximum(np.hypot(x + 0.8 * np.sin(a), 0.8 * np.cos(a)) - 0.6, 0) ** 2, s, PLACES)),
    ("rubbing_axle", {"force": 1.2, "radius": 0.1, "speed": 0.05}, lambda s: -slopes(
        lambda x, v, a, w: 0.06 * np.logaddexp(20 * (v - 0.1 * w), -20 * (v - 0.1 * w)), s, SPEEDS)),
    ("magnetic_rack", {"stiffness": 1.4, "radius": 0.12}, lambda s: -slopes(
        lambda x, v, a, w: -1.4 * np.cos(a - x / 0.12), s, PLACES)),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "values", "forces"), COUPLED)
def test_a_force_on_both_axes_is_the_slope_of_its_energy_or_of_what_it_takes(kind, values, forces):
    s = np.random.default_rng(0).uniform(-1.5, 1.5, (300, 4)) * [1, 1, 2, 1]
    found = pushed(kind, "x", "cartpole", values, s, np.zeros(300))
    np.testing.assert_allclose(found, forces(s), atol=2e-5)
    assert np.abs(found).max(axis=0).min() > 0.1


def between(pull, inertia, rubs=lambda r: 0):
    """A body of 2 kg and a mass: what pulls the one, by how far and how fast they part, pushes the other back."""
    return lambda u, q, v, p, r: ((u + pull(p - q, r - v)) / 2, r, -(pull(p - q, r - v) + rubs(r)) / inertia)


EQUATIONS = [  # kind, values, its state at first; the acceleration and the slopes of that state under a push u
    ("bouc_wen", {"amplitude": 6.0, "width": 0.2}, [0.0, 0.0],
     lambda u, q, v, z, _: ((u - 6 * z) / 2, v * (1 - abs(z) * (v * z > 0)) / 0.2, 0), 5e-5),
    ("rubber_buffer", {"stiffness": 20.0, "time": 0.3}, [0.0, 0.0],
     lambda u, q, v, z, _: ((u - z) / 2, 20 * v - z / 0.3, 0), 2e-5),
    ("thixotropic_grease", {"damping": 4.0, "time": 0.4, "way": 0.15}, [1.0, 0.0],
     lambda u, q, v, z, _: ((u - 4 * z * v) / 2, (1 - z) / 0.4 - abs(v) * z / 0.15, 0), 5e-5),
    ("fading_brake", {"force": 3.0, "speed": 0.05, "fade": 2.0, "typical": 0.5, "time": 0.4}, [0.0, 0.0],
     lambda u, q, v, z, _: ((u - 3 / (1 + z) * np.tanh(20 * v)) / 2, (4 * abs(v) - z) / 0.4, 0), 5e-5),
    ("flexible_appendage", {"inertia": 0.5, "stiffness": 60.0, "damping": 0.8}, [0.1, 0.5],
     between(lambda x, w: 60 * x + 0.8 * w, 0.5), 2e-5),
    ("loose_load", {"inertia": 0.9, "gap": 0.1, "stiffness": 400.0, "loss": 0.3}, [0.1, 0.5], between(lambda x, w:
     400 * np.sign(x) * max(abs(x) - 0.1, 0) * max(1 + 0.3 * np.sign(x) * w, 0), 0.9), 5e-4),
    ("slipping_flywheel", {"grip": 1.5, "inertia": 0.8, "speed": 0.05}, [0.1, 0.5],
     between(lambda x, w: 1.5 * np.tanh(20 * w), 0.8), 5e-5),
    ("towed_sledge", {"friction": 2.0, "slack": 0.2, "inertia": 0.4, "stiffness": 250.0, "speed": 0.02}, [0.1, 0.5],
     between(lambda x, w: 250 * np.sign(x) * max(abs(x) - 0.2, 0), 0.4, lambda r: 2 * np.tanh(r / 0.02)), 5e-4),
    ("energy_sink", {"inertia": 0.3, "cubic": 500.0, "damping": 0.4}, [0.1, 0.5],
     between(lambda x, w: 500 * x**3 + 0.4 * w, 0.3), 1e-4),
    ("uneven_inertia", UNEVEN, [],  # d/dt (I v) = u + I' v^2 / 2
     lambda u, q, v: ((u + 2.7 * np.sin(6 * q + 0.5) * v**2) / (2 + 0.9 * np.cos(6 * q + 0.5)),), 2e-5),
    ("centrifugal_governor", GOVERNOR, [1.0, 0.0], lambda u, q, v, r, w: (
        (u - 3.92 * np.sin(q) - 0.16 * r * w * v) / (0.2 + 0.08 * (r**2 - 1)), w,
        r * v**2 - 81 * (r - 1) - 5.4 * w), 5e-4),
    ("leaking_tank", TANK, [1.0, 0.0], lambda u, q, v, z, _: (u / (2 + 1.5 * z), -z / 0.7, 0), 2e-5),
    ("heaped_chain", CHAIN, [0.1, 0.0],
     lambda u, q, v, z, _: ((u - 1.6 * (q > 0.3 and v > 0) * v**2) / (2 + 1.6 * max(q - 0.3, 0)), v, 0), 5e-4),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "values", "hidden", "rates", "near"), EQUATIONS)
def test_what_remembers_moves_as_another_integrator_says(kind, values, hidden, rates, near):
    system = KINDS[kind].systems[-2 if "slider" in KINDS[kind].systems else -1]
    push = lambda t: 6 * np.sin(5 * t)  # noqa: E731
    effect, t = TrueEffect(kind, SYSTEMS[system].coordinates[0], values), H * np.arange(2001)
    exact = solve_ivp(
        lambda t, y: [y[1], *rates(push(t), *y)], (0, 2.001), [0.1, 0.5, *hidden], "DOP853",
        t_eval=t, rtol=1e-10, atol=1e-12, max_step=2e-3,  # no step jumps over a knock
    ).y.T  # fmt: skip
    found = np.hstack(driven(system, PARAMETERS[system], effect, [0.1, 0.5], push, 2.0))
    np.testing.assert_allclose(found, exact, atol=near)
    assert np.abs(exact[:, 1] - 0.5 - 0.6 * (1 - np.cos(5 * t))).max() > 0.1  # what the push alone would do


BALANCES = [  # system, kind, values, start, push; what is kept, or else how much more of it there is than at first
    ("slider", "running_belt", {"force": 1.5, "belt": 0.7, "speed": 0.05}, [0, -2], lambda t: 0,
     lambda q, v, z, t: (v, 2.7 - 0.05 * np.arcsinh(np.sinh(54) * np.exp(-15 * t))), 1e-5),
    ("slider", "uneven_inertia", UNEVEN, [0, 1], lambda t: 0,
     lambda q, v, z, t: ((2 + 0.9 * np.cos(6 * q + 0.5)) * v**2, 0), 1e-9),
    ("pendulum", "centrifugal_governor", GOVERNOR, [2.5, 3], lambda t: 0, lambda q, v, z, t: (
        (0.1 + 0.04 * (z[0] ** 2 - 1)) * v**2 - 3.92 * np.cos(q) + 0.04 * (z[1] ** 2 + 81 * (z[0] - 1) ** 2),
        -cumulative_trapezoid(0.432 * z[1] ** 2, t, initial=0)), 1e-4),
    ("cartpole", "centrifugal_governor", UNDAMPED, [0, 0.5, 2, 4], lambda t: 0, lambda x, v, q, w, z, t: (
        [0.7 * v**2 + 0.08 * v * w * np.cos(q) + (0.064 / 3 + 0.01 * (z[0] ** 2 - 1)) * w**2 + 0.784 * np.cos(q)
         + 0.01 * z[1] ** 2 + 0.81 * (z[0] - 1) ** 2, 1.4 * v + 0.08 * w * np.cos(q)], 0), 1e-6),  # and momentum
    ("slider", "leaking_tank", TANK, [0, 0.3], lambda t: 4,
     lambda q, v, z, t: ([v, z[0]], [1.4 * np.log((2 * np.exp(t / 0.7) + 1.5) / 3.5), np.expm1(-t / 0.7)]), 1e-9),
    ("slider", "leaking_tank", TANK, [0, 0.3], lambda t: 0, lambda q, v, z, t: (v, 0), 0),  # no thrust
    ("slider", "heaped_chain", CHAIN, [0.35, 1.4], lambda t: 0,  # drawn out, it keeps the momentum
     lambda q, v, z, t: ((2 + 1.6 * (q - 0.3)) * v, 0), 1e-8),
    ("slider", "heaped_chain", CHAIN, [2.8, -0.8], lambda t: 0, lambda q, v, z, t: (v, 0), 1e-12),  # laid, the speed
    ("slider", "heaped_chain", CHAIN, [1.2, 0], lambda t: -8 * np.cos(2 * t), lambda q, v, z, t: (  # half of its links'
        (1 + 0.8 * np.maximum(q - 0.3, 0)) * v**2,
        cumulative_trapezoid(-8 * np.cos(2 * t) * v - 0.8 * abs(v) ** 3 * (q > 0.3), t, initial=0)), 5e-3),
]  # fmt: skip


@pytest.mark.parametrize(("system", "kind", "values", "start", "push", "balance", "near"), BALANCES)
def test_energy_and_momentum_go_where_they_should(system, kind, values, start, push, balance, near):
    effect = TrueEffect(kind, "q" if system == "slider" else "theta", values)
    s, z = driven(system, PARAMETERS[system], effect, np.array(start, float), lambda t: float(push(t)), 3.0)
    has, gained = balance(*s.T, z.T, H * np.arange(len(s)))
    has = np.atleast_2d(has)
    np.testing.assert_allclose(has - has[:, :1], np.broadcast_to(gained, has.shape), rtol=0, atol=near)


def test_every_kind_of_a_body_is_held_against_something():
    ours = {name for name, kind in KINDS.items() if kind.of_body and "unicycle" not in kind.systems}
    assert {row[0] for row in (*FORCES, *COUPLED, *EQUATIONS)} == ours
