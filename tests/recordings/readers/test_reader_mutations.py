"""Damaged bags of every kind: a result or one clear line, within 20 s and 600 MB each, never a raw exception."""

import numpy as np
import pytest
from bags import KINDS, MCAP_KINDS, drive, write_bag
from mutations import Outcomes, mutate, watch

from gpsim.errors import UsageError
from gpsim.recordings import open_log

QUICK, SLOW = 5, 120


def written(folder, kind, seconds):
    suffix = ".bag" if kind.startswith("ros1") else ".mcap" if kind in MCAP_KINDS else ""
    return write_bag(folder / f"{kind}{suffix}", kind, drive(seconds))


def run(folder, kind, numbers):
    source = written(folder, kind, 0.6)
    outcomes = Outcomes()
    for number in numbers:
        target = folder / f"damaged-{number}{source.suffix}"
        watch(target, mutate(source, target, number), outcomes)
    return outcomes


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("numbers", [range(QUICK), pytest.param(range(QUICK, SLOW), marks=pytest.mark.slow)])
def test_damaged_bags_end_in_a_result_or_a_line(tmp_path, kind, numbers):
    outcomes = run(tmp_path, kind, numbers)
    assert not outcomes.faults
    assert outcomes.counts["strict: refused"] > 0


WISH = {"/odom": ["pose.pose.position.x"], "/joy": ["axes.1"]}


@pytest.mark.parametrize("kind", [k for k in KINDS if k != "sqlite3-file"])
def test_salvage_of_a_cut_bag_is_its_beginning(tmp_path, kind):
    """Wherever a file is cut: every value is one of the true ones, in order, from the first on, and counts add up."""
    source = written(tmp_path, kind, 2.0)
    truth = open_log(source).series(WISH)
    file = source if source.is_file() else max(source.iterdir(), key=lambda p: p.stat().st_size)
    whole, kept = file.read_bytes(), []
    for share in (0.95, 0.8, 0.6, 0.4):
        file.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(UsageError, match="--salvage"):
            open_log(source).series(WISH)
        try:
            salvaged = open_log(source, salvage=True).series(WISH)
        except UsageError:
            assert share < 0.6 or "compressed" in kind  # what describes the topics lay in the lost part
            continue
        for topic, [path] in WISH.items():
            # sqlite's pages do not lie in the order of the rows, so that some of the last may be missing.
            there = np.isin(truth[topic].receive, salvaged[topic].receive)
            assert "sqlite3" in kind or there[: there.sum()].all()
            np.testing.assert_array_equal(salvaged[topic].fields[path], truth[topic].fields[path][there])
            np.testing.assert_array_equal(salvaged[topic].receive, truth[topic].receive[there])
        kept.append(sum(one.read for one in salvaged.values()))
    assert kept == sorted(kept, reverse=True)
    assert kept[0] > 0


@pytest.mark.parametrize("kind", ["ros1", "ros1-bz2", "ros1-lz4", "mcap", "mcap-lz4", "mcap-zstd", "sqlite3"])
def test_salvage_goes_on_behind_a_hole(tmp_path, kind):
    """A hole in the middle costs a few messages, not the rest of the file; what is lost is counted."""
    source = written(tmp_path, kind, 2.0)
    truth = open_log(source).series(WISH)["/odom"]
    file = source if source.is_file() else next(source.glob("*.db3"))
    data = bytearray(file.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 64] = bytes(64)
    file.write_bytes(data)
    log = open_log(source, salvage=True)
    series = log.series(WISH)["/odom"]
    path = WISH["/odom"][0]
    assert truth.receive[-1] in series.receive
    assert 0.7 * len(truth.receive) <= len(series.receive) <= len(truth.receive)
    assert np.isin(series.fields[path], truth.fields[path]).mean() > 0.95
    assert series.read + sum(series.dropped.values()) == len(truth.receive)


def test_an_index_that_does_not_agree_is_told(tmp_path):
    """A flipped connection number hides a message from its topic; the index knows that it was there."""
    source = written(tmp_path, "ros1", 0.6)
    data = source.read_bytes()
    spot = data.index(b"conn=", data.index(b"op=\x02")) + 5
    source.write_bytes(data[:spot] + b"\x7f" + data[spot + 1 :])
    with pytest.raises(UsageError, match="announces"):
        open_log(source).series({t.name: t.fields for t in open_log(source).topics()})
