"""status and --dry-run: what would be made and why, and nothing is written."""

import json
from dataclasses import replace
from pathlib import Path

import asking
import numpy as np
import pytest
from hypothesis import Phase, assume, example, given, settings
from hypothesis import strategies as st
from made_runs import snapshot, spoil

from gpsim.errors import UsageError
from gpsim.files import plain
from gpsim.recordings import Episode, Recording, write_recording
from gpsim.reports.runs_text import dry_run_lines, phrase, status_lines
from gpsim.runs.comparison import flat
from gpsim.stages import fit_gp, full_loop, report
from gpsim.stages.building import base_plant
from gpsim.stages.diagnose import Task, stage_for
from gpsim.stages.registry import STAGES
from gpsim.stages.runs import loop_status, standing_of
from gpsim.stages.stage import Request

SECTIONS = (
    "gp", "policy", "task", "simulator", "target", "residuals", "certify", "evaluate", "randomise", "collect",
)  # fmt: skip


def asked(place: Path, *words: str) -> Request:
    return replace(asking.asked(f"runs_dir={place / 'runs'}", *words), words=words)


def record(folder: Path) -> None:
    base = base_plant(asking.asked().config)
    rng = np.random.default_rng(0)
    episodes = tuple(
        Episode(str(i), 0.02 * np.arange(31), rng.normal(size=(31, 4)), rng.normal(size=(30, 1)))
        for i in range(5)
    )
    write_recording(
        Recording(
            "cartpole", base.state, base.action, episodes, 0.02, base.parameters, "euler", clock="episode"
        ),
        folder,
    )


def make_all(request: Request, seeds=(0,)) -> None:
    """Every artifact of the loop by its true recipe, with files that say nothing."""

    def write(request, recipe, folder):
        if recipe.stage == "collect":
            record(folder)
        (folder / "content").write_text(f"{recipe.stage} {recipe.key}")

    stages = [(STAGES[job.stage], job.request) for job in full_loop.plan(request, seeds)]
    for stage, of_job in [*stages, (report.stage_for(seeds), request)]:
        replace(stage, write=write).make(of_job)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    place = tmp_path_factory.mktemp("finished")
    make_all(asked(place))
    return place


def told(status) -> dict:
    return {standing.job: standing for standing in status.standings}


def test_of_a_finished_loop_all_is_there_and_of_none_nothing_is_written(finished, tmp_path):
    before = snapshot(finished)
    status = loop_status(asked(finished), (0,))
    assert status.count("there") == len(status.standings) == 13
    assert status_lines(status)[-1] == "all 13 are there"
    assert all(Path(str(standing.path)).is_dir() for standing in status.standings)
    assert snapshot(finished) == before
    empty = loop_status(asked(tmp_path), (0, 1))
    assert not list(tmp_path.iterdir())
    assert empty.count("there") == 0
    states = {standing.job: standing.state for standing in empty.standings}
    assert states["Source · seed 1"] == states["certify"] == "to make"
    assert told(empty)["fit-gp · seed 0"].waits_for == ("build-residuals · seed 0",)
    assert "make them with: gpsim run full-loop --seeds 2" in status_lines(empty)[-1]


def changed(request: Request, way: tuple[str, ...], value: object) -> Request:
    """With one setting changed."""
    config = json.loads(json.dumps(plain(request.config)))
    section = config
    for part in way[:-1]:
        section = section[part]
    section[way[-1]] = value
    return replace(request, config=config)


def numbers() -> list[tuple[tuple[str, ...], object]]:
    config = asking.asked().config
    ways = flat({name: plain(config[name]) for name in SECTIONS})
    return [(way, v) for way, v in sorted(ways.items()) if isinstance(v, int | float)]


@settings(max_examples=12, deadline=None, phases=[Phase.explicit, Phase.generate])
@example((("gp", "noise_floor"), 0.001), 1)  # left out of recipes at its usual value
@given(st.sampled_from(numbers()), st.integers(1, 9))
def test_a_changed_setting_is_told_with_its_old_and_new_value(finished, setting, by):
    way, old = setting
    new = (not old) if isinstance(old, bool) else old + by if isinstance(old, int) else old * (1 + by / 16)
    assume(new != old)
    request = changed(asked(finished), way, new)
    before = snapshot(finished)
    try:
        status = loop_status(request, (0,))
    except UsageError:  # a value that the loop refuses
        assume(False)
    assert snapshot(finished) == before
    found = [d for standing in status.standings for d in standing.differences if d.kind == "setting"]
    found = [d for d in found if d.key != "command"]  # the report's own, which it prints
    last = way[-1]  # certify has its starts in a section of their own
    assert {(d.old, d.new) for d in found if d.key.endswith(last)} == {(old, new)}
    assert {d.key.split(".")[-1] for d in found} <= {last, "held_out_share"}
    first = next(standing for standing in status.standings if standing.state != "there")
    assert first.state == "to make"
    assert first.nearest is not None


def test_a_seed_a_file_and_older_code_are_told(finished, tmp_path, monkeypatch):
    seeded = told(loop_status(asked(finished, "seed=3"), (3,)))["Source · seed 3"]
    assert [phrase(d) for d in seeded.differences] == ["seed: 0 → 3"]
    older = replace(fit_gp.STAGE, format=fit_gp.STAGE.format + 1, code="gpsim 9.9")
    lines = [phrase(d) for d in standing_of(older, asked(finished)).differences]
    assert lines[0] == f"code: the stage's format {fit_gp.STAGE.format} → {fit_gp.STAGE.format + 1}"
    assert lines[1].endswith("→ gpsim 9.9")
    drive = tmp_path / "drive"
    drive.mkdir()
    record(drive)
    stage, request = stage_for(Task(drive, None)), asked(tmp_path)
    replace(stage, write=lambda request, recipe, folder: (folder / "a").touch()).make(request)
    assert standing_of(stage, request).state == "there"
    text = (drive / "recording.yaml").read_text()
    (drive / "recording.yaml").write_text(f"{text}noise: {{x: 0.001}}\n")
    standing = standing_of(stage, request)
    assert standing.state == "to make"
    assert [phrase(d) for d in standing.differences] == ["file recording.yaml: changed"]


def test_another_parent_is_told_by_where_it_lies(finished, tmp_path):
    request = asked(tmp_path)
    make_all(request)
    other = asked(tmp_path, "residuals.test_fraction=0.4")
    write = lambda request, recipe, folder: (folder / "a").write_text("other") and None  # noqa: E731
    replace(STAGES["build-residuals"], write=write).make(other)
    standing = standing_of(fit_gp.STAGE, other)
    (difference,) = standing.differences
    shelf = tmp_path / "runs/cartpole/build-residuals"
    assert (difference.kind, difference.key) == ("parent", "residuals")
    assert (difference.old, difference.new) == (str(shelf / "v0001"), str(shelf / "v0002"))


def test_what_waits_says_for_what_and_how_to_make_it_and_what_differs_besides(finished):
    request = asked(finished, "residuals.test_fraction=0.4", "gp.n_train=77")
    standing = standing_of(fit_gp.STAGE, request)
    assert standing.state == "waits"
    assert standing.waits_for == ("build-residuals",)
    assert standing.make_first == "gpsim build-residuals residuals.test_fraction=0.4 gp.n_train=77"
    settings_told = [(d.key, d.new) for d in standing.differences if d.kind == "setting"]
    assert settings_told == [("gp.n_train", 77)]
    assert [(d.key, d.new) for d in standing.differences if d.kind == "parent"] == [("residuals", None)]
    lines = dry_run_lines(standing)
    assert lines[0].startswith("waits   fit-gp  for build-residuals; beside that differs from ")
    assert lines[1].startswith("          gp.n_train: ")
    assert lines[-1] == f"make first: {standing.make_first}"
    # What was only planned is never made.
    with pytest.raises(UsageError, match="make it with: gpsim build-residuals"):
        fit_gp.STAGE.make(request)


def test_the_nearest_is_the_newest_of_those_with_the_fewest_differing_keys(tmp_path):
    stage = replace(
        STAGES["certify"],
        write=lambda request, recipe, folder: (folder / "a").write_text(recipe.key) and None,
    )
    for words in (["certify.width=3"], ["certify.width=4"], ["certify.width=9", "evaluate.episodes=9"]):
        stage.make(asked(tmp_path, *words))
    standing = standing_of(stage, asked(tmp_path, "certify.width=5"))
    assert Path(str(standing.nearest)).name == "v0002"
    assert [(d.key, d.old, d.new) for d in standing.differences] == [("certify.width", 4, 5)]
    standing = standing_of(stage, asked(tmp_path, "certify.width=8", "evaluate.episodes=9"))
    assert [(d.key, d.old, d.new) for d in standing.differences] == [("certify.width", 9, 8)]


def test_a_damaged_artifact_is_refused_and_the_others_are_told(tmp_path):
    request = asked(tmp_path)
    make_all(request)
    spoil(STAGES["certify"].need(request))
    status = told(loop_status(request, (0,)))
    assert status["certify"].state == "refused"
    assert "changed after it was written" in str(status["certify"].refusal)
    assert status["Source · seed 0"].state == "there"


def test_out_is_made_whatever_there_is_and_never_over_something(finished, tmp_path):
    request = replace(asked(finished), out=tmp_path / "mine")
    standing = standing_of(fit_gp.STAGE, request)
    assert (standing.state, standing.path, standing.differences) == ("to make", str(tmp_path / "mine"), ())
    (tmp_path / "mine").mkdir()
    with pytest.raises(UsageError, match="exists already"):
        standing_of(fit_gp.STAGE, request)
