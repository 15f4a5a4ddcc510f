"""Pipes where a table, a recording or its description should be: refused, not waited for."""

import os

import pytest
from attacking import gpsim as gpsim  # a fixture
from attacking import impatient

from gpsim.errors import UsageError
from gpsim.files import file_digest
from gpsim.recordings import read_yaml
from gpsim.recordings.files import read_frame

META = "system: cartpole\ndt: 0.02\nstate: {x: m}\n"


@pytest.mark.parametrize("read", [read_frame, read_yaml, file_digest])
@pytest.mark.parametrize("name", ["log.csv", "log.parquet"])
def test_a_pipe_is_not_opened(tmp_path, read, name):
    os.mkfifo(tmp_path / name)
    with impatient(), pytest.raises(UsageError, match="is not a regular file"):
        read(tmp_path / name)


@pytest.mark.parametrize("name", ["log.csv", "log.parquet"])
def test_a_pipe_in_the_place_of_a_log(tmp_path, gpsim, name):
    os.mkfifo(tmp_path / name)
    assert gpsim("diagnose", tmp_path / name, "--simulator", "cartpole", "--out", tmp_path / "out").code == 2


@pytest.mark.parametrize("name", ["recording.csv", "recording.parquet"])
def test_a_pipe_in_a_recording(tmp_path, gpsim, name):
    (tmp_path / "recording.yaml").write_text(META)
    os.mkfifo(tmp_path / name)
    assert gpsim("diagnose", tmp_path, "--out", tmp_path / "out").code == 2
