"""The result as an object: what is written is read again, of this version, of older ones and of later ones."""

import json
import math
import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from made_diagnoses import made_diagnosis, made_effect, made_location, made_remainder

from gpsim.artifacts import Recipe, Store
from gpsim.diagnosis import SCHEMA, Diagnosis, schema
from gpsim.errors import UsageError
from gpsim.findings import Discrimination, Estimate, NoGp, Ratio, RemainderGp, StepErrors
from gpsim.findings.codec import FLAT, may_lack, written_fields
from gpsim.stages.diagnose import read_diagnosis

VALID = Draft202012Validator(schema())
WORDS = st.text("xyθ_.[<", min_size=1, max_size=4)
SCALARS = {
    float: st.floats(allow_nan=False, allow_infinity=False),
    int: st.integers(1, 9),
    str: WORDS,
    bool: st.booleans(),
    types.NoneType: st.none(),
    Any: st.none() | st.booleans() | WORDS,
}


def values(kind):
    """Any value that a field of this type may hold."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Literal:
        return st.sampled_from(inner)
    if origin in (Union, types.UnionType):
        return st.one_of([values(k) for k in inner])
    if origin is Mapping:
        return st.dictionaries(WORDS, values(inner[1]), max_size=2)
    if origin is tuple and Ellipsis in inner:
        return st.lists(values(inner[0]), max_size=2).map(tuple)
    if origin is tuple:
        return st.tuples(*map(values, inner))
    if is_dataclass(kind):
        hints = get_type_hints(kind)
        return st.builds(kind, **{f.name: values(hints[f.name]) for f in written_fields(kind)})
    return SCALARS[kind]


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(values(Diagnosis))
def test_what_is_written_is_read_again_and_keeps_the_schema(diagnosis):
    text = json.dumps(diagnosis.to_dict(), allow_nan=False)
    VALID.validate(json.loads(text))
    again = Diagnosis.from_dict(json.loads(text))
    assert again == diagnosis
    assert json.dumps(again.to_dict()) == text


def test_the_keys_stand_in_the_order_of_the_file():
    """Rollouts were written in an order of their own, and a program may compare bytes."""
    content = made_diagnosis().to_dict()
    assert list(content)[:4] == ["schema", "verdict", "location", "effects"]
    step = list(content["fit"]["one_step"]["q_acc"])
    run = list(content["fit"]["rollout"]["q"])
    assert step[:6] == ["before", "tuned", "gp", "after", "after_gp", "noise_floor"]
    assert run[:6] == ["before", "tuned", "gp", "after_gp", "after", "noise_floor"]
    assert "finely" not in step


def reached(kind, found):
    """Every dataclass below a type, itself among them."""
    if is_dataclass(kind):
        if kind not in found:
            found.add(kind)
            hints = get_type_hints(kind)
            for f in written_fields(kind):
                reached(hints[f.name], found)
    else:
        for inner in get_args(kind):
            reached(inner, found)
    return found


@pytest.mark.parametrize("kind", sorted(reached(Diagnosis, set()), key=lambda k: k.__name__))
def test_the_schema_has_the_keys_of_the_classes(kind):
    told = schema() if kind is Diagnosis else schema()["$defs"][kind.__name__]
    own = [f for f in written_fields(kind) if f.metadata != FLAT]
    extra = ["schema"] if kind is Diagnosis else []
    assert list(told["properties"]) == [*extra, *(f.name for f in own)]
    assert set(told["required"]) == {*extra, *(f.name for f in own if not may_lack(f))}
    for name, part in told["properties"].items():
        assert "description" in part or "$ref" in part or name == "schema", name


def test_the_schema_is_one_and_refuses_what_is_none():
    Draft202012Validator.check_schema(schema())
    content = made_diagnosis(effects=(made_effect(),)).to_dict()
    assert VALID.is_valid(content)
    assert VALID.is_valid(content | {"later": 1})
    assert not VALID.is_valid(content | {"verdict": "perhaps"})
    content["effects"][0]["parameters"]["stiffness"]["value"] = "large"
    assert not VALID.is_valid(content)


def test_a_file_of_the_first_version_is_read_and_keeps_the_schema():
    errors = {
        "before": 2.0,
        "tuned": 1.5,
        "gp": 1.0,
        "after": 0.5,
        "after_gp": 0.4,
        "noise_floor": 0.3,
        "unit": "m",
    }
    content = {
        "schema": SCHEMA, "verdict": "named",
        "location": {"channels": {"q_acc": 0.9}, "region": {}, "since": None, "depends_on": ["q"]},
        "effects": [{
            "family": "spring", "on": "q", "site": "force", "region": {"q": [0.1, 0.2]}, "since": None,
            "parameters": {"stiffness": {"value": 1, "low": 0.9, "high": 1.1, "unit": "N/m"}},
            "probability": 1.0, "evidence_gain": 9.0, "explains": 1.0, "sentence": "a spring",
        }],
        "alternatives": [], "tell_apart": None,
        "fit": {
            "held_out": ["4"], "one_step": {"q_acc": errors},
            "rollout": {"horizon_s": 1.0, "q": {"before": 1.0, "after": 0.1, "unit": "m"}},
        },
        "remainder": {"structured": False, "depends_on": [], "p_value": 0.4},
        "integration": "fine", "tuned": {},
        "ranking": [{"nats_behind": 0.0, "effects": [["spring", "q"]], "scheme": "fine"}],
    }  # fmt: skip
    assert VALID.is_valid(content)
    found = Diagnosis.from_dict(content)
    assert (found.thinned, found.dt, found.not_measured) == (1, None, ())
    assert found.remainder.gp is None
    assert found.effects[0].odds is None
    assert not found.effects[0].parameters["stiffness"].at_bound
    assert found.fit.one_step["q_acc"].gp == 1.0
    assert math.isnan(found.fit.rollout.channels["q"].gp)
    assert found.ranking[0].windows == "search"


def test_keys_of_a_later_version_are_passed_over():
    content = made_diagnosis(effects=(made_effect(),)).to_dict() | {
        "schema": "gpsim.diagnosis/3",
        "weather": {},
    }
    content["effects"][0] |= {"colour": "red"}
    assert Diagnosis.from_dict(content).effects == (made_effect(),)


def test_the_first_version_is_read():
    """It had no shares: an effect is a headline then, and nobody tested its law."""
    content = made_diagnosis(effects=(made_effect(),)).to_dict() | {"schema": "gpsim.diagnosis/1"}
    for key in ("explained", "curves", "combinations", "log_facts"):
        del content[key]
    for key in ("importance", "needed", "role", "form"):
        del content["effects"][0][key]
    del content["remainder"]["share"], content["remainder"]["rate"]
    found = Diagnosis.from_dict(content)
    assert (found.explained.rollout, found.log_facts, found.remainder.share) == (None, (), None)
    assert (found.effects[0].role, found.effects[0].form) == ("headline", "untested")


def test_what_earlier_versions_found_beside_is_read_and_written_again():
    content = json.loads(json.dumps(made_diagnosis(effects=(made_effect(),)).to_dict()))
    assert content["remainder"]["lack_of_fit"] is None
    law = {"rate": "q_acc", "on": ["q"], "memory": None, "nats": 9.0, "p_value": 1e-9, "curve": None}
    free = {"effects": [["spring", "q"]], "quantity": "force on q", "at": [0.0, 1.0], "given": {"u": 0.1}}
    curve = {
        "quantity": "force on q", "unit": "N", "input": "q", "input_unit": "m", "at": [0.0, 1.0], "low": [], "high": [],
        "values": [0.0, 1.0, 2.0, 3.0], "visited": [0.0, 1.0], "freedom": 2.0,
        "nearest": [{"effects": [["spring", "q"]], "parameters": {"spring.stiffness": 1.0}, "misses": 0.1}],
    }  # fmt: skip
    content["remainder"]["lack_of_fit"], content["curves"], content["effects"][0]["curve"] = (
        law,
        [free],
        curve,
    )
    assert VALID.is_valid(content)
    assert json.loads(json.dumps(Diagnosis.from_dict(content).to_dict())) == content
    later = {"second": "v", "second_unit": "m/s", "second_at": [0.0, 1.0], "found": {"form": "sine"}}
    content["effects"][0]["curve"] |= later
    assert Diagnosis.from_dict(content).effects[0].curve.values == (0.0, 1.0, 2.0, 3.0)


def test_several_places_of_one_effect_are_read():
    """The contract lets `on` be a list, which this program never writes."""
    effect = made_effect(on=("x", "y"))
    found = Diagnosis.from_dict(json.loads(json.dumps(made_diagnosis(effects=(effect,)).to_dict())))
    assert found.effects[0].on == ("x", "y")
    assert found.effects[0].place == "x,y"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.pop("schema"), "x.json: not a diagnosis: expected the schema gpsim.diagnosis/2, got None"),
        (lambda d: d.update(schema="gpsim.evaluation/1"), "not a diagnosis"),
        (lambda d: d.pop("fit"), "x.json: lacks 'fit'"),
        (lambda d: d["fit"].pop("rollout"), "x.json: fit: lacks 'rollout'"),
        (lambda d: d.update(verdict="perhaps"), "x.json: verdict: expected one of named, ambiguous, partial, unknown, none, got"),
        (lambda d: d.update(effects={}), "x.json: effects: expected a list, got {}"),
        (lambda d: d["effects"][0].update(on=3), "x.json: effects[0].on: expected a list, got 3"),
        (lambda d: d["effects"][0].update(region={"q": [1.0]}), "x.json: effects[0].region.q: expected a list of 2"),
        (lambda d: d["effects"][0].update(explains="all"), "x.json: effects[0].explains: expected a number, got 'all'"),
        (lambda d: d["effects"][0]["parameters"].update(stiffness=1.0), "parameters.stiffness: expected an object"),
        (lambda d: d.update(thinned=True), "x.json: thinned: expected a whole number, got True"),
        (lambda d: d["fit"]["rollout"].update(q=[1]), "x.json: fit.rollout.q: expected an object, got [1]"),
    ],
)  # fmt: skip
def test_a_damaged_file_is_told_in_one_line_with_the_place(change, said):
    content = made_diagnosis(effects=(made_effect(),)).to_dict()
    change(content)
    with pytest.raises(UsageError) as told:
        Diagnosis.from_dict(content, "x.json")
    assert said in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("content", [None, [], "named", 3])
def test_what_is_no_object_is_no_diagnosis(content):
    with pytest.raises(UsageError, match="not a diagnosis"):
        Diagnosis.from_dict(content)


@pytest.mark.parametrize(
    ("text", "said"),
    [("{", "diagnosis.json: not readable as JSON"), ("{}", "diagnosis.json: not a diagnosis")],
)
def test_a_finished_diagnosis_with_a_wrong_file_is_told_in_one_line(tmp_path, text, said):
    def write(folder):
        (folder / "diagnosis.json").write_text(text)
        return {}

    made = Store(tmp_path, "any").publish(Recipe("diagnose", {}, {}, {}), write)
    with pytest.raises(UsageError) as told:
        read_diagnosis(made.path)
    assert said in str(told.value)
    assert "\n" not in str(told.value)


def test_what_is_not_finite_is_null_in_the_file_and_settled_before():
    """Else the page of a diagnosis would tell other things than the page of its file."""
    errors = StepErrors(
        before=np.float64(np.inf), after=1.0, unit="m", after_over_before=Ratio(math.inf, None, None)
    )
    nothing = made_diagnosis(
        effects=(
            made_effect(parameters={"stiffness": Estimate(np.float64(1.0), math.nan, -math.inf, "N/m")}),
        ),
        location=made_location(region={"q": (np.float64(0.5), 1.0)}),
    )
    made = replace(nothing, fit=replace(nothing.fit, one_step={"q_acc": errors}), thinned=np.int64(3))
    found = made.settled()
    assert math.isnan(found.fit.one_step["q_acc"].before)
    assert found.fit.one_step["q_acc"].after_over_before.value is None
    assert found.effects[0].parameters["stiffness"] == Estimate(1.0, None, None, "N/m")
    assert type(found.location.region["q"][0]) is float
    assert type(found.thinned) is int
    text = json.dumps(found.to_dict(), allow_nan=False)
    assert json.loads(text)["fit"]["one_step"]["q_acc"]["before"] is None
    assert Diagnosis.from_dict(json.loads(text)) == found


def test_facts_that_the_file_holds_in_words_are_kept_beside_them():
    refused = RemainderGp(False, None, None, NoGp("no structure"))
    made = made_diagnosis(discrimination=Discrimination((), ()), remainder=made_remainder(gp=refused))
    assert made.settled().discrimination == Discrimination((), ())
    assert made.settled().remainder.gp.refused == NoGp("no structure")
    assert "discrimination" not in made.to_dict()
    assert "refused" not in made.to_dict()["remainder"]["gp"]


def test_the_objects_are_frozen():
    for kind in reached(Diagnosis, set()):
        assert kind.__dataclass_params__.frozen, kind
        assert fields(kind)
