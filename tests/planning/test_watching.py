"""A slider whose friction grows, or whose sensors get loose, is found soon; one that stays as it was, never."""

import pytest
from made_posteriors import driven, made_plant, made_posterior

from gpsim.planning import Account, Monitor, WatchSettings, looked_at

LATE = 120.0  # s, when something changes


@pytest.fixture(scope="module")
def account():
    posterior = made_posterior({}, relative=0.005)
    return Account(made_plant(posterior), posterior)


def alarmed(account, recording):
    """(s after the change at which it is found, alarms); no alarms where nothing is."""
    monitor = Monitor(account, WatchSettings(stretch=30.0))
    for stretch in looked_at(account, recording, 30.0):
        if alarms := monitor.see("log", stretch):
            return stretch.end - LATE, alarms
    return None, []


def test_friction_that_grows_by_15_percent_is_found_within_three_minutes(account):
    after, alarms = alarmed(account, driven(5.5, damping=lambda t: 0.92 if t > LATE else 0.8))
    assert after is not None
    assert 0.0 < after <= 180.0
    (alarm,) = alarms
    assert alarm.what == "viscous_friction on q: damping"
    assert alarm.now == pytest.approx(0.92, rel=0.05)
    assert LATE - 30.0 <= alarm.since[1] <= LATE + 90.0


def test_a_sensor_that_gets_loose_is_found_and_is_no_parameter_of_the_account(account):
    after, alarms = alarmed(account, driven(4.0, louder=lambda t: 2.5 if t > LATE else 1.0))
    assert after is not None
    assert after <= 120.0
    assert {alarm.what for alarm in alarms} <= {"what is left in q", "what is left in q_dot"}


@pytest.mark.parametrize("seed", [1, 2])
def test_nothing_is_found_where_nothing_changes(account, seed):
    assert alarmed(account, driven(4.0, seed=seed)) == (None, [])


def test_a_stretch_that_was_seen_is_passed_over_and_sums_go_on(account):
    recording = driven(2.0)
    whole = list(looked_at(account, recording, 30.0))
    assert [s.begin for s in looked_at(account, recording, 30.0, after=60.0)] == [s.begin for s in whole[2:]]
    assert all(s.share > 0.95 for s in whole)
    one = Monitor(account, WatchSettings(threshold=1e9))
    for stretch in whole:
        one.see("log", stretch)
    other = Monitor(account, WatchSettings())
    other.resume(one.state)
    assert other.state == one.state
