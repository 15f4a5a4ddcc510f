import copy
import json

import pytest
import yaml
from by_hand import UNICYCLE

from gpsim.errors import UsageError
from gpsim.recordings import parse_mapping, parse_yaml, read_recording, read_yaml
from gpsim.recordings.yaml_data import MOST_REPEATED, YamlError
from gpsim.stages.import_log import import_log, mapping_names, read_mapping, resolved_mapping


@pytest.mark.parametrize("name", mapping_names())
def test_every_mapping_that_comes_with_gpsim_is_sound(name):
    plan = parse_mapping(read_mapping(name), name)
    assert plan.description
    assert len(plan.action) >= 1


def changed(path, value):
    raw = copy.deepcopy(UNICYCLE)
    node = raw
    for key in path[:-1]:
        node = node.setdefault(key, {})
    if value is None:
        del node[path[-1]]
    else:
        node[path[-1]] = value
    return raw


@pytest.mark.parametrize(
    ("path", "value", "text"),
    [
        (["rat"], 20, "did you mean 'rate'"),
        (["rate"], None, "rate missing"),
        (["rate"], "fast", "expected a finite number"),
        (["dt"], 0.1, "not both"),
        (["state"], None, "state missing"),
        (["state", "x", "unit"], None, "state.x: unit missing"),
        (["state", "x", "quaternion"], "q", "exactly one of"),
        (["state", "x", "sign"], 2, "must be 1 or -1"),
        (["state", "v"], {"derivative_of": "z", "unit": "m/s"}, "no channel 'z'; there are: x, y, yaw"),
        (["clock"], {"stamps": "sent"}, "not one of auto, header, receive"),
        (["velocities"], {"method": "savgol", "window": 8}, "odd window"),
        (["episodes"], {"by": "flag"}, "needs episodes.field"),
        (["time"], {"field": "t", "step": 1}, "give one of"),
        (["held_out"], {"share": 1.5}, r"share: expected a number in \[0, 1\), got 1.5"),
        (["noise"], {"z": 1.0}, "no channel 'z'"),
        (["gap_limit"], "1_000e1", "expected a finite number"),
        (["state"], ["x"], "expected channel names"),
        (["rate"], 10**400, "expected a finite number"),
        (["gap_limit"], 1e30, r"gap_limit: must lie between 0 and 1e\+09 \[s\]"),
        (["clock"], {"apply_offset": 1e300}, r"apply_offset: must lie between -1e\+10 and 1e\+10 \[s\]"),
        (["velocities"], {"method": "savgol", "window": 9.5}, "window: expected a whole number, got 9.5"),
        (["noise"], {"x": -0.1}, "noise.x: must lie between 0"),
        (["system"], None, "system missing"),
        (["system"], "?", r"still '\?' at system; fill in"),
        (["state", "x", "unit"], "?", r"still '\?' at state\.x\.unit; fill in"),
        (["action"], {"t": {"field": "a", "unit": "N"}}, "action: a channel must not be called 't'"),
        (["action"], {"a\nb": {"field": "a", "unit": "N"}}, r"name 'a b' holds a line break .*\('\\n'\)"),
        (["action"], {"a" * 201: {"field": "a", "unit": "N"}}, "has 201 characters; the limit is 200"),
    ],
)
def test_wrong_mappings_end_in_one_line_with_the_alternatives(path, value, text):
    with pytest.raises(UsageError, match=text) as caught:
        parse_mapping(changed(path, value))
    assert "\n" not in str(caught.value)


def test_a_rate_cannot_be_limited_where_no_row_holds_the_channel():
    raw = changed(["state", "v"], {"derivative_of": "x", "unit": "m/s"})
    with pytest.raises(UsageError, match=r"checks\.max_rate\.v: v is computed from x.*limit x"):
        parse_mapping({**raw, "checks": {"max_rate": {"v": 3.0}}})


@pytest.mark.parametrize("text", ["1e-3", "2E-4", "+5e+2", "-.5e1"])
def test_numbers_that_yaml_takes_for_text_are_numbers(text):
    raw = yaml.safe_load(f"parameters: {{x: {text}}}")
    assert isinstance(raw["parameters"]["x"], str)
    assert parse_mapping({**UNICYCLE, **raw}).parameters["x"] == float(text)


def test_a_mapping_that_is_no_mapping_is_refused():
    with pytest.raises(UsageError, match="expected keys and values"):
        parse_mapping([1, 2])


MULTIPLYING = "\n".join(
    ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    + [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("rate: 5\nstate: 1\nrate: 6", "line 3: duplicate key 'rate', already in line 1"),
        ("a: {b: 1, 'b': 2}", "line 1: duplicate key 'b', already"),
        ("1: a\n'1': b", "line 2: duplicate key '1'"),
        ("a: &a [1, *a]", "line 1: an alias .* contains itself"),
        ("a: &a {b: {c: *a}}", "contains itself"),
        (MULTIPLYING, f"expand to more than {MOST_REPEATED} values"),
        ("a: !!python/object/apply:os.getcwd []", "line 1: .*os.getcwd.* is not a plain value"),
        ("a: !!binary aGk=", "is not a plain value"),
        ("a: !!set {b, c}", "is not a plain value"),
        ("base: &b {c: 1}\nd: {<<: *b}", "line 2: the key << takes in another table"),
        ("? [a, b]\n: 1", "cannot be a key"),
        ("[" * 3000, "nested too deeply"),
        ("a: " + "9" * 5000, "not readable as YAML"),
        ("a: 1\n---\nb: 2", "line 2: .*expected a single document"),
        ("a: [1", "line 1: not readable as YAML"),
        ("a: \0", "not readable as YAML"),
    ],
)
def test_what_is_no_plain_data_is_refused_with_its_line(text, says, tmp_path):
    with pytest.raises(YamlError, match=says):
        parse_yaml(text)
    (tmp_path / "mine.yaml").write_text(text)
    for read in (read_yaml, lambda path: read_mapping(str(path))):
        with pytest.raises(UsageError, match=r"mine\.yaml: ") as caught:
            read(tmp_path / "mine.yaml")
        assert "\n" not in str(caught.value)


def test_plain_data_stay_what_they_are_and_json_can_hold_them():
    text = "a: &x [1, 2.5, true, null, '${oc.env:HOME}', 2024-05-01]\nb: *x\non: 1e-3\n7: '${x}'"
    made = parse_yaml(text)
    assert made["a"] == [1, 2.5, True, None, "${oc.env:HOME}", "2024-05-01"] == made["b"]
    assert (made["on"], made["7"]) == ("1e-3", "${x}")
    assert json.loads(json.dumps(made, sort_keys=True)) == made


def test_a_mapping_cannot_ask_for_the_environment(tmp_path, monkeypatch, cartpole_log):
    """`${oc.env:...}` used to be resolved, and its value written into recording.yaml and the manifest."""
    monkeypatch.setenv("GPSIM_TEST_SECRET", "hunter2")
    (tmp_path / "mine.yaml").write_text(
        "system: cartpole\nrate: source\ntime: {field: t}\ndescription: ${oc.env:GPSIM_TEST_SECRET}\n"
        "state: {x: {field: x, unit: '${oc.env:GPSIM_TEST_SECRET}'}}\n"
        "action: {force: {field: force, unit: '${never.closed'}}\n"
    )
    import_log([cartpole_log], tmp_path / "out", str(tmp_path / "mine.yaml"), ["integrator=rk4"])
    for file in ("recording.yaml", "manifest.json"):
        assert "hunter2" not in (tmp_path / "out" / file).read_text()
    assert read_recording(tmp_path / "out").state.units == {"x": "${oc.env:GPSIM_TEST_SECRET}"}
    words = ["description=${oc.env:GPSIM_TEST_SECRET}", "state.x.offset=1e-3", "files=*.csv"]
    resolved = resolved_mapping(str(tmp_path / "mine.yaml"), words)
    assert resolved["description"] == "${oc.env:GPSIM_TEST_SECRET}"
    assert resolved["state"]["x"] | {"unit": ""} == {"field": "x", "unit": "", "offset": "1e-3"}
    assert resolved["files"] == "*.csv"
