from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bags import drive, write_bag

from gpsim.recordings.inspection import statistics
from gpsim.recordings.raw import Series
from gpsim.recordings.readers import open_log
from gpsim.recordings.soundness import Limits, find_silent_damage

POSE = [f"pose.{part}" for part in ("position.x", "position.y", *(f"orientation.{axis}" for axis in "xyzw"))]


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Series:
    path = write_bag(tmp_path_factory.mktemp("sound") / "drive.bag", "ros1", drive(4.0))
    return open_log(path).series({"/pose": POSE})["/pose"]


def changed(series: Series, field: str, row: int, value: float) -> Series:
    values = series.fields[field].copy()
    values[row] = value
    return replace(series, fields={**series.fields, field: values})


def test_sound_logs_have_no_findings(tmp_path: Path) -> None:
    log = open_log(write_bag(tmp_path / "drive.bag", "ros1", drive(4.0)))
    for series in log.series({t.name: t.fields for t in log.topics()}).values():
        assert find_silent_damage(series) == ()


@pytest.mark.parametrize(
    ("field", "value", "kind"),
    [
        ("pose.position.x", np.nan, "not finite"),
        ("pose.position.x", np.inf, "not finite"),
        ("pose.position.y", 1e200, "absurd magnitude"),
        ("pose.position.y", 1e-300, "absurd magnitude"),
        ("pose.position.y", 40.0, "jump"),
        ("pose.orientation.w", 0.2, "no rotation"),
    ],
)
def test_one_wrong_value_is_found_where_it_is(sound: Series, field: str, value: float, kind: str) -> None:
    found = [f for f in find_silent_damage(changed(sound, field, 77, value)) if f.kind == kind]
    assert [f.rows.tolist() for f in found] == [[77]]
    assert "row 77" in found[0].message


def test_stamps_that_cannot_be_true_are_found(sound: Series) -> None:
    receive, header = sound.receive.copy(), sound.header
    assert header is not None
    receive[50] += 1e6
    kinds = {f.kind: f.rows.tolist() for f in find_silent_damage(replace(sound, receive=receive))}
    assert kinds == {"stamp leaps": [50], "stamp far from arrival": [50]}
    header = header.copy()
    header[30] -= 5e8
    kinds = {f.kind: f.rows.tolist() for f in find_silent_damage(replace(sound, header=header))}
    assert kinds == {"stamp leaps": [30], "stamp far from arrival": [30]}


def test_absent_elements_are_no_damage(tmp_path: Path) -> None:
    series = open_log(write_bag(tmp_path / "drive.bag", "ros1", drive(1.0))).series({"/sensors": ["data.2"]})[
        "/sensors"
    ]
    assert np.isnan(series.fields["data.2"]).any()
    assert find_silent_damage(series) == ()


def test_flipped_exponents_in_the_file_are_found(tmp_path: Path) -> None:
    """Bytes that decode to another number: of the flips in the top byte of a coordinate nearly all are seen."""
    path = write_bag(tmp_path / "drive.bag", "ros1", {"/pose": drive(4.0)["/pose"]}, chunk=1 << 20)
    whole = path.read_bytes()
    truth = open_log(path).series({"/pose": POSE})["/pose"]
    seen = 0
    for row in range(20, 180, 4):
        value = truth.fields["pose.position.y"][row]
        spot = whole.index(np.float64(value).tobytes()) + 7
        path.write_bytes(whole[:spot] + bytes([whole[spot] ^ (1 << row // 4 % 7)]) + whole[spot + 1 :])
        series = open_log(path).series({"/pose": POSE})["/pose"]
        assert series.fields["pose.position.y"][row] != value
        seen += any(row in f.rows for f in find_silent_damage(series))
    assert seen >= 36  # of 40


def test_statistics_tell_rate_gaps_and_disorder() -> None:
    times = np.arange(100) * 0.01
    times = np.concatenate([times, times + 1.5])
    times[10] = times[9]
    times[20], times[21] = times[21], times[20]
    found = statistics(times)
    assert found.rate == pytest.approx(100.0)
    assert (found.duplicates, found.backwards) == (1, 1)
    assert found.gaps[0] == pytest.approx((0.99, 0.51))
    assert len(found.gaps) == 1
    assert statistics(np.empty(0)).rate is None
    assert statistics(np.full(3, np.nan)).start is None


def test_a_rotation_that_alternates_its_sign_is_sound(sound: Series) -> None:
    """A driver that keeps w positive flips all parts where the yaw passes half a turn, back and forth under noise."""
    rng = np.random.default_rng(0)
    yaw = np.linspace(0.0, 20.0, len(sound.receive)) + 0.004 * rng.normal(size=len(sound.receive))
    w, z = np.cos(yaw / 2), np.sin(yaw / 2)
    sign = np.where(w < 0, -1.0, 1.0)
    parts = {"x": 0 * w, "y": 0 * w, "z": sign * z, "w": sign * w}
    fields = {f"pose.orientation.{axis}": values for axis, values in parts.items()}
    assert find_silent_damage(replace(sound, fields={**sound.fields, **fields})) == ()


def test_an_angle_that_wraps_under_noise_is_sound(sound: Series) -> None:
    rng = np.random.default_rng(1)
    angle = np.linspace(0.0, 12.0, len(sound.receive)) + 0.05 * rng.normal(size=len(sound.receive))
    wrapped = np.degrees((angle + np.pi) % (2 * np.pi) - np.pi)
    series = replace(sound, fields={"position.0": wrapped})
    assert find_silent_damage(series, Limits(periods={"position.0": 360.0})) == ()


def test_clocks_of_another_pace_or_unit_are_sound(sound: Series) -> None:
    long = np.arange(len(sound.receive)) * 1.0  # a second a message: hundreds of seconds
    slow = replace(sound, receive=long, header=0.5 * long)  # simulated time
    unset = replace(sound, receive=long, header=np.zeros(len(long)))
    assert find_silent_damage(slow) == ()
    assert find_silent_damage(unset) == ()
    ticks = replace(sound, fields={"stamp": 1.7e15 + 1e6 * long})
    assert find_silent_damage(ticks, Limits(clocks=("stamp",))) == ()
    assert find_silent_damage(ticks) != ()
