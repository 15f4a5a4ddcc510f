"""Posteriors that no diagnosis made, of a slider on a spring with friction, and logs of one."""

import numpy as np

from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.run import Run
from gpsim.effects import Place, Term, effect_of
from gpsim.planning import Machine
from gpsim.posterior import Explanation, LeftOpen, Visited
from gpsim.recordings import Episode, Recording
from gpsim.simulators import make_simulator

DT = 0.02
COMMON = {
    ("viscous_friction", "q"): {"damping": 0.8},
    ("spring", "q"): {"stiffness": 1.0, "rest_position": 0.0},
}
NOISE = {"q": 0.002, "q_dot": 0.01}
SLIDER = make_simulator("slider")


def made_explanation(terms, probability=0.5, relative=0.02):
    """terms: (family, on) -> values; relative: standard deviations, of a value or of its typical size."""
    hypothesis = Hypothesis()
    for (family, on), values in terms.items():
        declared = effect_of(family).parameters(Place(on, "N", length="m", dt=DT, bounds=(0.1, 10.0)))
        hypothesis = hypothesis.plus(Term(family, on, values), tuple(p for p in declared if p.name in values))
    sizes = np.array([max(abs(v), 0.1) for t in hypothesis.terms for v in t.values.values()])
    deviation = relative * sizes
    intervals = hypothesis.theta[:, None] + np.outer(1.645 * deviation, [-1.0, 1.0])
    return Explanation(hypothesis, probability, np.diag(deviation**2), intervals)


def made_posterior(*terms, relative=0.02):
    """One explanation each, all of them with the common effects."""
    found = tuple(made_explanation(COMMON | more, 1.0 / len(terms), relative) for more in terms)
    rows = np.random.default_rng(0).uniform(-1, 1, (40, 3))
    visited = Visited(
        40.0, np.array([-1.2, -1.2]), np.array([1.2, 1.2]), np.array([-1.5]), np.array([1.5]), np.array([2.0]),
        np.zeros(2), rows,
    )  # fmt: skip
    return LeftOpen(found, 0.9, NOISE, NOISE, visited)


LAG_OR_DELAY = (
    {("actuator_delay", "force"): {"delay": 0.05}},
    {("actuator_lag", "force"): {"time_constant": 0.05}},
)
MASS_OR_GAIN = (
    {("parameter_offset", "mass"): {"ratio": 1.0 / 1.25}},
    {
        ("actuator_gain", "force"): {"gain": 1.25},
        ("viscous_friction", "q"): {"damping": 1.0},
        ("spring", "q"): {"stiffness": 1.25, "rest_position": 0.0},
    },
)
"""The same motion: every force on a mass that is 0.8 times as large, or each 1.25 times as large."""


def made_machine():
    return Machine(SLIDER, {"mass": 1.0}, DT, 2, Run())


def made_plant(posterior):
    """The slider as the leader of a posterior has it."""
    return EffectsPlant(SLIDER, {"mass": 1.0}, posterior.explanations[0].hypothesis.terms, "fine", 2, DT)


def driven(minutes, seed=0, damping=lambda t: 0.8, louder=lambda t: 1.0, dt=DT):
    """A slider on a spring, driven by waves and levels, whose damping and noise may change with time."""
    rng = np.random.default_rng(seed)
    steps = round(minutes * 60 / dt)
    t = dt * np.arange(steps + 1)
    frequency, phase = rng.uniform(0.05, 1.2, 8), rng.uniform(0, 2 * np.pi, 8)
    force = 0.3 * np.sin(2 * np.pi * frequency * t[:, None] + phase).sum(axis=1)
    force += np.repeat(rng.uniform(-0.5, 0.5, steps // 50 + 2), 50)[: steps + 1]
    path, q, v = np.empty((steps + 1, 2)), 0.0, 0.0
    for k in range(steps + 1):
        path[k] = q, v
        b = damping(t[k])
        for _ in range(4):
            v += dt / 4 * (force[k] - b * v - q)
            q += dt / 4 * v
    noise = rng.standard_normal(path.shape) * list(NOISE.values()) * np.array([[louder(x)] for x in t])
    episode = Episode("0", t, path + noise, force[:-1, None])
    return Recording(
        system="slider", state=SLIDER.state, action=SLIDER.action, episodes=(episode,), dt=dt,
        parameters={"mass": 1.0}, integrator="euler", velocities="measured",
    )  # fmt: skip
