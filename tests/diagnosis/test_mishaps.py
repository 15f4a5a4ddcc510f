"""What fails after the search costs a picture, a page or a Gaussian process, and never the result."""

import errno
import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from gpsim.cli.main import main

from gpsim.artifacts import WarningLog, read_artifact, read_warnings
from gpsim.diagnosis import diagnose as diagnose_recording
from gpsim.diagnosis.assessment import comparison as comparing
from gpsim.diagnosis.judging import attribute
from gpsim.errors import UsageError
from gpsim.findings import NoGp
from gpsim.recordings import write_recording
from gpsim.reports import diagnosis_figures
from gpsim.stages import diagnosis_files
from gpsim.stages.diagnose import read_corrected, why_no_gp

from .worlds import World, record

RESULTS = ("diagnosis.json", "corrected.json", "posterior.json")


def broken(*_, **__):
    raise ZeroDivisionError("of all things")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording")
    world = World("slider", forces={0: lambda q, v, t: -1.0 * v})
    write_recording(record(world, seed=6, episodes=4, steps=80), path, "csv")
    return path


@pytest.fixture
def searched(monkeypatch):
    """What the one search has found: it is not repeated, only what comes after it."""
    found = []

    def once(*given, **named):
        found[:] = found or [diagnose_recording(*given, **named)]
        return found[0]

    monkeypatch.setattr(diagnosis_files, "diagnose", once)
    return found


@pytest.fixture
def diagnosed(folder, searched, tmp_path, monkeypatch, capsys):
    def run(name="out"):
        words = ["diagnose", "-q", str(folder), "--simulator", "slider", "--out", name, "--cores", "1"]
        monkeypatch.setattr(sys, "argv", ["gpsim", *words])
        try:
            main()
        except SystemExit as ended:
            assert not ended.code
        return tmp_path / name, capsys.readouterr()

    return run


def test_every_part_may_fail_and_the_result_is_there(diagnosed, searched, monkeypatch):
    """Whole first; then without one picture after another, the page, the processes: each is named where it is missed."""
    whole, said = diagnosed()
    assert said.err == ""
    assert read_warnings(whole) == []
    left_open = json.loads((whole / "posterior.json").read_text())["explanations"]
    leader = json.loads((whole / "diagnosis.json").read_text())["effects"]
    assert [term["family"] for term in left_open[0]["terms"]] == [effect["family"] for effect in leader]
    told = [
        e["parameters"][p["name"]] for e, g in zip(leader, left_open[0]["parameters"], strict=True) for p in g
    ]
    assert left_open[0]["intervals"] == [[size["low"], size["high"]] for size in told]
    assert np.shape(left_open[0]["covariance"]) == (len(told), len(told))
    results = [(whole / name).read_bytes() for name in RESULTS]
    with monkeypatch.context() as patched:
        patched.setattr(diagnosis_figures, "_inputs", broken)
        patched.setattr(diagnosis_files, "traces", broken)
        made, said = diagnosed("pictures")
    lines = [
        f"figure {name} is left out: ZeroDivisionError: of all things"
        for name in ("traces", "residual_inputs")
    ]
    assert read_warnings(made) == lines
    assert said.err.splitlines() == [f"warning: {line}" for line in lines]
    assert said.out.startswith("Verdict  ")
    assert [(made / name).read_bytes() for name in RESULTS] == results
    left = {"decomposition.png", "residual_time.png"}
    assert {p.name for p in (made / "figures").iterdir()} == left
    page = (made / "report.html").read_text()
    assert page.count("<img") == len(left)
    assert all(line in page for line in lines)
    read_artifact(made, "diagnose")
    with monkeypatch.context() as patched:
        patched.setattr("gpsim.reports.diagnosis_page.page", broken)
        patched.setattr(diagnosis_files, "write_process", broken)
        made, said = diagnosed("page")
    assert [line.split(":")[1].strip() for line in said.err.splitlines()] == [
        "the Gaussian process on the remainder is left out",
        "report.html is left out",
    ]
    assert why_no_gp(made) == "it could not be written down"
    assert read_corrected(made, gp=True).correction is None
    assert not (made / "report.html").exists()
    with monkeypatch.context() as patched:
        patched.setattr(comparing, "learn", broken)
        (found,) = searched
        judgement = replace(found.judgement, structured=True)
        worth = attribute(
            found.question, judgement.leader, judgement.null, judgement.without, judgement.gains
        )
        compared = comparing.compare(found.question, judgement, worth, [], np.random.default_rng(0))
    assert compared.corrected is None
    assert compared.why_no_gp == NoGp("not fitted")
    assert compared.mishaps == (
        "no Gaussian process with the base simulator: ZeroDivisionError: of all things",
    )
    for errors in compared.one_step.values():
        assert errors.gp == errors.before
        assert errors.after_gp == errors.after


@pytest.mark.parametrize(
    "error", [UsageError("yours"), OSError(errno.ENOSPC, "no space left on device"), KeyboardInterrupt()]
)
def test_what_is_the_users_to_mend_ends_the_program(error):
    mishaps = WarningLog()
    with pytest.raises(type(error)), mishaps.contained("a picture"):
        raise error
    assert not mishaps.lines


def test_another_error_is_a_line_and_none_leaves_no_file(tmp_path):
    mishaps = WarningLog(["before"])
    with mishaps.contained("a picture"):
        raise MemoryError
    assert mishaps.lines == ["before", "a picture: MemoryError"]
    mishaps.write(tmp_path)
    assert read_warnings(tmp_path) == mishaps.lines
    WarningLog().write(tmp_path / "nowhere")
