"""Recorded actions played again in the very simulator that was the truth: sensors, clock and memory as they were."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.channels import difference
from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.assessment import replayed
from gpsim.effects import Gate, Term
from gpsim.simulators import make_simulator

from .truths import mechanical, vehicles
from .worlds import World, record

PENDULUM = {(t.family, t.on): t for t in mechanical("pendulum")}
UNICYCLE = {(t.family, t.on): t for t in vehicles("unicycle")}
LATE = World("pendulum", forces={0: lambda q, v, t: 0.4 * (np.asarray(t) >= 6.0) + 0 * q})
CASES = [
    *(UNICYCLE[key] for key in [("marker_offset", "pose"), ("frame_rotation", "pose")]),
    *(PENDULUM["sensor_bias", "theta"], PENDULUM["sensor_scale", "theta_dot"]),
    *(PENDULUM["actuator_lag", "torque"], PENDULUM["battery_sag", "torque"]),
    *(PENDULUM["sensor_delay", "theta_dot"], PENDULUM["actuator_delay", "torque"]),
]


def errors(recording, plant, steps=25):
    """(S,) root mean square over windows late in every episode."""
    places = [(i, first) for i in range(len(recording.episodes)) for first in (40, 80)]
    said = replayed(plant, recording, places, steps)
    measured = np.stack([recording.episodes[i].states[k : k + steps + 1] for i, k in places])
    return np.sqrt(np.mean(difference(measured, said, plant.state)[:, 1:] ** 2, axis=(0, 1)))


def plant_of(recording, *terms):
    simulator = make_simulator(recording.system)
    return EffectsPlant(simulator, simulator.defaults(recording.parameters), terms, "fine", 8, recording.dt)


@pytest.mark.parametrize("truth", CASES, ids=lambda t: t.family)
def test_the_truth_replayed_is_what_was_recorded(truth):
    recording = record(truth.world, seed=4, episodes=4, steps=120, noise=0.0, session=True)
    true = errors(recording, plant_of(recording, Term(truth.family, truth.on, truth.values)))
    base = errors(recording, plant_of(recording))
    worst = int(np.argmax(base / np.maximum(true, 1e-12)))
    assert true[worst] < 0.15 * base[worst], (true, base)
    assert (true < 1.05 * base + 1e-6).all(), (true, base)


def test_what_began_inside_the_recording_does_not_act_before():
    recording = record(LATE, seed=4, episodes=4, steps=120, noise=0.0, session=True)
    since = 6.0 + 2 * recording.dt  # its clock counts the steps between episodes, too
    late = Term("constant_force", "theta", {"force": 0.4}, Gate(since=since))
    assert (
        errors(recording, plant_of(recording, late)) < 2e-2 * errors(recording, plant_of(recording))
    ).all()
    always = replace(late, gate=Gate())
    assert (errors(recording, plant_of(recording, always)) > 0.1).any()
