"""Logs in which nobody commands anything, or a channel is not there: read as they are, but not past a slip of the pen."""

import numpy as np
import pandas as pd
import pytest

from gpsim.errors import UsageError
from gpsim.simulators import make_simulator
from gpsim.stages.diagnose import Task, open_recording
from gpsim.stages.import_log import read_logs


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


def test_a_table_may_lack_a_state_of_a_built_in_simulator(swing):
    recording, simulator = open_recording(Task(swing(theta_dot=None), "pendulum"))
    assert recording.state.names == ("theta",)
    assert simulator.state == make_simulator("pendulum").state


@pytest.mark.parametrize("near", ["Torque", "torque_", "torqe"])
def test_a_slip_of_the_pen_is_no_missing_command(swing, near):
    with pytest.raises(UsageError, match=f"torque missing; '{near}' is like it"):
        open_recording(Task(swing(**{near: np.zeros(50)}), "pendulum"))
    with pytest.raises(UsageError, match="column\\(s\\) torque missing for pendulum"):
        read_logs([swing(**{near: np.zeros(50)})], None, ["system=pendulum"])


def test_a_table_without_any_state_is_refused(swing):
    with pytest.raises(UsageError, match="column\\(s\\) theta, theta_dot missing"):
        open_recording(Task(swing(theta=None, theta_dot=None), "pendulum"))
