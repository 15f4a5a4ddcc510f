"""YAML of strangers: text stays text, and what is no plain data is one line with its place."""

import json
import re
from pathlib import Path

import pytest
import yaml

from gpsim.errors import UsageError
from gpsim.recordings.files import read_recording
from gpsim.recordings.yaml_data import MOST_REPEATED, YamlError, parse_yaml, read_yaml
from gpsim.stages.import_log import import_log, read_mapping, resolved_mapping

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


def test_yaml_of_data_has_one_reader():
    """Hydra's configurations apart, which cli/composing.py composes."""
    root = Path(__file__).resolve().parents[2]
    reading = re.compile(r"yaml\.(safe_|full_|unsafe_)?load|OmegaConf")
    found = {
        p.relative_to(root).as_posix() for p in root.glob("gpsim/**/*.py") if reading.search(p.read_text())
    }
    assert not found


def test_recordings_with_shared_lists_as_yaml_writes_them_are_read():
    shared = list(range(50))
    assert parse_yaml(yaml.safe_dump({str(i): shared for i in range(20)}))["19"] == shared


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


def test_recording_yaml_is_read_as_safely(tmp_path):
    (tmp_path / "recording.yaml").write_text(
        f"system: cartpole\ndt: 0.1\nstate: {{x: m}}\nprovenance:\n  {MULTIPLYING}".replace("\na", "\n  a")
    )
    with pytest.raises(UsageError, match=r"recording\.yaml: line \d+: aliases"):
        read_recording(tmp_path)
    (tmp_path / "recording.yaml").write_text("system: cartpole\ndt: 0.1\nstate: {x: m}\ndt: 0.2\n")
    with pytest.raises(UsageError, match=r"recording\.yaml: line 4: duplicate key 'dt', already in line 2"):
        read_recording(tmp_path)
