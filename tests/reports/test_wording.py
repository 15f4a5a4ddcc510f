"""What a person would say of a diagnosis: of every family, of what to record next, of a process that was left out."""

import re
from dataclasses import replace

import pytest
from made_diagnoses import made_diagnosis, made_effect, made_remainder

from gpsim.effects import FAMILIES, Place
from gpsim.findings import (
    Alternative,
    Discrimination,
    Estimate,
    Excitation,
    NoGp,
    RemainderGp,
    Separation,
)
from gpsim.reports.wording import (
    effect_sentence,
    no_gp_text,
    tell_apart_text,
    worded,
)

PLACE = Place("q", "N", loaded=True)
SAID = {
    "coulomb_friction": "Coulomb friction on q (force 0.5 u) was left out",
    "viscous_friction": "viscous friction on q with damping 0.5 u was left out",
    "quadratic_drag": "quadratic drag on q of 0.5 u was left out",
    "stribeck_friction": "Stribeck friction on q (0.5 u at rest, 0.5 u sliding, falling over 0.5 u) was left out",
    "spring": "a spring on q of 0.5 u resting at 0.5 u was left out",
    "constant_force": "a constant force of 0.5 u on q was left out",
    "local_friction_patch": "a patch of q brakes with a friction of 0.5 u",
    "parameter_offset": "q is 0.5 u times what the simulator believes",
    "actuator_gain": "q acts with 0.5 u times its commanded size",
    "actuator_bias": "q acts with an offset of 0.5 u",
    "actuator_dead_zone": "q does nothing below 0.5 u",
    "actuator_saturation": "q saturates at 0.5 u",
    "actuator_asymmetry": "q acts with 0.5 u times a positive command and 0.5 u times a negative one",
    "actuator_delay": "q acts 0.5 u late",
    "actuator_lag": "q follows its command with a lag of 0.5 u",
    "actuator_rate_limit": "q changes no faster than 0.5 u",
    "actuator_backlash": "q has a backlash of half width 0.5 u",
    "battery_sag": "q loses 0.5 u of its strength (battery sag)",
    "minimum_turning_radius": "the vehicle turns no tighter than a radius of 0.5 u",
    "understeer": "the vehicle understeers with a gradient of 0.5 u",
    "steering_bias": "the steering is off by a curvature of 0.5 u",
    "lateral_slip": "the vehicle slips sideways by 0.5 u times its lateral acceleration",
    "sensor_bias": "the sensor of q is off by 0.5 u",
    "sensor_scale": "the sensor of q reads 0.5 u times the truth",
    "sensor_delay": "the sensor of q is 0.5 u late",
    "marker_offset": "the marker sits 0.5 u ahead and 0.5 u left of the vehicle's reference point",
    "frame_rotation": "the measured yaw is turned by 0.5 u",
    "payload": "a payload of 0.5 u on q, at (0.5 u, 0.5 u, 0.5 u) in its frame, was left out",
    "armature": "rotor inertia of 0.5 u on q was left out",
    "gravity_tilt": "the base is tilted by a roll of 0.5 u and a pitch of 0.5 u",
    "joint_offset": "the zero of q is off by 0.5 u",
}


def unsaid(family, names, **changes):
    parameters = {name: Estimate(0.5, None, None, "u") for name in names}
    return made_effect(family=family, parameters=parameters, sentence="", **changes)


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_of_the_catalogue_is_said(family):
    """Other programs show these sentences: a file of diagnoses keeps its bytes."""
    effect = unsaid(family, [p.name for p in FAMILIES[family].parameters(PLACE)])
    if family in SAID:
        assert effect_sentence(effect) == SAID[family]
    elif not FAMILIES[family].sentence:  # a family needs none of its own
        assert re.fullmatch(r".+ on q \(.+\) was left out", effect_sentence(effect))


def test_a_sentence_says_parameters_that_its_family_has():
    for family, effect in FAMILIES.items():
        told = set(re.findall(r"{(\w+)}", effect.sentence)) - {"on"}
        if effect.sentence:
            assert told <= {p.name for p in effect.parameters(PLACE)}, family


def test_a_variant_of_other_parameters_is_called_by_its_name_and_its_numbers():
    grown = unsaid("stribeck_friction", ["rise", "stribeck_velocity"])
    said = "Stribeck friction on q (rise 0.5 u, stribeck_velocity 0.5 u) was left out"
    assert effect_sentence(grown) == said


def test_a_family_without_a_sentence_is_called_by_its_name_and_its_numbers():
    two = {"coefficient": Estimate(0.9, None, None, "1"), "force": Estimate(9.70234, None, None, "N")}
    friction = made_effect(family="coulomb_friction", on="x", parameters=two, sentence="")
    assert effect_sentence(friction) == "Coulomb friction on x (coefficient 0.9, force 9.702 N) was left out"
    magnet = unsaid("magnetic_pull", ["strength"], on=("x", "y"))
    assert effect_sentence(magnet) == "magnetic pull on x,y (strength 0.5 u) was left out"


def test_a_strangers_effect_of_a_known_name_is_said_all_the_same():
    spring = unsaid("spring", ["rate"])
    assert effect_sentence(spring) == "spring on q (rate 0.5 u) was left out"


@pytest.mark.parametrize(
    ("excitation", "said"),
    [
        (Excitation("u", "constant", 2.5), "a constant u of 2.5"),
        (Excitation("u", "constant", -2.5), "a constant u of -2.5"),
        (Excitation("u", "slow wave", 12.3456), "a slow wave of u with amplitude 12.3"),
        (Excitation("u", "fast wave", 1.0), "a fast wave of u with amplitude 1"),
        (Excitation("u", "random levels", 1.0), "random levels of u up to 1"),
    ],
)
def test_what_to_drive_an_action_with_is_said(excitation, said):
    advice = Discrimination((Separation(excitation, ((("spring", "q"),), ()), "q", 3.0),), ())
    assert tell_apart_text(advice).startswith(f"record {said}: spring on q and neither of them then differ")


@pytest.mark.parametrize(
    ("why", "said"),
    [
        (NoGp("no structure"), "it has no structure"),
        (NoGp("explains nothing"), "it would explain nothing of training data that it had not seen"),
        (
            NoGp("harms", "q", rollout=True, times=1.104),
            "it would make the error in q after a rollout 1.1 times as large on training data that it had not seen",
        ),
        (
            NoGp("harms", "q_acc", times=float("inf")),
            "it would make the error in q_acc one step ahead inf times as large on training data that it had not seen",
        ),
    ],
)
def test_why_a_process_was_left_out_is_said(why, said):
    assert no_gp_text(why) == said


def test_a_diagnosis_gets_all_of_its_words_and_keeps_those_that_it_has():
    spring = made_effect(sentence="")
    advice = Discrimination(
        (Separation(Excitation("u", "constant", 1.0), ((("spring", "q"),), (("drag", "q"),)), "q", 3.04),), ()
    )
    gp = RemainderGp(False, None, None, NoGp("no structure"))
    plain = made_diagnosis(
        verdict="ambiguous",
        effects=(spring,),
        alternatives=(Alternative((replace(spring, family="constant_force"),), 0.4),),
        discrimination=advice,
        remainder=made_remainder(gp=gp),
    )
    found = worded(plain)
    assert found.effects[0].sentence == effect_sentence(spring)
    assert found.alternatives[0].effects[0].sentence
    assert found.tell_apart == tell_apart_text(advice)
    assert found.tell_apart.endswith(
        "spring on q and drag on q then differ by up to 3.04 standard deviations of the noise in q"
    )
    assert found.remainder.gp.why_not == "it has no structure"
    assert worded(found) == found
    own = replace(plain, effects=(made_effect(sentence="said otherwise"),), tell_apart="ask somebody")
    assert worded(own).effects[0].sentence == "said otherwise"
    assert worded(own).tell_apart == "ask somebody"


def test_where_nothing_is_to_be_told_apart_nothing_is_said():
    assert worded(made_diagnosis()).tell_apart is None
