"""Names are data: nothing that gpsim writes or keeps takes one for something else."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsim.channels import Channels, columns_beside
from gpsim.corrected import Feature, Features
from gpsim.errors import UsageError
from gpsim.files import write_json
from gpsim.gp import FitSettings, Predictor, fit_outputs
from gpsim.recordings import (
    Described,
    Episode,
    OverGaps,
    Recording,
    open_log,
    read_bare_table,
    read_recording,
    write_mcap,
    write_recording,
)
from gpsim.recordings.export import wide_table
from gpsim.reports.sheets import printable
from gpsim.residuals import Residuals, from_table, to_table
from gpsim.stages.policy_files import read_gp, write_gp

NAMES = st.lists(st.text(min_size=1, max_size=20), min_size=1, max_size=6, unique=True)


# Features on disk


@pytest.fixture(scope="module")
def predictor():
    rng = np.random.default_rng(0)
    settings = FitSettings(restarts=1, screening_iterations=2, max_iterations=5)
    return Predictor(fit_outputs(rng.normal(size=(12, 2)), rng.normal(size=(12, 1)), settings, rng))


def test_a_process_reads_the_inputs_that_it_was_fitted_to(predictor, tmp_path):
    channels = Channels.of({"x (m)": "m", "sign(x (m))": "1"})
    fitted = Features.of([Feature("x (m)"), Feature("x (m)", "sign")], channels)
    write_gp(tmp_path, predictor, fitted)
    _, read = read_gp(tmp_path, channels)
    assert read == fitted


def test_a_process_of_an_earlier_version_is_read(predictor, tmp_path):
    channels = Channels.of({"x": "m"})
    write_gp(tmp_path, predictor, Features.of(["x", "sign(x)"], channels))
    content = json.loads((tmp_path / "gp.json").read_text())
    assert content["inputs"] == ["x", "sign(x)"]
    del content["features"]
    write_json(tmp_path / "gp.json", content)
    assert read_gp(tmp_path, channels)[1].items == (Feature("x"), Feature("x", "sign"))


# Columns of tables


@given(names=NAMES, others=NAMES)
def test_columns_are_all_different_and_names_that_are_free_stay(names, others):
    columns = columns_beside(names, others, "input")
    assert len({*columns, *others}) == len(names) + len(others)
    assert all(column == name for column, name in zip(columns, names, strict=True) if name not in others)
    assert all(column.endswith(name) for column, name in zip(columns, names, strict=True))


def test_residuals_of_channels_that_are_called_as_other_columns():
    channels = Channels.of(dict.fromkeys(["test", "order", "episode", "measured.a_rate", "input.test"], "m"))
    rng = np.random.default_rng(0)
    written = Residuals(
        channels=channels,
        rate=Channels.of({"a_rate": "m/s"}),
        inputs=rng.normal(size=(4, 5)),
        measured=rng.normal(size=(4, 1)),
        simulated=rng.normal(size=(4, 1)),
        t=np.arange(4.0),
        episode=np.arange(4),
        test=np.array([True, False, True, False]),
        order=np.arange(4),
    )
    read = from_table(to_table(written), channels, written.rate)
    for name in ("inputs", "measured", "simulated", "t", "episode", "test", "order"):
        np.testing.assert_array_equal(getattr(read, name), getattr(written, name))


def test_commands_over_gaps_of_actions_that_are_called_as_other_columns():
    written = OverGaps(np.array([3, 5]), np.array([0.1, 0.2]), np.array([[1.0, 2.0], [3.0, 4.0]]))
    read = OverGaps.from_table(written.to_table(Channels.of({"after": "N", "t": "s"})))
    np.testing.assert_array_equal(read.actions, written.actions)
    np.testing.assert_array_equal(read.t, written.t)


# Recordings


def recorded(state, action, episodes=("a",)):
    rng = np.random.default_rng(0)
    made = tuple(
        Episode(name, 0.1 * np.arange(4), rng.normal(size=(4, len(state))), rng.normal(size=(3, len(action))))
        for name in episodes
    )
    units = Channels.of(dict.fromkeys(state, "m")), Channels.of(dict.fromkeys(action, "N"))
    return Recording("mine", *units, made, 0.1)


def test_an_export_keeps_channels_that_are_called_as_its_own_columns():
    recording = recorded(["time", "q", "simulated.q"], ["export.time"])
    states = recording.episodes[0].states
    table = wide_table(recording, {"simulated": [states + 1.0]})
    np.testing.assert_array_equal(table[["time", "q", "simulated.q"]], states)
    np.testing.assert_array_equal(table["export.time"][:3], recording.episodes[0].actions[:, 0])
    np.testing.assert_array_equal(table["export.simulated.q"], states[:, 1] + 1.0)
    np.testing.assert_allclose(table["export.export.time"], 0.1 * np.arange(4))


def test_an_export_of_odd_names_is_read_back(tmp_path):
    state = ["x (m)", "$v$ & <b>", "a/b", "x", "y", "yaw", "pose", "=1+1"]
    recording = recorded(state, ["F, 'N' \"q\""])
    write_mcap(recording, {}, tmp_path / "out.mcap")
    topics = [topic.name for topic in open_log(tmp_path / "out.mcap").topics()]
    assert sorted(topics) == sorted([*(f"/measured/{name}" for name in state), "/command/F, 'N' \"q\""])


MINE = Described("mine", Channels.of({"x": "m"}), Channels.of({"u": "N"}), {})


def test_episodes_may_be_called_what_a_table_calls_nothing(tmp_path):
    names = ("NA", "007", "null", "nan", "1e3", " a", "None")
    write_recording(recorded(["x"], ["u"], names), tmp_path, "csv")
    assert tuple(e.name for e in read_recording(tmp_path).episodes) == names
    bare = read_bare_table(tmp_path / "recording.csv", MINE)
    assert tuple(e.name for e in bare.episodes) == names


@pytest.mark.parametrize(
    "read",
    [
        lambda table: read_recording(table.parent),
        lambda table: read_bare_table(table, MINE),
    ],
    ids=["recording", "bare"],
)
def test_an_episode_without_a_name_is_refused(tmp_path, read):
    write_recording(recorded(["x"], ["u"], ("NA", "b")), tmp_path, "csv")
    table = tmp_path / "recording.csv"
    table.write_text(table.read_text().replace("\nb,", "\n,"))
    with pytest.raises(UsageError, match="row 4: no episode"):
        read(table)


def test_a_quoted_header_may_hold_the_separator(tmp_path):
    names = ["t", "x, y (m)", 'say "q"', "F; N"]
    frame = pd.DataFrame(np.arange(20.0).reshape(5, 4), columns=names)
    frame.to_csv(tmp_path / "log.csv", index=False)
    (topic,) = open_log(tmp_path / "log.csv").topics()
    assert list(topic.fields) == names


# Gates, places and what a report says


# The terminal


@given(text=st.text())
def test_what_is_printed_holds_no_control_characters(text):
    said = printable(text)
    said.encode()
    assert not set(said) & ({chr(i) for i in (*range(32), *range(127, 160), 0x202E)} - {"\n", "\t"})
    assert printable(said) == said
