"""What a person would say of a diagnosis: of every family, of what to record next, of the log, and of numbers."""

import math
import re
from dataclasses import replace

import pytest
from made_diagnoses import made_diagnosis, made_effect, made_remainder

from gpsim.diagnosis.run import Decision
from gpsim.effects import FAMILIES, Place
from gpsim.findings import (
    Alternative,
    Combination,
    Discrimination,
    Estimate,
    Excitation,
    LogFact,
    NoGp,
    RemainderGp,
    Separation,
)
from gpsim.reports.diagnosis_text import (
    combination_text,
    combination_texts,
    fixed_text,
    log_fact_text,
    open_text,
)
from gpsim.reports.quantities import percent, size_text
from gpsim.reports.statistics_text import trace_lines
from gpsim.reports.wording import effect_sentence, worded

PLACE = Place("q", "N", loaded=True)
SAID = {
    "coulomb_friction": "Coulomb friction on q (force 0.5 u) is missing",
    "stribeck_friction": "Stribeck friction on q (0.5 u at rest, 0.5 u sliding, falling over 0.5 u) is missing",
    "spring": "a spring on q of 0.5 u resting at 0.5 u is missing",
    "local_friction_patch": "a patch of q brakes with a friction of 0.5 u",
    "parameter_offset": "q is 0.5 u times its value in the simulator",
    "actuator_asymmetry": "q acts with 0.5 u times positive commands and 0.5 u times negative commands",
    "battery_sag": "q loses 0.5 u of its strength (battery sag)",
    "lateral_slip": "the vehicle slips sideways by 0.5 u times its lateral acceleration",
    "sensor_delay": "the sensor of q is 0.5 u late",
    "payload": "a payload of 0.5 u on q, at (0.5 u, 0.5 u, 0.5 u) in its frame, is missing",
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
        assert re.fullmatch(r".+ on q \(.+\) is missing", effect_sentence(effect))


@pytest.mark.parametrize(
    ("effect", "said"),
    [
        (unsaid("stribeck_friction", ["rise", "stribeck_velocity"]), "Stribeck friction on q (rise 0.5 u, stribeck_velocity 0.5 u)"),
        (unsaid("coulomb_friction", ["coefficient", "force"], on="x"), "Coulomb friction on x (coefficient 0.5 u, force 0.5 u)"),
        (unsaid("magnetic_pull", ["strength"], on=("x", "y")), "magnetic pull on x,y (strength 0.5 u)"),
        (unsaid("spring", ["rate"]), "spring on q (rate 0.5 u)"),  # somebody else's, of a known name
    ],
)  # fmt: skip
def test_what_has_no_sentence_for_its_parameters_is_called_by_its_name_and_its_numbers(effect, said):
    assert effect_sentence(effect) == f"{said} is missing"


SPRING_OR_DRAG = ((("spring", "q"),), (("drag", "q"),))


def advised(excitation, **parts):
    advice = Discrimination((Separation(excitation, SPRING_OR_DRAG, "q", 3.04),), ())
    return made_diagnosis(verdict="ambiguous", discrimination=advice, **parts)


@pytest.mark.parametrize(
    ("why", "said"),
    [
        (NoGp("no structure"), "it has no structure"),
        (NoGp("explains nothing"), "it would explain nothing of unseen training data"),
        (NoGp("harms", "q", rollout=True, times=1.104), "it would multiply the error in q after a rollout by 1.1 on "
         "unseen training data"),
        (NoGp("strays", "q", rollout=True, times=1.83, seconds=19.79), "it would multiply the error in q by 1.8 in "
         "free runs of 19.8 s"),
        (NoGp("harms", "q_acc", times=math.inf), "it would multiply the error in q_acc one step ahead by inf on "
         "unseen training data"),
    ],
)  # fmt: skip
def test_why_a_process_was_left_out_is_said(why, said):
    found = worded(made_diagnosis(remainder=made_remainder(gp=RemainderGp(False, None, None, why))))
    assert found.remainder.gp.why_not == said


def test_a_diagnosis_gets_all_of_its_words_and_keeps_those_that_it_has():
    spring = made_effect(sentence="")
    rival = Alternative((replace(spring, family="constant_force"),), 0.4)
    plain = advised(Excitation("u", "constant", 1.0), effects=(spring,), alternatives=(rival,))
    found = worded(plain)
    assert found.effects[0].sentence == effect_sentence(spring)
    assert found.alternatives[0].effects[0].sentence
    assert worded(found) == found
    own = replace(plain, effects=(made_effect(sentence="said otherwise"),), tell_apart="ask somebody")
    assert worded(own).effects[0].sentence == "said otherwise"
    assert worded(own).tell_apart == "ask somebody"
    assert worded(made_diagnosis()).tell_apart is None


@pytest.mark.parametrize(
    ("value", "low", "high", "unit", "said"),
    [
        (8.7123, 8.657, 8.769, "N", "8.71 ± 0.06 N"),
        (1.2021, 1.190, 1.214, "N", "1.202 ± 0.012 N"),
        (0.93, 0.918, 0.942, "1", "0.930 ± 0.012"),
        (12345.0, 12298.0, 12392.0, "N", "12340 ± 50 N"),
        (1.234e-6, 1.2e-6, 1.27e-6, "m", "1.23e-06 ± 3.5e-08 m"),
        (2.0, 1.9, 5.0, "m/s^2", "2.0 (1.9 to 5.0) m/s²"),
        (8.71, 8.71, 8.71, "N", "8.71 N"),
        (8.71, 8.709999, 8.710001, "N", "8.71 ± <9e-05 N"),
        (8.7123, None, None, "N", "8.71 ± ? N"),
        (math.nan, None, None, "N", "–"),
        (0.0, -0.1, 0.1, "N", "0.00 ± 0.10 N"),
    ],
)
def test_a_size_has_as_many_digits_as_its_interval_says(value, low, high, unit, said):
    assert size_text("force", Estimate(value, low, high, unit)) == said


def test_a_ratio_is_so_many_times_and_a_bound_is_no_measurement():
    assert size_text("gain", Estimate(0.93, 0.92, 0.94, "1")) == "0.930 ± 0.010 times"
    assert size_text("force", Estimate(5.0, 4.9, 5.1, "N", at_bound=True)) == "5 N, at its bound"


@pytest.mark.parametrize(
    ("share", "said"),
    [(0.934, "93"), (0.997, "99.7"), (0.99999, ">99.9"), (1.0, "100"), (0.004, "0.4"), (1e-6, "<0.1"), (0.0, "0"),
     (-0.02, "-2"), (-0.001, "0"), (math.nan, "–")],
)  # fmt: skip
def test_a_share_never_claims_all_or_nothing_by_rounding(share, said):
    assert percent(share) == said


@pytest.mark.parametrize(
    ("fact", "said"),
    [
        (LogFact("repeated", "theta", 3), "3 samples of theta repeat the one before"),
        (LogFact("repeated", "theta", 1), "1 sample of theta repeats the one before"),
        (LogFact("quantised", "theta", 0, 0.001, "rad"), "theta is quantised to 0.001 rad"),
        (LogFact("outliers", "x", 12), "12 samples of x leap and were left out"),
        (LogFact("missing", "", 7), "7 samples are missing"),
        (LogFact("jitter", "", 0, 0.4, "ms"), "the clock jitters by 0.4 ms"),
        (
            LogFact("pushed", "", 5, 2.0, "s"),
            "an external push or bump acted from 2 s on and was left out, at 5 samples",
        ),
    ],
)
def test_a_fact_of_the_log_is_said(fact, said):
    assert log_fact_text(fact) == said


def together(*exponents, **changes):
    of = ("parameter_offset on cart_mass: ratio", "actuator_gain on force: gain")
    return Combination(of=of, fixed="", open="", exponents=exponents, **changes)


def test_what_is_fixed_and_what_is_open_is_said():
    ratio = together(1.0, -1.0, value=2.5, low=2.4, high=2.6)
    assert fixed_text(ratio) == "cart_mass / force gain = 2.50 (2.40 to 2.60)"
    assert open_text(ratio) == "both may be scaled alike"
    product = together(1.0, 2.0, value=2.5, unit="N")
    assert fixed_text(product) == "cart_mass · force gain^2 = 2.5 N"
    assert open_text(product) == "one may grow while the other shrinks"
    assert fixed_text(together()) == "one combination of them"
    first, second = (replace(c, fixed=fixed_text(c), open=open_text(c)) for c in (ratio, product))
    assert combination_texts([first, second]) == [combination_text(first), combination_text(second)]
    said, alone = combination_texts([first, second, first])
    assert said.startswith(
        "only cart_mass / force gain = 2.50 (2.40 to 2.60) and cart_mass / force gain = 2.50"
    )
    assert said.endswith(" are determined: all may be scaled together")
    assert alone == combination_text(second)
    own = Combination(of=("cart_mass", "force gain"), fixed="their ratio", open="both scaled alike")
    assert combination_text(own) == "of cart_mass and force gain only their ratio is fixed; both scaled alike"


DRAG, FRICTION, SPRING = "quadratic_drag on q", "coulomb_friction on q", "spring on q"


def test_decisions_stand_below_their_step_and_are_told_once():
    won = Decision("search", (DRAG,), (), True, "good share", gain=12.34, share=0.5)
    lost = Decision("judge", (SPRING,), (), False, "too few nats", gain=-1.0, share=0.0)
    lines = trace_lines([won, won, lost])
    assert lines[0] == "search"
    assert lines[2] == "judge"
    assert len(lines) == 4
    assert lines[1].split()[:8] == ["taken", "12.3", "nats", "50", "%", "good", "share", "+"]
    assert lines[3].split()[0] == "refused"
    assert "too few nats" in lines[3]
    (_, line) = trace_lines([Decision("search", (DRAG,), (), False, "promises too little")])
    assert line.count("–") == 2  # never weighed
