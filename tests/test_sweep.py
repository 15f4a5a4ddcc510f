"""gpsim sweep: Hydra's grammar, each job once, a table of all figures and a page."""

import json
from pathlib import Path

import pandas as pd
import pytest
from gpsim.cli.main import app
from gpsim.cli.sweep import points_of, resolved
from typer.testing import CliRunner

from gpsim.errors import UsageError
from gpsim.reports.sweep_page import main_figures, sweep_page
from gpsim.stages import full_loop
from gpsim.stages.jobs import numbered

QUICK = ("budget=smoke", "collect.policy=random")


@pytest.mark.parametrize(
    ("words", "swept"),
    [
        (["gp.n_train=100,250", "seed=range(2)"], ["100 0", "100 1", "250 0", "250 1"]),
        (["gp=raw,jump"], ["raw", "jump"]),
        (["gp.inputs=[x,y],[x]"], ["[x,y]", "[x]"]),
        (["gp.noise_floor=choice(1e-3,1e-2)"], ["0.001", "0.01"]),
        (["seed=range(3,0,-1)"], ["3", "2", "1"]),
        (["experiment=cartpole", "seed=4"], [""]),
    ],
)
def test_every_combination_the_last_word_fastest(words, swept):
    assert [" ".join(point.swept.values()) for point in points_of(words)] == swept


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("gp.noise_floor=interval(0,1)", "an interval is not a list of values"),
        ("gp=glob(*)", "list the choices"),
        ("launcher=slurm,dask", "a launcher setting takes one value"),
        ("seed=1,1", "a value is there twice"),
        ("seed=range(1000000)", "more than 100000 combinations"),
        ("gp.n_train=((", "gp.n_train"),
    ],
)
def test_what_is_no_sweep_is_one_line(word, said):
    with pytest.raises(UsageError, match=said) as refused:
        points_of([word])
    assert "\n" not in str(refused.value)


def plan_of(*words, of="evaluate"):
    return full_loop.grid_of(resolved(points_of([*QUICK, *words]), None), of)


def test_what_points_share_is_made_once():
    plan = plan_of("gp.n_train=50,80", "seed=0,1", of="fit-gp")
    assert len(plan.points) == 4
    assert (
        sorted(job.stage for job in plan.jobs) == ["build-residuals"] * 2 + ["collect"] * 2 + ["fit-gp"] * 4
    )
    places = {job.label: i for i, job in enumerate(plan.jobs)}
    assert all(places[label] < places[job.label] for job in plan.jobs for label in job.after)
    assert len(set(plan.targets)) == 4


def test_who_makes_a_point_does_not_look_through_the_shelf_again(tmp_path, monkeypatch):
    """Unless something may lie there that only a look finds: of a release without markers."""
    monkeypatch.chdir(tmp_path)
    jobs = plan_of("gp.n_train=50,80", of="fit-gp").jobs
    assert [request.looked for _, request, _ in numbered(jobs)] == [True] * 4
    old = Path("runs/cartpole/fit-gp/v0001")
    old.mkdir(parents=True)
    looked = [request.looked for _, request, _ in numbered(jobs)]
    assert looked == [job.stage != "fit-gp" for job in jobs]


def test_a_whole_loop_shares_what_does_not_depend_on_what_is_swept():
    plan = plan_of("gp.n_train=50,80")
    count = pd.Series([job.stage for job in plan.jobs]).value_counts()
    assert count["train-source"] == 3  # source, randomised and target, once for both
    assert count["diagnose"] == count["certify"] == count["collect"] == 1
    assert count["train-gp-policy"] == 2 * 3  # of the effects the second finds what the first made
    assert count["evaluate"] == 2


def test_of_trainings_the_configured_one_is_made():
    plan = plan_of("policy.learning_rate=1e-3,1e-4", "variant=target", of="train-source")
    assert [job.request.config["variant"] for job in plan.jobs] == ["target", "target"]
    stages = [job.stage for job in plan_of("prediction=mean,sample", of="train-gp-policy").jobs]
    assert stages == [
        "collect",
        "build-residuals",
        "fit-gp",
        "diagnose",
        "train-gp-policy",
        "train-gp-policy",
    ]


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """The folder in which a command swept two places over two seeds, one of which cannot be written; and how it ended."""
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "blocked").touch()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        words = ["sweep", "--of", "fit-gp", "--jobs", "1", *QUICK, "collect.episodes=3", "gp.restarts=0"]
        result = CliRunner().invoke(app, [*words, "gp.n_train=40", "runs_dir=runs,blocked", "seed=0,1"])
    return folder, result


def test_it_leaves_a_table_and_a_page_and_a_point_that_fails_stops_no_other(swept):
    folder, result = swept
    assert isinstance(result.exception, UsageError), result.output
    place = folder / "runs/cartpole/sweep/v0001"
    assert result.stdout.splitlines()[-1] == "runs/cartpole/sweep/v0001/sweep.csv"
    table = pd.read_csv(place / "sweep.csv")
    parquet = pd.read_parquet(place / "sweep.parquet")
    assert list(parquet) == list(table)
    assert parquet["sha256"].dropna().tolist() == table["sha256"].dropna().tolist()
    points = list(zip(table["runs_dir"], table["seed"], strict=True))
    assert points == [("runs", 0), ("runs", 1), ("blocked", 0), ("blocked", 1)]
    assert table["error"].isna().tolist() == [True, True, False, False]
    assert table["rows"].tolist()[:2] == [40.0, 40.0]
    assert json.loads((place / "manifest.json").read_text())["config"]["of"] == "fit-gp"
    page = (place / "report.html").read_text()
    assert "4 points" in page
    assert "2 of them failed" in page
    assert ">nan<" not in page
    assert "Over seeds" in page
    assert str(result.exception).startswith("2 of 4 points failed; the table says why")


def test_where_no_point_can_be_made_the_first_reason_is_told(tmp_path):
    result = CliRunner().invoke(app, ["sweep", "--of", "collect", "collect.policy=nobody", "seed=0,1"])
    assert isinstance(result.exception, UsageError)
    assert not Path("runs").exists()


def made_table():
    rows = [
        {"gp.n_train": n, "seed": s, "returns_all.Source.mean": 40.0 + s, "returns_all.Source.std": 1.0,
         "one_step.x_acc.mean.nrmse": 1 / n, "sha256": "x", "error": None}
        for n in (100, 250) for s in (0, 1)
    ]  # fmt: skip
    return pd.DataFrame(rows)


def test_the_page_shows_the_main_figures_and_is_the_same_for_the_same_table():
    swept, table = ["gp.n_train", "seed"], made_table()
    assert main_figures(swept, table) == ["returns_all.Source.mean", "one_step.x_acc.mean.nrmse"]
    page = sweep_page("evaluate", swept, table)
    assert page == sweep_page("evaluate", swept, table.copy())
    assert "data:image/svg+xml" in page
    assert "40.5 ± 0.707" in page


def test_of_a_fit_likelihood_and_noise_are_shown_and_not_what_repeats_a_setting():
    rows = [
        {"gp.n_train": n, "rows": n, "rates.x_acc.converged": True, "rates.x_acc.log_marginal_likelihood": 2.0 * n,
         "rates.x_acc.hyper_parameters_original.noise_std": 0.25, "rates.x_acc.evaluations": 40 + n,
         "sha256": "x", "error": None}
        for n in (100, 250)
    ]  # fmt: skip
    table = pd.DataFrame(rows)
    shown = main_figures(["gp.n_train"], table)
    assert shown == [
        "rates.x_acc.log_marginal_likelihood",
        "rates.x_acc.hyper_parameters_original.noise_std",
    ]
    page = sweep_page("fit-gp", ["gp.n_train"], table)
    assert "<th>log marginal likelihood x_acc</th>" in page
    assert ">500</td>" in page
    others = table.drop(columns=shown)
    assert main_figures(["gp.n_train"], others) == ["rates.x_acc.converged", "rates.x_acc.evaluations"]
    assert ">yes</td>" in sweep_page("fit-gp", ["gp.n_train"], others)
