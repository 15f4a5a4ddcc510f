"""What the user knows: parameters, bounds and families, each taken at its word or refused in one line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gpsim.cli.configuration import resolve

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Known, read_known
from gpsim.diagnosis.setup import not_asked, offers_of, prepare
from gpsim.errors import UsageError
from gpsim.recordings import write_recording
from gpsim.reports.diagnosis_text import not_asked_lines
from gpsim.simulators import make_simulator
from gpsim.stages.diagnose import Task, stage_for
from gpsim.stages.stage import Request

from .worlds import World, record

DAMPED = World("slider", forces={0: lambda q, v, t: -1.5 * v})
RECORDING = record(DAMPED, seed=1, episodes=5, steps=100)


def asked(known, recording=RECORDING):
    simulator = make_simulator(recording.system)
    run = Run(known=known)
    question = prepare(recording, simulator, simulator.defaults(recording.parameters), run)
    return question, offers_of(question)


def found(known, recording=RECORDING):
    simulator = make_simulator(recording.system)
    parameters = simulator.defaults(recording.parameters)
    return diagnose(recording, simulator, parameters, np.random.default_rng(0), run=Run(known=known))


def test_a_parameter_that_is_known_is_the_bases_and_never_asked():
    question, offers = asked(Known(fix={"mass": 2.5}))
    assert question.everything.parameters == {"mass": 2.5}
    assert not [c for c in offers if c.family == "parameter_offset"]
    assert not_asked_lines(not_asked(question)) == ["mass is known (2.5 kg); not asked: parameter offset"]


def test_bounds_are_in_the_parameters_own_unit():
    _, offers = asked(Known(bounds={"mass": (1.5, 3.0), "viscous_friction.q.damping": (1.0, 1.2)}))
    (ratio,) = next(c for c in offers if c.family == "parameter_offset").declared
    assert (ratio.low, ratio.high) == (0.75, 1.5)
    (damping,) = next(c for c in offers if c.family == "viscous_friction").declared
    assert (damping.low, damping.high) == (1.0, 1.2)
    assert all(1.0 < start < 1.2 for start in damping.starts)


def test_families_are_asked_alone_or_left_out():
    _, offers = asked(Known(only=("viscous_friction", "sensor_bias on q"), require=("coulomb_friction",)))
    assert {c.identity for c in offers} == {
        ("viscous_friction", "q"), ("sensor_bias", "q"), ("coulomb_friction", "q"),
    }  # fmt: skip
    question, offers = asked(Known(without=("viscous_friction", "sensor_bias on q")))
    claims = {c.identity for c in offers}
    assert ("sensor_bias", "q_dot") in claims
    assert not claims & {("viscous_friction", "q"), ("sensor_bias", "q")}
    assert not_asked_lines(not_asked(question)) == ["left out as you said; not asked: viscous friction"]


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ({"fix": {"mas": 1.0}}, "diagnose.known.fix: no parameter of slider 'mas' (did you mean 'mass'?); there are: mass"),
        ({"fix": {"mass": -1.0}}, "mass=-1 kg: expected more than 0"),
        ({"bounds": {"mass": (3.0, 4.0)}}, "diagnose.known.bounds.mass: [3, 4] does not contain the value of the simulator, 2 kg"),
        ({"bounds": {"friction": (3.0, 4.0)}}, "'friction' is neither a parameter of slider (mass) nor family.place.parameter"),
        ({"bounds": {"spring.q.stifness": (3.0, 4.0)}}, "no parameter of spring 'stifness' (did you mean 'stiffness'?)"),
        ({"only": ("coulomb",)}, "diagnose.families.only: no family 'coulomb'"),
        ({"without": ("spring on x",)}, "diagnose.families.without: no place of spring 'x'; there are: q"),
        ({"require": ("understeer",)}, "diagnose.families.require: understeer acts on nothing that slider has"),
        ({"require": ("spring",), "without": ("spring",)}, "'spring' cannot be required: this recording cannot show it, or you"),
        ({"require": ("local_friction_patch",)}, "cannot be required: it acts in a region only"),
    ],
)  # fmt: skip
def test_names_that_nobody_knows_end_in_one_line(known, said):
    with pytest.raises(UsageError) as caught:
        asked(Known(**known))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["diagnose.known.fix=3"], "diagnose.known.fix: expected names and values, as {name: value}, got 3"),
        (["diagnose.known.fix={mass: heavy}"], "diagnose.known.fix.mass: expected a number, got 'heavy'"),
        (["diagnose.known.bounds={mass: [3, 2]}"], "expected [low, high] with low < high, got [3, 2]"),
        (["diagnose.families.only=spring"], "diagnose.families.only: expected a list, as [coulomb_friction"),
    ],
)
def test_what_has_no_form_ends_in_one_line(words, said):
    config = resolve(words, None)["diagnose"]
    with pytest.raises(UsageError) as caught:
        read_known(config["known"], config["families"])
    assert said in str(caught.value)


def test_the_command_line_says_it_and_it_is_part_of_the_recipe(tmp_path: Path):
    (tmp_path / "recording").mkdir()
    write_recording(RECORDING, tmp_path / "recording", "csv")
    words = [
        "diagnose.known.fix={mass: 2.1}",
        "diagnose.known.bounds={coulomb_friction.q.force: [0, 5]}",
        "diagnose.families.require=['spring on q']",
    ]

    def recipe(words):
        request = Request(resolve([*words, f"runs_dir={tmp_path}"], None), words, lambda *_: None)
        return stage_for(Task(tmp_path / "recording", None)).recipe(request)

    told = recipe(words).config["known"]
    assert told["fix"] == {"mass": 2.1}
    assert told["bounds"] == {"coulomb_friction.q.force": [0.0, 5.0]}
    assert told["require"] == ["spring on q"]
    assert "known" not in recipe([]).config


def test_what_is_required_and_there_is_found_and_what_does_nothing_is_told():
    outcome = found(Known(only=("viscous_friction",), require=("viscous_friction", "constant_force on q")))
    roles = {(e.family, e.on): e.role for e in outcome.diagnosis.effects}
    assert roles == {("viscous_friction", "q"): "headline", ("constant_force", "q"): "slight"}
    assert outcome.diagnosis.verdict == "named"


def test_what_is_required_stays_though_no_rule_would_take_it():
    slight = World("slider", forces={0: lambda q, v, t: -1.5 * v + 0.03})
    recording = replace(record(slight, seed=1, episodes=5, steps=100))
    asked_for = ("viscous_friction", "constant_force")
    plain = found(Known(only=asked_for), recording)
    forced = found(Known(only=asked_for, require=("constant_force",)), recording)
    assert {e.family for e in plain.diagnosis.effects} == {"viscous_friction"}
    assert {e.family for e in forced.diagnosis.effects} == set(asked_for)
    assert not forced.judgement.rivals
