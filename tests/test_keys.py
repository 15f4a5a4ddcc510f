"""What an upgrade of gpsim makes anew, and what it keeps."""

from dataclasses import replace
from pathlib import Path

import pytest
from gpsim.cli.configuration import resolve

from gpsim.artifacts import Recipe
from gpsim.stages import diagnose, report
from gpsim.stages.registry import STAGES
from gpsim.stages.stage import IN_NUMBERS, RELEASE, SOURCES, Request, Stage, sources_digest

EVERY = [
    *STAGES.values(),
    diagnose.stage_for(diagnose.Task(Path("drive"), None)),
    report.stage_for((0,)),
]


@pytest.fixture
def request_in(tmp_path):
    return Request({**resolve([], None), "runs_dir": str(tmp_path / "runs")})


def simple(stage: Stage) -> Stage:
    """A stage that keeps its name and code, and makes one empty file."""

    def write(request, recipe, folder):
        (folder / "a").touch()
        return {}

    return replace(stage, recipe=lambda request: Recipe(stage.name, {}, {}, {"seed": 0}), write=write)


@pytest.mark.parametrize("stage", EVERY, ids=lambda stage: stage.name)
def test_what_older_code_has_made_is_not_kept(request_in, stage):
    mine = simple(stage)
    first, existed = mine.make(request_in)
    assert not existed
    assert mine.make(request_in) == (first, True)
    for newer in (replace(mine, format=mine.format + 1), replace(mine, code=f"{mine.code} and later")):
        again, existed = newer.make(request_in)
        assert not existed
        # To the same bytes: what rests on it stays.
        assert again.digest == first.digest


def test_everything_but_a_training_is_made_anew_with_a_release():
    codes = {stage.name: stage.code for stage in EVERY}
    assert {name for name, code in codes.items() if code == IN_NUMBERS} == {"train-source", "train-gp-policy"}
    assert {name for name, code in codes.items() if code == SOURCES} == {"diagnose"}
    assert {code for code in codes.values() if code not in (IN_NUMBERS, SOURCES)} == {RELEASE}


def test_the_loop_and_the_command_find_the_same_diagnosis():
    alone, looped = (stage for stage in EVERY if stage.name == "diagnose")
    assert (alone.format, alone.code) == (looped.format, looped.code)


def test_a_changed_module_of_the_library_changes_the_diagnosis_key(tmp_path):
    for name in ("errors.py", "diagnosis/search.py", "trials/blind.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("one = 1\n")
    before = sources_digest(tmp_path)
    (tmp_path / "trials/blind.py").write_text("one = 2\n")
    assert sources_digest(tmp_path) == before
    (tmp_path / "diagnosis/search.py").write_text("one = 2\n")
    changed = sources_digest(tmp_path)
    assert changed != before
    (tmp_path / "diagnosis/search.py").rename(tmp_path / "diagnosis/found.py")
    assert sources_digest(tmp_path) not in (before, changed)
