"""What an empty cell takes with it: its own channel's row, and no other channel's."""

import numpy as np
import pandas as pd
import pytest

from gpsim.reports.import_text import as_text
from gpsim.stages.import_log import read_logs

T = np.round(0.01 * np.arange(200), 9)
WORDS = ["system=slider"]


def frame():
    return pd.DataFrame({"t": T, "q": np.sin(T), "q_dot": np.cos(T), "force": np.arange(200.0)})


def read(path, table, *words):
    table.to_csv(path, index=False)
    recording, report, _ = read_logs([path], None, [*WORDS, *words])
    for count in report.topics:
        assert count.read == count.kept + sum(count.dropped.values())
    return recording, report


def test_an_empty_state_leaves_the_command_of_its_row(tmp_path):
    table = frame()
    table.loc[50, ["q", "q_dot"]] = np.nan
    recording, report = read(tmp_path / "log.csv", table, "rate=100")
    (episode,) = recording.episodes
    assert np.array_equal(episode.actions[:, 0], np.arange(199.0))
    assert episode.states[:, 0] == pytest.approx(np.sin(T), abs=1e-4)
    found = {count.name: dict(count.dropped) for count in report.topics}
    assert found == {"log (state)": {"value missing": 1}, "log (action)": {}}


def test_an_empty_command_leaves_the_state_of_its_row_and_the_last_one_holds(tmp_path):
    table = frame()
    table.loc[50, "force"] = np.nan
    (episode,) = read(tmp_path / "log.csv", table)[0].episodes
    assert np.array_equal(episode.states[:, 0], np.sin(T))
    assert episode.actions[49:52, 0].tolist() == [49.0, 49.0, 51.0]


def test_a_table_merged_from_two_rates_holds_both(tmp_path):
    poses = pd.DataFrame({"t": np.round(0.003 + 0.02 * np.arange(100), 9)})
    poses = poses.assign(q=np.sin(poses["t"]), q_dot=np.cos(poses["t"]))
    commands = pd.DataFrame({"t": T, "force": np.arange(200.0)})
    recording, report = read(tmp_path / "log.csv", poses.merge(commands, how="outer", on="t"))
    (episode,) = recording.episodes
    assert episode.states[:, 0] == pytest.approx(np.sin(0.003 + 0.02 * np.arange(100)))
    assert np.array_equal(episode.actions[:, 0], 2.0 * np.arange(99))  # the one standing at t_k
    assert not report.warnings


@pytest.mark.parametrize("session", [False, True])
def test_the_last_row_of_an_episode_needs_no_command(tmp_path, session):
    one = frame()
    one.loc[199, "force"] = np.nan
    both = pd.concat([one.assign(episode=0), one.assign(episode=1, t=one["t"] + (5.0 if session else 0.0))])
    recording, report = read(tmp_path / "log.csv", both)
    assert [len(episode) for episode in recording.episodes] == [199, 199]
    for episode in recording.episodes:
        assert np.array_equal(episode.states[:, 0], np.sin(T))
        assert np.array_equal(episode.actions[:, 0], np.arange(199.0))
    assert sum(c.kept for c in report.topics if "state" in c.part) == 400


def test_the_parts_of_many_tables_are_added_up(tmp_path):
    for number in range(3):
        table = frame()
        table.loc[199, "force"] = np.nan
        table.to_csv(tmp_path / f"run{number}.csv", index=False)
    _, report, _ = read_logs([tmp_path], None, WORDS)
    assert [(c.name, c.read) for c in report.summed()] == [
        ("the table of each of 3 logs (action)", 600),
        ("the table of each of 3 logs (state)", 600),
    ]
    assert "(action)" in as_text(report)


@pytest.mark.parametrize("table", ["csv", "parquet", "category"])
def test_an_episode_column_may_hold_words(tmp_path, table):
    whole = pd.concat([frame().assign(episode=name) for name in ("up", "down", "up again")])
    # on one clock, so that nothing but the column tells the episodes apart
    whole["t"] = np.round(0.01 * np.arange(600), 9)
    path = tmp_path / ("log.csv" if table == "csv" else "log.parquet")
    if table == "csv":
        whole.to_csv(path, index=False)
    else:
        kind = "category" if table == "category" else str
        whole.astype({"episode": kind}).to_parquet(path, index=False)
    recording, _, _ = read_logs([path], None, WORDS)
    assert [len(episode) for episode in recording.episodes] == [199, 199, 199]
