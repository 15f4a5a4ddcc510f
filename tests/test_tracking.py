"""Event files of trainings: beside the artifacts, the same bytes with them as without, none unless asked for."""

import pytest
from gpsim.cli.configuration import resolve
from gpsim.cli.main import app
from typer.testing import CliRunner

from gpsim.errors import UsageError
from gpsim.stages import full_loop, report, train_source
from gpsim.stages.registry import STAGES
from gpsim.stages.stage import Request

TINY = ("budget=smoke", "policy.total_steps=1280", "policy.n_steps=32", "policy.n_envs=4")
LIMO = (
    "experiment=limo", "budget=smoke", "policy.total_steps=640", "policy.checkpoint_every=320", "task.max_steps=20",
)  # fmt: skip


def trained(words, runs):
    config = resolve([*words, f"runs_dir={runs}"], None)
    return STAGES["train-source"].make(Request(config, tuple(words)))[0]


def scalars(folder):
    """tag -> [(step, value)] of all event files below a folder."""
    accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    read = accumulator.EventAccumulator(str(folder))
    read.Reload()
    return {tag: [(event.step, event.value) for event in read.Scalars(tag)] for tag in read.Tags()["scalars"]}


def event_files(folder):
    return sorted(folder.rglob("events.out.tfevents.*"))


def test_a_training_is_tracked_beside_its_artifact_which_has_the_same_bytes(tmp_path, tree):
    pytest.importorskip("tensorboard")
    plain = trained(TINY, tmp_path / "plain" / "runs")
    tracked = trained((*TINY, "track=tensorboard"), tmp_path / "tracked" / "runs")
    assert plain.key == tracked.key
    assert plain.digest == tracked.digest
    assert tree(tmp_path / "plain") == {
        k: v for k, v in tree(tmp_path / "tracked").items() if "/tracking/" not in k
    }
    assert not event_files(tmp_path / "plain")
    place = tmp_path / "tracked/runs/cartpole/tracking" / f"train-source-source-seed0-{tracked.key[:8]}"
    found = scalars(place)
    curve = [line.split(",") for line in (tracked.path / "learning_curve.csv").read_text().splitlines()[1:]]
    known = [(int(steps), float(mean)) for steps, mean, _ in curve if mean not in ("", "nan")]
    assert [step for step, _ in found["training/mean_return"]] == [step for step, _ in known]
    assert [value for _, value in found["training/mean_return"]] == pytest.approx(
        [mean for _, mean in known], rel=1e-5
    )
    assert found["train/value_loss"][-1][0] == known[-1][0]  # the last update, too


def test_soft_actor_critic_and_expert_iteration_are_tracked_too(tmp_path):
    pytest.importorskip("tensorboard")
    trained((*LIMO, "track=tensorboard"), tmp_path / "runs")
    (place,) = (tmp_path / "runs/limo/tracking").iterdir()
    found = scalars(place)
    assert [step for step, _ in found["training/score"]] == [320, 640]
    assert "train/critic_loss" in found
    rounds = ("policy=expert", "policy.expert_rounds=1", "task.max_steps=30")
    trained((*TINY, *rounds, "track=tensorboard"), tmp_path / "runs")
    (place,) = (tmp_path / "runs/cartpole/tracking").iterdir()
    assert next(step for step, _ in scalars(place / "expert")["training/score"]) == 0


def test_a_training_that_is_made_anew_has_the_events_of_the_last_try_alone(tmp_path):
    pytest.importorskip("tensorboard")
    config = resolve([*TINY, "track=tensorboard", f"runs_dir={tmp_path}"], None)
    request = Request(config)
    recipe = STAGES["train-source"].keyed(request)
    folder = train_source.events_of(request, recipe, "train-source/source")
    (folder / "events.out.tfevents.1.old").touch()
    (folder / "mine.txt").touch()
    assert train_source.events_of(request, recipe, "train-source/source") == folder
    assert [path.name for path in folder.iterdir()] == ["mine.txt"]


def test_off_nothing_is_written_and_a_report_does_not_know(tmp_path):
    request = Request(resolve([*TINY, f"runs_dir={tmp_path}"], None))
    recipe = STAGES["train-source"].keyed(request)
    assert train_source.events_of(request, recipe, "train-source/source") is None
    assert train_source.tracking_remarks(request) == []
    assert not list(tmp_path.iterdir())
    words = ("budget=smoke", "track=tensorboard")
    assert report.command_of(Request(resolve(words, None), words), (0,)) == "gpsim run full-loop budget=smoke"


def test_without_the_package_one_line_says_how_to_get_it_before_anything_is_trained(tmp_path, monkeypatch):
    monkeypatch.setattr(train_source, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match=r"pip install 'gpsim\[tensorboard\]'"):
        trained((*TINY, "track=tensorboard"), tmp_path / "runs")
    assert not list((tmp_path / "runs").rglob("v*"))
    assert not list((tmp_path / "runs").rglob("tracking"))
    request = Request(resolve(["budget=smoke", "track=tensorboard", f"runs_dir={tmp_path / 'loop'}"], None))
    with pytest.raises(UsageError, match="not installed"):
        full_loop.plan(request, (0,))
    result = CliRunner().invoke(app, ["run", "full-loop", "budget=smoke", "track=tensorboard"])
    assert isinstance(result.exception, UsageError)
    assert not (tmp_path / "loop").exists()


def test_another_tracker_is_no_choice(tmp_path):
    with pytest.raises(UsageError, match="track"):
        trained((*TINY, "track=wandb"), tmp_path / "runs")


def test_off_no_writer_of_events_is_made(tmp_path, monkeypatch):
    from gpsim.policies.training import sb3

    monkeypatch.setattr(sb3, "TensorBoardOutputFormat", None)  # what is called would be no function
    assert trained(TINY, tmp_path / "runs").path.is_dir()
