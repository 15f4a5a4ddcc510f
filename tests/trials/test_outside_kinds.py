"""Kinds outside the catalogue: a law and a strength each, visible when plain, nothing at strength zero."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.trials import outside_kind as kind
from gpsim.trials.drawing import of_body, places_of
from gpsim.trials.outside import EVERY_KIND, KINDS
from gpsim.trials.shares import visibilities
from gpsim.trials.truth import run
from gpsim.trials.worlds import SYSTEMS, TrueEffect

from .outside_worlds import bare, check_replay, effect_of, world_of

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
WAVES = {"wave_number": 5.0, "phase": 0.4}
NOTHING = {
    "cogging": {"amplitude": 0.0, **WAVES},
    "hardening_spring": {"cubic": 0.0},
    "fan": {"amplitude": 0.0, "frequency": 1.0, "phase": 0.4},
    "bouc_wen": {"amplitude": 0.0, "width": 0.1},
    "gusts": {"amplitude": 0.0, "phase": 0.4},
    "exponential_aero": {"amplitude": 0.0, "speed": 0.5},
    "position_gain": {"depth": 0.0, **WAVES},
    "quantised_actuator": {"step": 1e-14},
    "curve_slowdown": {"loss": 0.0},
    "heading_slope": {"amplitude": 0.0, "phase": 0.4},
    "magnetic_detent": {"amplitude": 0.0, "centre": 0.1, "reach": 0.2},
    "flexible_appendage": {"inertia": 1e-3, "stiffness": 0.0, "damping": 0.0},
    "gyroscopic": {"coupling": 0.0},
    "fading_damping": {"damping": 0.0, "time": 10.0},
    "soft_stop": {"edge": 0.1, "stiffness": 0.0, "loss": 0.1},
    "vibrating_pivot": {"lever": 0.5, "acceleration": 0.0, "frequency": 1.0},
    "speed_ripple": {"amplitude": 0.0, "speed": 0.1},
    "ringing_actuator": {"frequency": 1e9, "damping_ratio": 0.9},
    "eccentric_encoder": {"amplitude": 0.0, **WAVES},
    "carpet": {"depth": 0.0, "x": 0.1, "y": 0.2, "radius": 0.5},
    "eddy_brake": {"amplitude": 0.0, "speed": 1.0},
    "rubber_buffer": {"stiffness": 0.0, "time": 0.5},
    "uneven_inertia": {"amplitude": 0.0, **WAVES},
    "worm_gear": {"friction": 0.0, "speed": 0.1},
    "lost_commands": {"share": 0.0, "outage": 0.06, "phase": 1.0},
    "hot_motor": {"loss": 0.0, "rated": 1.0, "time": 1.0},
    "wheel_speed_limit": {"half_track": 0.2, "limit": 1e9},
    "towed_trolley": {"length": 0.4, "pull": 0.0},
    "slow_sensor": {"period": 0.001},
    "fisheye_camera": {"height": 1e12},
    "shear_thinning": {"damping": 0.0, "speed": 0.1, "exponent": 0.3},
    "thixotropic_grease": {"damping": 0.0, "time": 0.5, "way": 0.1},
    "loose_load": {"inertia": 1e-3, "gap": 0.1, "stiffness": 0.0, "loss": 0.1},
    "centrifugal_governor": {"inertia": 0.0, "turn": 5.0, "damping_ratio": 0.3},
    "tip_sail": {"drag": 0.0, "length": 1.0},
    "sticky_valve": {"band": 0.0},
    "power_limit": {"power": 1e12},
    "eccentric_wheel": {"depth": 0.0, "half_track": 0.2, "radius": 0.1},
    "tyre_relaxation": {
        "length": 5e-4
    },  # no shorter than it rolls in a fine step, or that would be too coarse
    "loose_marker": {"frequency": 1e6, "damping_ratio": 0.2},
    "one_way_damper": {"damping": 0.0, "side": 1.0},
    "dragged_cable": {"drag": 0.0, "anchor": 0.1, "speed": 0.1},
    "slipping_flywheel": {"grip": 0.0, "inertia": 1.0, "speed": 0.1},
    "leaking_tank": {"inertia": 0.0, "time": 1.0},
    "tip_tether": {"stiffness": 0.0, "length": 1.0, "rest": 0.7},
    "pneumatic_valve": {"fill": 1e-20, "vent": 1e-20},
    "expo_curve": {"softness": 0.0, "full": 1.0},
    "hill": {"loss": 0.0, "x": 0.1, "y": 0.2, "radius": 0.5},
    "coarse_encoder": {"step": 1e-14},
    "warming_sensor": {"offset": 0.0, "time": 1.0},
    "running_belt": {"force": 0.0, "belt": 0.3, "speed": 0.1},
    "toggle_spring": {"stiffness": 0.0, "centre": 0.1, "aside": 0.2, "rest": 0.5},
    "heaped_chain": {"density": 0.0, "edge": 0.1},
    "towed_sledge": {"friction": 0.0, "slack": 0.1, "inertia": 1e-3, "stiffness": 0.0, "speed": 0.1},
    "rubbing_axle": {"force": 0.0, "radius": 0.1, "speed": 0.1},
    "overload_foldback": {"share": 1.0, "rated": 0.1, "reset": 0.8, "time": 0.2},
    "pulsed_thrusters": {"period": 1e-3, "full": 1e3},
    "weathervane": {"turn": 0.0, "wind": 1.0},
    "lagging_wheel": {"time": 4e-4, "half_track": 0.2},  # no shorter, as above
    "encoder_play": {"gap": 0.0},
    "magnetic_bumper": {"amplitude": 0.0, "edge": 0.1, "reach": 0.2},
    "drag_crisis": {"drag": 0.0, "loss": 0.8, "critical": 0.5, "width": 0.04},
    "fading_brake": {"force": 0.0, "speed": 0.1, "fade": 2.0, "typical": 0.5, "time": 1.0},
    "energy_sink": {"inertia": 1e-3, "cubic": 0.0, "damping": 0.0},
    "magnetic_rack": {"stiffness": 0.0, "radius": 0.1},
    "supply_ripple": {"depth": 0.0, "frequency": 1.0, "phase": 0.4},
    "reversing_contactor": {"pause": 0.0},
    "grooved_floor": {"turn": 0.0, "line": 0.4},
    "twisting_cable": {"rate": 0.0},
    "stuck_bit": {"step": 1e-14},
}
SHORT = {
    "tyre_relaxation": 4e-3,
    "lagging_wheel": 4e-3,
    "pulsed_thrusters": 1e-9,
    "ringing_actuator": 2e-2,  # half a fine step late: the mean of its two ends
}  # m, rad: what is left of one that vanishes in a limit only, w length / v


@pytest.mark.parametrize(("kind", "system", "place"), CASES)
def test_plain_ones_are_finite_and_visible(kind, system, place):
    effect = effect_of(kind, system, 1.0, place)
    world = world_of(system, [effect], steps=25)
    truth = run(world, [effect])
    assert np.isfinite(truth.clean).all()
    (seen,) = visibilities(world, truth)
    assert seen.share > 0.05


@pytest.mark.parametrize(("kind", "system", "place"), CASES)
def test_strength_zero_is_no_effect(kind, system, place):
    on = places_of(kind, SYSTEMS[system], "measured")[place]
    assert set(NOTHING[kind]) == set(effect_of(kind, system, 0.0, place).values)
    world, without = bare(system, steps=15)
    with_it = run(world, [TrueEffect(kind, on, NOTHING[kind], outside=True)])
    near = SHORT.get(kind, 1e-12)
    np.testing.assert_allclose(with_it.clean, without.clean, rtol=1e-12, atol=near)


OF_THE_BODY = ("eddy_brake", "loose_load", "leaking_tank", "running_belt", "towed_sledge", "energy_sink")
BESIDE_IT = {
    "worm_gear": "force",
    "hot_motor": "force",
    "slow_sensor": "q",
    "sticky_valve": "force",
    "power_limit": "force",
    "loose_marker": "q",
    "pneumatic_valve": "force",
    "expo_curve": "force",
    "warming_sensor": "q",
    "overload_foldback": "force",
    "pulsed_thrusters": "force",
    "encoder_play": "q",
    "supply_ripple": "force",
    "reversing_contactor": "force",
    "stuck_bit": "q",
}


@pytest.mark.parametrize("kind", BESIDE_IT)
def test_what_acts_before_or_after_the_body_is_mujocos_too(kind):
    pytest.importorskip("mujoco")
    effect = effect_of(kind, "slider", 0.8)
    assert (effect.on, of_body(kind)) == (BESIDE_IT[kind], False)
    world = world_of("slider", [effect], steps=25)
    with_mujoco = run(replace(world, engine="mujoco"), [effect])
    np.testing.assert_allclose(with_mujoco.clean, run(world, [effect]).clean, atol=1e-6)


@pytest.mark.parametrize("kind", OF_THE_BODY)
def test_what_acts_on_the_body_is_not(kind):
    assert of_body(effect_of(kind, "slider", 0.8).family)


@pytest.mark.parametrize(
    ("kind", "system"),
    [
        ("rubber_buffer", "cartpole"),
        ("thixotropic_grease", "cartpole"),
        ("loose_load", "pendulum"),
        ("slipping_flywheel", "cartpole"),
        ("towed_sledge", "cartpole"),
        ("centrifugal_governor", "cartpole"),
        ("leaking_tank", "pendulum"),
        ("heaped_chain", "pendulum"),
        ("tip_tether", "cartpole"),
        ("rubbing_axle", "cartpole"),
        ("overload_foldback", "unicycle"),
        ("pulsed_thrusters", "slider"),
        ("hill", "unicycle"),
        ("towed_trolley", "unicycle"),
        ("eccentric_wheel", "unicycle"),
        ("tyre_relaxation", "unicycle"),
        ("lagging_wheel", "unicycle"),
        ("fading_brake", "slider"),
        ("energy_sink", "cartpole"),
        ("twisting_cable", "unicycle"),
        ("reversing_contactor", "pendulum"),
    ],
)
def test_what_is_hidden_is_known_when_a_run_is_replayed(kind, system):
    check_replay(kind, system)


@pytest.mark.parametrize(
    ("kind", "system", "velocities", "places"),
    [
        ("fisheye_camera", "unicycle", None, ["pose"]),
        ("slow_sensor", "unicycle", None, ["yaw"]),
        ("slow_sensor", "slider", "differentiated", []),
        ("centrifugal_governor", "cartpole", "measured", ["theta"]),
        ("centrifugal_governor", "slider", "measured", []),
        ("tip_sail", "cartpole", "measured", ["x"]),
        ("loose_marker", "unicycle", None, ["yaw"]),
        ("tip_tether", "cartpole", "measured", ["x"]),
        ("tip_tether", "slider", "measured", []),
        ("coarse_encoder", "unicycle", None, ["yaw"]),
        ("warming_sensor", "slider", "differentiated", ["q"]),
        ("rubbing_axle", "cartpole", "measured", ["x"]),
        ("rubbing_axle", "slider", "measured", []),
        ("pulsed_thrusters", "unicycle", None, []),
        ("quantised_actuator", "unicycle", None, ["v_cmd", "w_cmd"]),
        ("encoder_play", "unicycle", None, ["yaw"]),
        ("weathervane", "unicycle", None, ["vehicle"]),
        ("weathervane", "pendulum", "measured", []),
        ("reversing_contactor", "unicycle", None, []),
        ("supply_ripple", "unicycle", None, ["v_cmd", "w_cmd"]),
        ("magnetic_rack", "cartpole", "measured", ["x"]),
        ("stuck_bit", "unicycle", None, ["yaw"]),
    ],
)
def test_where_they_act(kind, system, velocities, places):
    assert places_of(kind, SYSTEMS[system], velocities) == places


def below(site):
    """Classes without subclasses, at any depth."""
    return [leaf for child in site.__subclasses__() for leaf in below(child)] or [site]


def test_no_kind_is_forgotten():
    assert sorted({law.__name__ for law in below(kind.Kind)}) == sorted(
        law.__name__ for law in EVERY_KIND.values()
    )
    for law in EVERY_KIND.values():
        assert law.__doc__
    assert set(NOTHING) == set(KINDS)


def test_two_kinds_of_one_name_are_refused():
    with pytest.raises(ValueError, match="two kinds are called fan"):
        type("Fan", (kind.Force,), {"strength": KINDS["fan"].strength})
