import copy

import pytest
import yaml
from by_hand import UNICYCLE

from gpsim.errors import UsageError
from gpsim.recordings.mapping import parse_mapping
from gpsim.stages.import_log import mapping_names, read_mapping


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
        (["rate"], -1, "rate must be positive"),
        (["dt"], 0.1, "not both"),
        (["state"], None, "state missing"),
        (["state", "x", "unit"], None, "state.x: unit missing"),
        (["state", "x", "quaternion"], "q", "exactly one of"),
        (["state", "x", "sign"], 2, "must be 1 or -1"),
        (["state", "x", "wraps"], "yes", "true or false"),
        (["state", "yaw", "angle"], "heading", "not one of roll, pitch, yaw"),
        (["state", "v"], {"derivative_of": "z", "unit": "m/s"}, "no channel 'z'; there are: x, y, yaw"),
        (["clock"], {"stamps": "sent"}, "not one of auto, header, receive"),
        (["clock"], {"offset": 1}, "did you mean 'offsets'"),
        (["velocities"], {"method": "savgol", "window": 8}, "odd window"),
        (["velocities"], {"sigma": 0}, "sigma must be positive"),
        (["episodes"], {"by": "flag"}, "needs episodes.field"),
        (["time"], {"field": "t", "step": 1}, "give one of"),
        (["held_out"], {"share": 1.5}, r"share: expected a number in \[0, 1\), got 1.5"),
        (["noise"], {"z": 1.0}, "no channel 'z'"),
        (["gap_limit"], "1_000e1", "expected a finite number"),
        (["gap_limit"], "nan", "expected a finite number"),
        (["parameters"], {"wheelbase": float("nan")}, "finite number"),
        (["state"], ["x"], "expected channel names"),
        (["rate"], 10**400, "expected a finite number"),
        (["hold_limit"], -1.0, r"hold_limit must be positive \[s\], got -1"),
        (["gap_limit"], 1e30, r"gap_limit: must lie between 0 and 1e\+09 \[s\]"),
        (["clock"], {"apply_offset": 1e300}, r"apply_offset: must lie between -1e\+10 and 1e\+10 \[s\]"),
        (["clock"], {"offsets": {"/cmd": -1e300}}, r"offsets\./cmd: must lie between"),
        (["time"], {"field": "t", "scale": 0}, "time.scale must be positive"),
        (["time"], {"step": 1e300}, "time.step: must lie between"),
        (["velocities"], {"method": "savgol", "window": 1e9 + 1}, "window: must lie between"),
        (["velocities"], {"method": "savgol", "window": 9.5}, "window: expected a whole number, got 9.5"),
        (["episodes"], {"min_duration": -1}, "min_duration: must lie between 0"),
        (["held_out"], {"episodes_from": 2.7}, "episodes_from: expected a whole number"),
        (["checks"], {"jump": 0}, "jump must be positive"),
        (["noise"], {"x": -0.1}, "noise.x: must lie between 0"),
        (["state", "x", "scale"], 1e200, r"state\.x\.scale: must lie between"),
        (["system"], None, "system missing"),
        (["system"], "?", r"still '\?' at system; fill in"),
        (["state", "x", "unit"], "?", r"still '\?' at state\.x\.unit; fill in"),
        (["time"], {"field": "?"}, r"still '\?' at time\.field"),
        (["action"], {"t": {"field": "a", "unit": "N"}}, "action: a channel must not be called 't'"),
        (["action"], {"episode": {"field": "a", "unit": "N"}}, "a channel must not be called 'episode'"),
        (["action"], {"a\nb": {"field": "a", "unit": "N"}}, r"name 'a b' holds a line break .*\('\\n'\)"),
        (["action"], {" ": {"field": "a", "unit": "N"}}, "is empty"),
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
