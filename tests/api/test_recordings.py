"""Recordings from Python: what is taken, and the one line for what is not."""

import json
import warnings

import numpy as np
import pandas as pd
import pytest
import yaml
from api.conftest import UNITS

import gpsim
from gpsim.errors import UsageError
from gpsim.recordings import write_recording


def refused(function, *given, **named):
    with pytest.raises(UsageError) as caught:
        function(*given, **named)
    said = str(caught.value)
    assert "\n" not in said
    return said


def from_frame(frame, units=UNITS, simulator="slider", **named):
    return gpsim.recording_from_frame(frame, units, simulator, **named)


def test_a_frame_is_the_table_that_a_file_would_hold(log, here):
    frame, file = from_frame(log), gpsim.read_recording("slider.csv", "slider")
    assert frame.state == file.state
    assert frame.action == file.action
    told = [(one.system, one.integrator, one.parameters) for one in (frame, file)]
    assert told[0] == told[1]
    np.testing.assert_allclose(frame.episodes[0].states, file.episodes[0].states)
    assert frame.dt == pytest.approx(0.02)


def test_columns_may_be_called_otherwise_and_others_are_passed_over(log):
    frame = log.rename(columns={"t": "stamp"}).assign(run=np.repeat(["a", "b", "c"], 100), note="x")
    recording = from_frame(frame, time="stamp", episode="run", dt=0.02)
    assert [e.name for e in recording.episodes] == ["a", "b", "c"]
    assert recording.dt == 0.02
    assert from_frame(log.set_index("t")).transition_count == 299


def test_what_is_known_beside_the_columns_is_kept(log):
    recording = from_frame(
        log,
        parameters={"mass": 1.5},
        integrator="rk4",
        velocities="differentiated",
        noise={"q": 1e-4},
        held_out=0.3,
    )
    assert recording.parameters == {"mass": 1.5}
    assert (recording.integrator, recording.velocities) == ("rk4", "differentiated")
    assert recording.noise == {"q": 1e-4}
    assert recording.held_out.share == 0.3
    turning = pd.DataFrame({"t": 0.02 * np.arange(50), "theta": 0.1, "theta_dot": 0.2, "torque": 0.0})
    units = {"theta": "rad", "theta_dot": "rad/s", "torque": "N m"}
    assert not from_frame(turning, units, "pendulum").state.wraps.any()
    assert from_frame(turning, units, "pendulum", wraps=["theta"]).state.wraps.tolist() == [True, False]


@pytest.mark.parametrize(
    ("change", "named", "said"),
    [
        ({}, {"units": UNITS | {"force": "kN"}}, "force is in kN, slider's in N: convert the column"),
        ({}, {"units": {"q": "m", "speed": "m/s"}}, "no column 'speed'; it has: t, q, q_dot, force"),
        ({"speed": 1.0}, {"units": UNITS | {"speed": "m/s"}}, "slider has no channel 'speed'"),
        ({}, {"units": {}}, "units: expected column: unit"),
        ({}, {"units": {"q": 1}}, "units: expected column: unit"),
        ({}, {"time": "stamp"}, "no column 'stamp'"),
        ({}, {"simulator": "slidder"}, "unknown simulator 'slidder' (did you mean 'slider'?); registered are: cartpole"),
        ({}, {"dt": 0.1}, "dt=0.1 s, but the usual step of its time is 0.02 s"),
        ({}, {"dt": -1.0}, "dt: expected seconds, more than 0"),
        ({}, {"held_out": 1.5}, "held_out: expected a share in [0, 1), got 1.5"),
        ({}, {"noise": {"speed": 1.0}}, "noise: 'speed' is not one of q, q_dot, force"),
        ({}, {"noise": {"q": -1.0}}, "a standard deviation must be at least 0, got -1"),
        ({}, {"wraps": "angle"}, "wraps: 'angle' is not one of q, q_dot"),
        ({}, {"integrator": "midpoint"}, "integrator: 'midpoint' is not one of euler"),
        ({}, {"velocities": "guessed"}, "velocities: 'guessed' is not one of measured"),
        ({}, {"parameters": {"weight": 1.0}}, "simulator slider: no parameter 'weight'"),
        ({"force": "much"}, {}, "a value is not a number"),
    ],
)  # fmt: skip
def test_what_is_refused_in_one_line(log, change, named, said):
    assert said in refused(from_frame, log.assign(**change), **named)


def test_values_and_times_that_cannot_be_are_named_with_their_row(log):
    hole = log.copy()
    hole.loc[7, "q"] = np.nan
    assert "the frame: episode 0, row 7, channel q: nan is not finite" in refused(from_frame, hole)
    back = log.copy()
    back.loc[9, "t"] = 0.0
    assert "the frame: episode 0, row 9: t does not increase" in refused(from_frame, back)
    rng = np.random.default_rng(0)
    anyhow = log.assign(t=np.cumsum(rng.exponential(0.02, len(log))))
    assert "its time has no usual step: " in refused(from_frame, anyhow)
    assert "t looks like milliseconds" in refused(from_frame, log.assign(t=1000 * log.t))
    assert "add dt=20" in refused(from_frame, log.assign(t=1000 * log.t))
    assert "no rows" in refused(from_frame, log.iloc[:0])
    assert "too short" in refused(from_frame, log.iloc[:1])
    assert "expected a pandas DataFrame, got dict" in refused(from_frame, {"q": [1.0]})


def test_a_folder_and_a_bare_table(made, here):
    (here / "kept").mkdir()
    write_recording(made.recording, here / "kept")
    read = gpsim.read_recording(here / "kept")
    np.testing.assert_array_equal(read.episodes[0].states, made.recording.episodes[0].states)
    assert "a plain table needs a simulator" in refused(gpsim.read_recording, "slider.csv")
    assert "no such recording" in refused(gpsim.read_recording, "nothing.csv")
    (here / "run.bag").write_bytes(b"#ROSBAG")
    assert "a raw log needs a mapping=" in refused(gpsim.read_recording, "run.bag")
    assert "several logs need a mapping" in refused(gpsim.read_recording, ["a.csv", "b.csv"])
    assert "go with a mapping" in refused(gpsim.read_recording, "slider.csv", "slider", salvage=True)


def test_a_log_with_a_mapping(here, log):
    """A file, or its content; changes are the command line's words; what needs a second look is a warning."""
    log.rename(columns={"q": "position", "q_dot": "speed", "force": "push"}).to_csv("raw.csv", index=False)
    mapping = {
        "system": "slider",
        "time": {"field": "t"},
        "state": {"q": {"field": "position", "unit": "m"}, "q_dot": {"field": "speed", "unit": "m/s"}},
        "action": {"force": {"field": "push", "unit": "N"}},
        "rate": 50,
    }
    (here / "mine.yaml").write_text(yaml.safe_dump(mapping))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        read = gpsim.read_recording("raw.csv", mapping=mapping)
        filed = gpsim.read_recording("raw.csv", mapping="mine.yaml", changes=["rate=25"])
    assert read.system == "slider"
    assert (read.dt, filed.dt) == (0.02, 0.04)
    assert "mapping" in json.dumps(list(read.provenance))
    said = refused(gpsim.read_recording, "raw.csv", mapping=mapping | {"state": {}})
    assert said.startswith("mapping")
    assert "names its system" in refused(gpsim.read_recording, "raw.csv", "slider", mapping=mapping)


def test_what_an_import_asks_to_be_looked_at_is_a_warning(here, log):
    log.to_csv("raw.csv", index=False)
    mapping = {
        "system": "slider",
        "time": {"field": "t"},
        "state": {"q": {"field": "q", "unit": "m"}, "q_dot": {"field": "q_dot", "unit": "m/s"}},
        "action": {},
        "rate": 50,
    }
    with pytest.warns(UserWarning, match="no commands"):
        gpsim.read_recording("raw.csv", mapping=mapping)
