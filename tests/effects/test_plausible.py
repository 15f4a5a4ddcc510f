"""Sizes that machines have, and how far others are from them."""

import pytest

from gpsim.effects import FAMILIES, Place, declared, times_beyond


def parameter(family, name, **place):
    found = declared(FAMILIES[family], Place("q", "N", **place))
    return next(p for p in found if p.name == name)


@pytest.mark.parametrize("size", [0.3, 1.0, 3.5])
def test_what_is_usual_is_beyond_nothing(size):
    assert times_beyond(parameter("parameter_offset", "ratio"), size) == 1.0


@pytest.mark.parametrize(
    ("family", "name", "size"),
    [
        ("parameter_offset", "ratio", 20.0),
        ("understeer", "gradient", 29.0),
        ("actuator_gain", "gain", 0.02),
        ("actuator_gain", "gain", -1.9),
    ],
)
def test_what_no_machine_has_is_far_beyond(family, name, size):
    assert times_beyond(parameter(family, name), size) > 4.0


def test_a_range_goes_with_the_machine():
    """An armature of 226 kg m^2 is none of an arm that moves 11 kg m^2; of one that moves 200 it is."""
    small, large = (parameter("armature", "inertia", span=span) for span in (11.0, 200.0))
    assert times_beyond(small, 226.0) == pytest.approx(226.0 / 33.0)
    assert times_beyond(large, 226.0) == 1.0
    assert times_beyond(parameter("armature", "inertia", span=0.005), 0.5) == 1.0  # a rotor behind a gear


def test_a_payload_of_178_kg_is_none_of_a_small_arm():
    assert times_beyond(parameter("payload", "mass", span=9.0), 178.0) > 3.3


def test_direction_does_not_matter_and_there_is_no_jump_at_the_end():
    force = parameter("constant_force", "force", span=10.0)
    assert times_beyond(force, -60.0) == times_beyond(force, 60.0) == pytest.approx(2.0)
    assert times_beyond(force, 30.0 * 1.001) == pytest.approx(1.001)


def test_every_range_is_of_a_parameter_and_within_what_is_searched():
    place = Place("q", "U", loaded=True, length="L")
    for family, effect in FAMILIES.items():
        found = {p.name: p for v in effect.variants for p in declared(effect, place, v)}
        assert set(effect.plausible) <= set(found), family
        for name, usual in effect.plausible.items():
            low, high = usual.at(place)
            assert low < min(high, found[name].high), (family, name)
            assert usual.source
