import re
from dataclasses import replace

import numpy as np
import pytest
from by_hand import UNICYCLE, Drive, HandLog, imported, pose_series, series
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsim.errors import UsageError
from gpsim.recordings import Episode, HeldOut, NamedLog, import_logs, parse_mapping
from gpsim.recordings.episodes import hold_out
from gpsim.recordings.mapping import HeldOutRule
from gpsim.reports.import_text import as_text

DRIVE = Drive()
T = np.arange(0, 10, 0.01)
COMMANDS = np.arange(0, 10, 0.1)
SLIDER = {
    "system": "slider",
    "rate": 50,
    "time": {"field": "t"},
    "state": {"q": {"field": "q", "unit": "m"}},
    "action": {"force": {"field": "u", "unit": "N"}},
}


def commands(t=COMMANDS, v=None):
    v = np.arange(len(t), dtype=float) if v is None else v
    return series("/cmd", t, v=v, w=-v)


def adds_up(report):
    for count in report.topics:
        assert count.read == count.kept + sum(count.dropped.values())
    return {count.topic: count for count in report.topics}


def test_poses_and_commands_land_on_one_grid():
    recording, report = imported({"/pose": DRIVE.pose(T), "/cmd": commands()}, UNICYCLE)
    (episode,) = recording.episodes
    assert np.allclose(np.diff(episode.t), 0.05)
    assert episode.states[:, 0] == pytest.approx(DRIVE.x(episode.t), abs=1e-12)
    assert (episode.states[:, 2] >= -np.pi).all()
    assert (episode.states[:, 2] < np.pi).all()
    error = episode.states[:, 2] - DRIVE.w * episode.t
    assert np.abs((error + np.pi) % (2 * np.pi) - np.pi).max() < 1e-9
    # the action of row k is what was commanded from t_k to t_k+1: command j was given at 0.1 j
    assert np.array_equal(episode.actions[:, 0], np.floor(episode.t[:-1] / 0.1 + 1e-6))
    assert adds_up(report)["/pose"].kept == 996  # up to the last whole step, 9.95 s
    assert recording.velocities is None
    assert recording.clock == "session"


def test_interpolation_between_stamps_is_within_the_second_order_error():
    t = np.sort(np.random.default_rng(0).uniform(0, 10, 900))
    recording, _ = imported({"/pose": DRIVE.pose(t), "/cmd": commands()}, UNICYCLE, rate=73)
    (episode,) = recording.episodes
    shift = float(t[t >= 0][0])  # the episode's clock starts at the first pose after the first command
    bound = DRIVE.v * DRIVE.w * np.diff(t).max() ** 2 / 8
    assert np.abs(episode.states[:, 0] - DRIVE.x(episode.t + shift)).max() <= bound * 1.01


def test_a_gap_ends_an_episode_and_is_not_bridged():
    keep = (T < 3.0) | (T > 4.0)
    recording, report = imported({"/pose": DRIVE.pose(T[keep]), "/cmd": commands()}, UNICYCLE)
    first, second = recording.episodes
    assert first.t[-1] <= 2.99 + 1e-9
    assert second.t[0] >= 4.0
    counts = adds_up(report)
    assert counts["/cmd"].dropped == {"in a gap over 0.3 s": 10}
    assert "2 episode(s)" in as_text(report)


def test_a_flag_ends_and_begins_episodes():
    flag = series("/safe", np.arange(0, 10, 0.5), on=(np.arange(0, 10, 0.5) % 5 >= 1.0).astype(float))
    rule = {"by": "flag", "topic": "/safe", "field": "on", "equals": 1}
    recording, report = imported(
        {"/pose": DRIVE.pose(T), "/cmd": commands(), "/safe": flag}, UNICYCLE, episodes=rule
    )
    starts = [float(episode.t[0]) for episode in recording.episodes]
    assert np.diff(starts) == pytest.approx([5.0])
    assert recording.episodes[0].t[-1] - recording.episodes[0].t[0] == pytest.approx(4.0)
    adds_up(report)


def test_header_or_receive_is_chosen_per_topic_and_said():
    late = T + 0.03
    pose = DRIVE.pose(T, receive=late)
    by_header, report = imported({"/pose": pose, "/cmd": commands()}, UNICYCLE)
    by_receive, _ = imported(
        {"/pose": pose, "/cmd": commands()}, UNICYCLE, clock={"topics": {"/pose": "receive"}}
    )
    assert adds_up(report)["/pose"].clock == "header"
    assert adds_up(report)["/pose"].delay == pytest.approx((0.03, 0.03, 0.03))
    # the same poses sit 30 ms later on the receive clock, so the commands are 30 ms further on
    assert by_header.episodes[0].states[0, 0] == pytest.approx(DRIVE.x(np.zeros(1))[0])
    assert by_receive.episodes[0].states[0, 0] == pytest.approx(DRIVE.x(np.zeros(1))[0])
    k = np.arange(190)
    assert np.array_equal(by_receive.episodes[0].actions[k, 0], np.floor((0.05 * k + 0.03) / 0.1 + 1e-6))
    assert np.array_equal(by_header.episodes[0].actions[k, 0], np.floor(0.05 * k / 0.1 + 1e-6))
    assert "mixed" in as_text(report)


@pytest.mark.parametrize(
    ("late", "figures"),
    [
        (np.where(T < 6.0, 0.004, 5.004), "4 to 5004 ms"),  # the receiver's clock is set right
        (0.004 + 0.02 * T, r"[4-9](\.\d+)? to (19|20)\d(\.\d+)? ms"),  # it runs at another pace
    ],
)
def test_mixed_clocks_that_move_against_each_other_are_told(late, figures):
    _, report = imported({"/pose": DRIVE.pose(T, receive=T + late), "/cmd": commands()}, UNICYCLE)
    (line,) = [line for line in report.warnings if "drift apart" in line]
    assert re.search(f"/pose is received {figures} after its stamp", line)
    _, alone = imported(
        {"/pose": DRIVE.pose(T, receive=T + late), "/cmd": replace(commands(), header=COMMANDS)}, UNICYCLE
    )
    assert not [line for line in alone.warnings if "drift apart" in line]


def lagging(delay):
    rng = np.random.default_rng(5)
    t, given = np.arange(0, 60, 0.01), np.arange(0, 60, 0.1)
    v, w = np.repeat(rng.uniform(0.2, 1.0, 60), 10), np.repeat(rng.uniform(-1.0, 1.0, 60), 10)
    fine = np.arange(0, 60, 0.001)
    at = np.clip(np.searchsorted(given, fine - delay + 1e-9, side="right") - 1, 0, None)
    yaw = np.cumsum(w[at]) * 0.001
    x, y = np.cumsum(v[at] * np.cos(yaw)) * 0.001, np.cumsum(v[at] * np.sin(yaw)) * 0.001
    pose = pose_series(t, x[::10], y[::10], yaw[::10], receive=t)
    return {"/pose": pose, "/cmd": series("/cmd", given, v=v, w=w)}


def test_the_offset_between_topics_is_shown_and_applied_only_when_asked():
    contents = lagging(0.12)
    shown, report = imported(contents, UNICYCLE)
    lags = {lag.command: lag for lag in report.lags}
    assert lags["v_cmd"].response == "forward speed"
    assert lags["w_cmd"].response == "rate of yaw"
    assert lags["w_cmd"].lag == pytest.approx(0.12, abs=0.01)
    assert not report.applied
    asked, applied = imported(contents, UNICYCLE, clock={"apply_offset": True})
    assert applied.applied["/cmd"] == pytest.approx(0.12, abs=0.01)
    number, applied = imported(contents, UNICYCLE, clock={"apply_offset": 0.12})
    assert applied.applied == {"/cmd": 0.12}

    def turning_error(recording):
        moves = recording.transitions()
        turned = np.diff(np.unwrap(np.append(moves.states[:, 2], moves.next_states[-1, 2])))
        return float(np.sqrt(np.mean((turned / moves.dt - moves.actions[:, 1]) ** 2)))

    assert turning_error(shown) > 0.1
    assert turning_error(number) < 0.3 * turning_error(shown)
    assert turning_error(asked) < 0.3 * turning_error(shown)


def test_a_long_silence_of_commands_is_held_unless_limited():
    sparse = commands(np.array([0.0, 4.0, 9.0]))
    held, report = imported({"/pose": DRIVE.pose(T), "/cmd": sparse}, UNICYCLE)
    assert len(held.episodes) == 1
    assert any("5 s" in note for note in report.notes)
    cut, report = imported({"/pose": DRIVE.pose(T), "/cmd": sparse}, UNICYCLE, hold_limit=1.0)
    assert [e.t[-1] - e.t[0] for e in cut.episodes] == pytest.approx([1.0, 1.0, 0.95])
    adds_up(report)


def test_velocities_are_differentiated_and_edges_trimmed():
    mapping = {**SLIDER, "state": {**SLIDER["state"], "q_dot": {"derivative_of": "q", "unit": "m/s"}}}
    t = np.arange(0, 5, 0.01)
    table = series("table", np.full(len(t), np.nan), t=t, q=np.sin(3 * t), u=np.cos(t))
    recording, report = imported({"table": table}, mapping)
    (episode,) = recording.episodes
    start = report.episodes[0].start
    assert recording.velocities == "differentiated"
    assert "sigma = 2" in str(recording.provenance["mapping"]["velocities"])
    assert start == pytest.approx(0.09)  # nine samples at either end
    assert episode.states[:, 1] == pytest.approx(3 * np.cos(3 * (episode.t + start)), abs=1e-2)
    assert adds_up(report)["table"].dropped["at an edge without a full smoothing window"] == 18
    local, _ = imported({"table": table}, mapping, velocities={"edges": "local"})
    assert local.transition_count > recording.transition_count


def test_a_table_whose_clock_starts_anew_becomes_several_parts():
    t = np.concatenate([np.arange(0, 3, 0.05), np.arange(0, 4, 0.05)])
    table = series("table", np.full(len(t), np.nan), t=t, q=t)
    recording, report = imported({"table": table}, SLIDER, rate="source", action={})
    assert [len(e) for e in recording.episodes] == [59, 79]
    assert sum(c.read for c in report.topics) == len(t)


def test_messages_that_a_log_holds_twice_are_duplicates_and_no_restart():
    again = np.concatenate([T, T[200:600]])
    pose = pose_series(again, DRIVE.x(again), DRIVE.y(again), DRIVE.w * again, receive=again)
    pose = replace(
        pose, fields={name: np.concatenate([v[: len(T)], v[200:600]]) for name, v in pose.fields.items()}
    )
    recording, report = imported({"/pose": pose, "/cmd": commands()}, UNICYCLE)
    assert len(recording.episodes) == 1
    assert adds_up(report)["/pose"].dropped["duplicate"] == 400


def test_several_logs_become_episodes_and_the_last_share_is_held_out():
    logs = [
        NamedLog(f"log{i}", HandLog({"/pose": DRIVE.pose(T + 100 * i), "/cmd": commands(COMMANDS + 100 * i)}))
        for i in range(10)
    ]
    recording, report = import_logs(logs, parse_mapping(UNICYCLE), lambda n, s, m: {})
    assert [e.name for e in recording.episodes] == [str(i) for i in range(10)]
    assert recording.clock == "episode"
    assert recording.held_out is not None
    assert recording.held_out.episodes_from == 8
    assert report.episodes[3].source == "log3"
    session, _ = import_logs(
        logs, parse_mapping({**UNICYCLE, "clock": {"kind": "session"}}), lambda n, s, m: {}
    )
    assert session.episodes[3].t[0] == pytest.approx(300.0)


@pytest.mark.parametrize(
    ("lengths", "first"),
    [
        ([10] * 7, 6),
        ([10] * 8, 6),
        ([115, 7, 5, 127, 56, 35, 22], 5),
        ([5] * 5 + [90], 5),
        ([60, 3, 35, 195], 3),
    ],
)
def test_the_last_episodes_that_hold_a_share_of_the_time_are_held_out(lengths, first):
    """Seven drives of which the last is short: a fifth of the time is what is kept, not a fifth of the drives."""
    drives = [Episode("", np.arange(n + 1.0), np.zeros((n + 1, 1)), np.zeros((n, 1))) for n in lengths]
    assert hold_out(drives, HeldOutRule(), session=False) == HeldOut(episodes_from=first)


@pytest.mark.parametrize(
    ("contents", "text"),
    [
        ({"/pose": DRIVE.pose(T)}, "no topic '/cmd'; there are: /pose"),
        ({"/pose": DRIVE.pose(T), "/cmd": commands(COMMANDS + 100)}, "no episode is left"),
        ({"/pose": DRIVE.pose(T[:0]), "/cmd": commands()}, "no episode is left"),
    ],
)
def test_what_cannot_be_imported_ends_in_one_line(contents, text):
    with pytest.raises(UsageError, match=text) as caught:
        imported(contents, UNICYCLE)
    assert "\n" not in str(caught.value)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_whatever_the_clock_does_the_numbers_add_up(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(50, 400))
    t = np.cumsum(rng.exponential(0.02, count))
    t[rng.random(count) < 0.02] += 500.0
    rows = np.sort(rng.choice(count, size=count))  # duplicates and gaps
    t = t[rows] + rng.normal(scale=0.005, size=count)
    c = np.sort(rng.uniform(0, t.max(), 20))
    contents = {"/pose": pose_series(t, DRIVE.x(t), DRIVE.y(t), DRIVE.w * t, receive=t), "/cmd": commands(c)}
    try:
        recording, report = imported(contents, UNICYCLE, rate=float(rng.uniform(5, 200)))
    except UsageError:  # nothing left to import, said in one line
        return
    adds_up(report)
    for episode in recording.episodes:
        assert np.isfinite(episode.states).all()
        assert (np.diff(episode.t) > 0).all()


def test_settings_of_the_clock_that_would_do_nothing_are_refused():
    t = np.arange(0, 5, 0.01)
    table = {"table": series("table", np.full(len(t), np.nan), t=t, q=np.sin(3 * t), u=np.cos(t))}
    with pytest.raises(UsageError, match="share their rows"):
        imported(table, SLIDER, clock={"apply_offset": 0.1})
    with pytest.raises(UsageError, match="clock.offsets: no topic 'tabel' is read; there are: table"):
        imported(table, SLIDER, clock={"offsets": {"tabel": 0.1}})


def test_short_episodes_whose_clock_begins_anew_stay_what_they_are():
    """Nine rows each, as a bad policy leaves them: too few to tell by the clock alone that it was set back."""
    rng = np.random.default_rng(0)
    t = np.concatenate([0.02 * np.arange(9) + 1e-4 * rng.uniform(size=9) for _ in range(30)])
    number = np.repeat(np.arange(30.0), 9)
    q = 10.0 * number + t
    table = series("table", np.full(len(t), np.nan), t=t, q=q, u=np.cos(q), trial=number)
    recording, _ = imported({"table": table}, SLIDER, episodes={"by": "column", "field": "trial"})
    assert len(recording.episodes) == 30
    for i, episode in enumerate(recording.episodes):
        assert episode.states[:, 0] == pytest.approx(10.0 * i + episode.t, abs=1e-3)


def test_unset_header_stamps_fall_back_to_receive_time_and_forced_ones_are_refused():
    pose = pose_series(T * 0.0, DRIVE.x(T), DRIVE.y(T), DRIVE.w * T, receive=T)
    _, report = imported({"/pose": pose, "/cmd": commands()}, UNICYCLE)
    assert adds_up(report)["/pose"].clock == "receive (header never set)"
    with pytest.raises(UsageError, match="never sets its header stamp"):
        imported({"/pose": pose, "/cmd": commands()}, UNICYCLE, clock={"stamps": "header"})


def test_a_clock_set_back_is_refused_where_several_topics_share_it():
    t = np.concatenate([T, T[200:600] + 0.003])
    pose = pose_series(t, DRIVE.x(t), DRIVE.y(t), DRIVE.w * t, receive=t)
    with pytest.raises(UsageError, match="the clock of /pose was set back at row 1000"):
        imported({"/pose": pose, "/cmd": commands()}, UNICYCLE)
