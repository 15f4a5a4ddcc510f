"""Sizes that are one recording's own are judged by the rules of those that all recordings share."""

import json
from dataclasses import replace

import pytest
from rich_diagnoses import friction, named, size

from gpsim.diagnosis.assessment import estimates
from gpsim.diagnosis.fitting import Hypothesis, Shooting
from gpsim.diagnosis.setup import prepare
from gpsim.effects import EffectParameter, Place, Term
from gpsim.findings import Odds, no_size, sized
from gpsim.recordings import joined
from gpsim.reports.wording import implausible_text
from gpsim.simulators import make_simulator
from gpsim.trials.scoring import contradictions

from .worlds import World, record


def test_an_own_size_counts_from_the_value_that_does_nothing():
    near_nothing = size(1.0, 0.1, "1")
    assert not sized("parameter_offset", {"ratio@1": near_nothing})
    assert sized("parameter_offset", {"ratio": near_nothing, "ratio@1": size(1.45, 0.05, "1")})
    assert no_size("parameter_offset", {"ratio@1": size(1.5, 2.0, "1")})


def test_where_an_effect_acts_is_no_size_in_one_recording_either():
    """A spring's rest position may be known, its stiffness is what counts."""
    assert not sized("spring", {"stiffness@0": size(0.1, 1.1, "N/m"), "rest_position@0": size(1.0, 0.1, "m")})


def test_a_file_is_held_to_what_it_says_of_each_recording():
    vague, known = size(0.02, 0.03, "N"), size(0.2, 0.01, "N")

    def found(**changes):
        effect = friction(probability=0.999, odds=Odds(7.0, ()), parameters={"force": vague}, **changes)
        diagnosis = replace(named(), effects=(effect,), alternatives=())
        return contradictions(json.loads(json.dumps(diagnosis.to_dict())))

    assert any("size of coulomb_friction on x is unknown" in line for line in found())
    assert found(own={"friday": {"force": known}}) == []
    held = replace(known, at_bound=True)
    assert any("stopped at its bound" in line for line in found(own={"friday": {"force": held}}))


def test_a_size_that_no_machine_has_is_told_with_its_recording():
    unusual = replace(size(9.0, 0.1, "N"), usual=(0.0, 3.0))
    both = friction(own={"friday": {"force": unusual}})
    assert implausible_text(both).endswith("is implausible: force 9 N in friday, usual up to 3 N")
    alone = friction(
        parameters={"force": unusual}, recordings=("friday",), own={"friday": {"force": unusual}}
    )
    assert implausible_text(alone) == implausible_text(both)


def sizes_of(question, hypothesis):
    """What is told of its only term, as it stands."""
    problem = question.everything
    starts = problem.windows.measured[:, 0]
    (sizes,) = estimates(question, Shooting(problem).at(hypothesis, starts), 0.0)
    return sizes


def test_an_end_that_the_readings_show_stopped_at_no_bound():
    part = replace(record(World("cartpole"), seed=1, episodes=3, steps=80), held_out=None)
    simulator = make_simulator("cartpole")
    question = prepare(part, simulator, simulator.defaults(part.parameters))
    end = Place("x", "m", visited=(-1.0, 1.0), stands=(False, True)).reading_end("high", highest=True)
    searched = replace(end, exact=None, place=False)
    for declared, held in ((end, False), (searched, True)):
        term = Term("sensor_saturation", "x", {"high": end.high}, variant="upper")
        assert sizes_of(question, Hypothesis((term,), ((declared,),)))["high"].at_bound == held


def test_a_law_that_is_simpler_stopped_at_no_bound():
    """Friction without a peak at rest: its static force is 0; a gain that is 0 says that nothing is known."""
    part = replace(record(World("cartpole"), seed=1, episodes=3, steps=80), held_out=None)
    simulator = make_simulator("cartpole")
    question = prepare(part, simulator, simulator.defaults(part.parameters))
    force = EffectParameter("force", "N", 0.0, 10.0, (1.0,), 0.2)
    peak = (
        replace(force, name="static_force"),
        EffectParameter("stribeck_velocity", "m/s", 0.01, 2.0, (0.1,), 0.1),
    )
    term = Term("stribeck_friction", "x", {"force": 1.0, "static_force": 0.0, "stribeck_velocity": 0.1})
    sizes = sizes_of(question, Hypothesis((term,), ((force, *peak),)))
    assert not any(size.at_bound for size in sizes.values())
    alone = Term("viscous_friction", "x", {"damping": 0.0})
    assert sizes_of(question, Hypothesis((alone,), ((replace(force, name="damping"),),)))["damping"].at_bound


def test_a_coefficient_is_told_beside_each_recordings_own_force():
    parts = [record(World("cartpole"), seed=seed, episodes=3, steps=80) for seed in (1, 2)]
    simulator = make_simulator("cartpole")
    parts = [replace(part, held_out=None) for part in parts]
    question = prepare(joined(parts, ["a", "b"]), simulator, simulator.defaults(parts[0].parameters))
    force = EffectParameter("force", "N", 0.0, 10.0, (1.0,), 0.2)
    term = Term("coulomb_friction", "x", {"force": 1.0, "force@1": 2.0})
    hypothesis = Hypothesis((term,), ((force, replace(force, name="force@1")),))
    sizes = sizes_of(question, hypothesis)
    assert set(sizes) == {"force", "force@1", "coefficient", "coefficient@1"}
    assert sizes["coefficient@1"].value == pytest.approx(2.0 * sizes["coefficient"].value, rel=0.05)
