"""Logs and mappings that ask for the impossible: one line that says what, where and what to do, and nothing made."""

import numpy as np
import pandas as pd
import pytest

from gpsim.channels import Channels
from gpsim.errors import UsageError
from gpsim.recordings import Described, read_bare_table, read_recording
from gpsim.recordings.guessing import likely_unit
from gpsim.stages.import_log import import_log, read_logs

WORDS = ["system=cartpole"]
SLIDER = Channels.of({"q": "m", "q_dot": "m/s"}), Channels.of({"force": "N"})


def refused(call, *arguments, **options):
    with pytest.raises(UsageError) as caught:
        call(*arguments, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("word", ["rate=1e12", "dt=1e-9", "rate=1e25"])
def test_more_samples_than_a_computer_holds_are_refused_before_they_are_made(cartpole_log, tmp_path, word):
    said = refused(import_log, [cartpole_log], tmp_path / "out", None, [*WORDS, word])
    assert "log.csv: rate 1e+" in said
    assert "makes over 2e+07 samples" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("count", "start", "unit"),
    [
        (1e3, 0.0, "milliseconds"),
        (1e6, 0.0, "microseconds"),
        (1e9, 0.0, "nanoseconds"),
        (1e9, 1.7e9, "nanoseconds"),
    ],
)
def test_times_that_are_no_seconds_are_told_apart_and_never_rescaled(cartpole_log, count, start, unit):
    frame = pd.read_csv(cartpole_log)
    frame.assign(t=count * (frame["t"] + start)).to_csv(cartpole_log, index=False)
    said = refused(read_logs, [cartpole_log], None, WORDS)
    assert f"the time column 't' looks like {unit}" in said
    word = f"time.scale={1 / count:.0e}"
    assert word in said
    recording, _, _ = read_logs([cartpole_log], None, [*WORDS, word])
    assert recording.dt == pytest.approx(0.02, rel=1e-4)
    said = refused(read_bare_table, cartpole_log, Described("cartpole", *cartpole_channels(), {}))
    assert f"t looks like {unit}" in said
    assert f"divide the column by {count:.0f}" in said


def cartpole_channels():
    state = Channels.of({"x": "m", "x_dot": "m/s", "theta": "rad", "theta_dot": "rad/s"}, ["theta"])
    return state, Channels.of({"force": "N"})


def test_seconds_stay_seconds(tmp_path):
    """A tank that is looked at every 4 s, and a log on the clock of today."""
    t = np.arange(50.0)
    for seconds in (4.0 * t, 60.0 * t, 1.7e9 + 4.0 * t):
        pd.DataFrame({"t": seconds, "level": t, "pump": t}).to_csv(tmp_path / "a.csv", index=False)
        channels = Channels.of({"level": "V"}), Channels.of({"pump": "V"})
        assert (
            read_bare_table(tmp_path / "a.csv", Described("tanks", *channels, {})).dt == np.diff(seconds)[0]
        )
    assert likely_unit(0.02 * t, 0.02) is None
    assert likely_unit(1.7e9 + 0.02 * t, 0.02) is None


def test_a_table_whose_time_goes_back_is_refused_with_its_row(cartpole_log):
    frame = pd.read_csv(cartpole_log)
    swapped = frame.iloc[[*range(100), 101, 100, *range(102, 200)]]
    swapped.to_csv(cartpole_log, index=False)
    said = refused(read_logs, [cartpole_log], None, WORDS)
    assert "row 101: time goes back, to 2 s behind 2.02 s (1 such rows)" in said
    _, report, _ = read_logs([cartpole_log], None, WORDS, salvage=True)
    assert dict(report.topics[0].dropped) == {"time goes back": 1}
    frame.iloc[::-1].to_csv(cartpole_log, index=False)
    assert "row 1: time goes back, to 3.96 s behind 3.98 s" in refused(read_logs, [cartpole_log], None, WORDS)


def recording_folder(folder, table, state="{q: m}"):
    folder.mkdir()
    (folder / "recording.yaml").write_text(f"system: slider\ndt: 0.1\nstate: {state}\naction: {{force: N}}\n")
    (folder / "recording.csv").write_text(table)
    return folder


def test_a_recording_is_read_as_strictly(tmp_path):
    rows = "0,0.0,1,2\n0,0.1,1,2\n0,0.2,1,\n"
    assert (
        len(read_recording(recording_folder(tmp_path / "a", f"episode,t,q,force\n{rows}")).episodes[0]) == 2
    )
    said = refused(read_recording, recording_folder(tmp_path / "b", f"episode,t,q,q\n{rows}"))
    assert "several columns are called 'q'" in said
    huge = rows.replace("0.1,1,2", "0.1,1e308,2")
    said = refused(read_recording, recording_folder(tmp_path / "c", f"episode,t,q,force\n{huge}"))
    assert "episode 0, row 1, column q: 1e+308 is not a valid measurement" in said
    said = refused(read_recording, recording_folder(tmp_path / "d", f"episode,t,q,force\n{rows}", "{t: m}"))
    assert "a channel must not be called 't'" in said
    two = rows.replace("0,0", '"a\nb",0')
    said = refused(read_recording, recording_folder(tmp_path / "e", f"episode,t,q,force\n{two}"))
    assert r"the name 'a b' holds a line break or control character ('\n')" in said


def test_a_file_whose_name_would_break_the_line_is_refused(cartpole_log, tmp_path):
    strange = tmp_path / "a\nb.csv"
    cartpole_log.rename(strange)
    assert "the name 'a b.csv' holds a line break" in refused(read_logs, [strange], None, WORDS)
    assert "the name 'a b.csv' holds a line break" in refused(read_logs, [tmp_path], None, WORDS)
    assert "File name too long" in refused(read_logs, [tmp_path / ("x" * 300)], None, WORDS)
    assert "no such file or built-in mapping" in refused(read_logs, [tmp_path], "x" * 300, WORDS)


def test_a_channel_that_its_scale_makes_absurd_is_refused(cartpole_log):
    said = refused(read_logs, [cartpole_log], None, [*WORDS, "state.x.scale=1e25", "state.x.offset=1e30"])
    assert "channel x reaches 1.00001e+30 m" in said


def test_a_table_in_seconds_with_slow_rows_is_told_of_the_gap_limit(cartpole_log):
    frame = pd.read_csv(cartpole_log)
    frame.assign(t=frame["t"] * 200).to_csv(cartpole_log, index=False)
    assert "gap_limit above 4" in refused(read_logs, [cartpole_log], None, WORDS)
