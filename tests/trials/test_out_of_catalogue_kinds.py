"""Kinds outside the catalogue: a law and a strength each, visible when plain."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.trials.drawing import places_of
from gpsim.trials.out_of_catalogue import KINDS
from gpsim.trials.shares import visibilities
from gpsim.trials.truth import run
from gpsim.trials.worlds import SYSTEMS

from .outside_worlds import check_replay, effect_of, world_of

PLACES = {
    kind: [
        (kind, system, place)
        for system in KINDS[kind].systems
        for place in range(len(places_of(kind, SYSTEMS[system], "measured")))
    ]
    for kind in sorted(KINDS)
}
CASES = [  # each kind once; wherever else it may act takes minutes
    pytest.param(*case, marks=[pytest.mark.slow] if case != cases[0] else [])
    for cases in PLACES.values()
    for case in cases
]


@pytest.mark.parametrize(("kind", "system", "place"), CASES)
def test_plain_ones_are_finite_and_visible(kind, system, place):
    effect = effect_of(kind, system, 1.0, place)
    world = world_of(system, [effect], steps=25)
    truth = run(world, [effect])
    assert np.isfinite(truth.clean).all()
    (seen,) = visibilities(world, truth)
    assert seen.share > 0.05


@pytest.mark.parametrize("kind", ["encoder_play", "stuck_bit", "overload_foldback", "reversing_contactor"])
def test_what_acts_before_or_after_the_body_is_mujocos_too(kind):
    pytest.importorskip("mujoco")
    effect = effect_of(kind, "slider", 0.8)
    assert not KINDS[kind].of_body
    world = world_of("slider", [effect], steps=25)
    with_mujoco = run(replace(world, engine="mujoco"), [effect])
    np.testing.assert_allclose(with_mujoco.clean, run(world, [effect]).clean, atol=1e-6)


REPLAYED = {
    "slider": ("pulsed_thrusters", "fading_brake"),
    "pendulum": ("loose_load", "leaking_tank", "heaped_chain", "reversing_contactor"),
    "cartpole": ("rubber_buffer", "thixotropic_grease", "slipping_flywheel", "towed_sledge", "centrifugal_governor",
                 "tip_tether", "rubbing_axle", "energy_sink"),
    "unicycle": ("overload_foldback", "hill", "towed_trolley", "eccentric_wheel", "tyre_relaxation", "lagging_wheel",
                 "twisting_cable"),
}  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "system"), [(k, system) for system, kinds in REPLAYED.items() for k in kinds]
)
def test_what_is_hidden_is_known_when_a_run_is_replayed(kind, system):
    check_replay(kind, system)


WHERE = [
    ("fisheye_camera", "unicycle", None, ["pose"]), ("slow_sensor", "unicycle", None, ["yaw"]),
    ("slow_sensor", "slider", "differentiated", []), ("warming_sensor", "slider", "differentiated", ["q"]),
    ("centrifugal_governor", "cartpole", "measured", ["theta"]), ("centrifugal_governor", "slider", "measured", []),
    ("tip_sail", "cartpole", "measured", ["x"]), ("tip_tether", "slider", "measured", []),
    ("pulsed_thrusters", "unicycle", None, []), ("quantised_actuator", "unicycle", None, ["v_cmd", "w_cmd"]),
    ("weathervane", "unicycle", None, ["vehicle"]),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "system", "velocities", "places"), WHERE)
def test_where_they_act(kind, system, velocities, places):
    assert places_of(kind, SYSTEMS[system], velocities) == places
