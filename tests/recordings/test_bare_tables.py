"""A bare table: columns by name, episodes by a column, what may be absent, and one line for every fault."""

import numpy as np
import pandas as pd
import pytest

from gpsim.channels import Channels
from gpsim.errors import UsageError
from gpsim.recordings import Described, read_bare_table
from gpsim.stages.diagnose import Task, open_recording
from gpsim.stages.import_log import read_logs

STATE, ACTION = Channels.of({"q": "m", "q_dot": "m/s"}), Channels.of({"force": "N"})


def table():
    t = 0.1 * np.arange(4)
    rows = {"t": np.r_[t, t], "q": np.arange(8.0), "q_dot": 1.0, "force": [1, 2, 3, None, 5, 6, 7, None]}
    return pd.DataFrame(rows | {"episode": ["b"] * 4 + ["a"] * 4, "remark": "none"})


def read(path, frame, **kwargs):
    frame.to_parquet(path) if path.suffix == ".parquet" else frame.to_csv(path, index=False)
    return read_bare_table(path, Described("slider", STATE, ACTION, {"mass": 2.0}, **kwargs))


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_columns_are_found_by_name_and_episodes_keep_their_order(tmp_path, suffix):
    recording = read(tmp_path / f"log.{suffix}", table()[["force", "q_dot", "remark", "episode", "q", "t"]])
    assert [e.name for e in recording.episodes] == ["b", "a"]
    assert recording.dt == pytest.approx(0.1)
    assert (recording.system, recording.parameters) == ("slider", {"mass": 2.0})
    np.testing.assert_array_equal(recording.episodes[1].states, [[4, 1], [5, 1], [6, 1], [7, 1]])
    np.testing.assert_array_equal(recording.episodes[1].actions, [[5], [6], [7]])


def test_a_state_that_may_be_absent_may_be_there(tmp_path):
    frame = table()
    assert read(tmp_path / "a.csv", frame, optional=("q_dot",)).state.names == ("q", "q_dot")
    assert read(tmp_path / "b.csv", frame.drop(columns="q_dot"), optional=("q_dot",)).state.names == ("q",)
    with pytest.raises(UsageError, match=r"column\(s\) q_dot missing; slider needs t, q, q_dot, force"):
        read(tmp_path / "c.csv", frame.drop(columns="q_dot"))


@pytest.mark.parametrize(
    ("row", "column", "value", "message"),
    [
        (5, "q", np.nan, "episode a, row 5, channel q: nan is not finite"),
        (3, "q", np.inf, "episode b, row 3, channel q: inf is not finite"),
        (4, "force", np.nan, "episode a, row 4, channel force: nan is not finite"),
        (2, "t", 0.05, "episode b, row 2: t does not increase"),
        (2, "episode", None, "row 2: no episode"),
    ],
)
def test_a_fault_is_one_line_with_its_place(tmp_path, row, column, value, message):
    frame = table()
    frame.loc[row, column] = value
    with pytest.raises(UsageError, match=message) as caught:
        read(tmp_path / "log.csv", frame)
    assert "\n" not in str(caught.value)
    assert "log.csv" in str(caught.value)


def test_words_dates_single_rows_and_damaged_files_are_named(tmp_path):
    frame = table()
    with pytest.raises(UsageError, match="episode b: a value is not a number"):
        read(tmp_path / "a.csv", frame.assign(q="high"))
    with pytest.raises(UsageError, match=r"column\(s\) t hold dates"):
        read(tmp_path / "b.parquet", frame.assign(t=pd.to_datetime(frame["t"], unit="s")))
    with pytest.raises(UsageError, match="too short"):
        read(tmp_path / "c.csv", frame.iloc[:1])
    (tmp_path / "d.parquet").write_bytes(b"no table")
    with pytest.raises(UsageError, match="cannot be read"):
        read_bare_table(tmp_path / "d.parquet", Described("slider", STATE, ACTION, {}))


@pytest.fixture
def swing(tmp_path):
    def write(**columns):
        t = 0.02 * np.arange(50)
        table = pd.DataFrame({"t": t, "theta": np.cos(t), "theta_dot": -np.sin(t)} | columns)
        path = tmp_path / "swing.csv"
        table.drop(columns=[name for name, values in columns.items() if values is None]).to_csv(
            path, index=False
        )
        return path

    return write


def test_a_table_without_commands_is_read_and_imported(swing):
    recording, _ = open_recording(Task(swing(), "pendulum"))
    assert recording.action.names == ()
    imported, _, raw = read_logs([swing()], None, ["system=pendulum"])
    assert imported.action.names == ()
    assert raw["action"] == {}


@pytest.mark.parametrize("near", ["Torque", "torque_", "torqe"])
def test_a_slip_of_the_pen_is_no_missing_command(swing, near):
    with pytest.raises(UsageError, match=f"torque missing; '{near}' is similar"):
        open_recording(Task(swing(**{near: np.zeros(50)}), "pendulum"))
    with pytest.raises(UsageError, match="column\\(s\\) torque missing for pendulum"):
        read_logs([swing(**{near: np.zeros(50)})], None, ["system=pendulum"])
