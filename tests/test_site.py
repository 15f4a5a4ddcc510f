"""The site of all runs: every artifact in one index, no broken link, no error in a browser, wherever it is moved."""

import json
import shutil
from urllib.parse import unquote

import numpy as np
import pytest
from chromium import opened
from gpsim.cli.main import app
from made_artifacts import made_diagnosis_artifact
from made_diagnoses import made_diagnosis, made_effect
from pages import Page, check_policy
from typer.testing import CliRunner

from gpsim.artifacts import Recipe, Store
from gpsim.channels import Channels
from gpsim.corrected import EffectsPlant
from gpsim.errors import UsageError
from gpsim.files import write_json
from gpsim.recordings import Episode, Recording, write_recording
from gpsim.simulators import make_simulator
from gpsim.stages.site import write_site

ODD = 'a<b> "c" & é #1%'


def collected(store):
    """A recording as an artifact, and a diagnosis of it."""
    states = np.stack([np.sin(np.arange(9.0)), np.cos(np.arange(9.0))], axis=1)
    channels = Channels.of({"theta": "rad", "theta_dot": "rad/s"})
    episode = Episode("0", 0.02 * np.arange(9), states, np.zeros((8, 1)))
    recording = Recording("pendulum", channels, Channels.of({"torque": "N m"}), (episode,), 0.02)
    made = store.publish(
        Recipe("collect", {"of": store.experiment}, {}, {"seed": 3}),
        lambda folder: write_recording(recording, folder),
    )
    simulator = make_simulator("pendulum")
    plant = EffectsPlant(simulator, simulator.defaults(), (), "euler", 1, 0.02)
    spring = made_effect(sentence="a spring of 3 N/m was left out", role="headline")
    found = made_diagnosis(verdict="ambiguous", effects=(spring,))
    return made, made_diagnosis_artifact(store, plant, made.path, found=found)


@pytest.fixture
def runs(tmp_path):
    """Two experiments, one by an odd name; a loop's report; a proof that links to a diagnosis; two that are damaged."""
    runs = tmp_path / "runs"
    for name in ("cart", ODD):
        made, diagnosis = collected(Store(runs, name))
        stats = {"Source": {"mean": 12.3, "episodes": 4}, "Target": {"mean": 45.6, "episodes": 4}}

        def write(folder, stats=stats):
            write_json(folder / "summary.json", {"returns": {}, "returns_all": stats})
            (folder / "report.html").write_text("<!doctype html><title>loop</title><p>x</p>")

        parents = {"collect/0": made, "diagnose/0": diagnosis}
        Store(runs, name).publish(Recipe("report", {}, parents, {"seeds": [0, 1]}), write)
    shutil.copytree(runs / "cart/diagnose/v0001", runs / "proof/diagnoses/0007/diagnosis")
    link = '<!doctype html><title>p</title><a href="diagnoses/0007/diagnosis/report.html">0007</a>'
    (runs / "proof/report.html").write_text(link)
    write_json(
        runs / "proof/prove.json", {"seed": 5, "single": {"n": 3, "right": 2}, "all": {"n": 3, "right": 2}}
    )
    shutil.copytree(runs / "cart/report/v0001", runs / "cart/report/v0002")
    (runs / "cart/report/v0002/report.html").write_text("changed")
    shutil.copytree(runs / "cart/collect/v0001", runs / "cart/collect/v0002")
    (runs / "cart/collect/v0002/manifest.json").write_text("{}")
    return runs


def rows(index):
    """anchor -> text of its row."""
    page = index.read_text(encoding="utf-8")
    return {part.split('"', 1)[0]: Page(f'<tr id="{part}').text for part in page.split('<tr id="')[1:]}


def test_every_artifact_is_there_with_what_was_found(runs):
    index, notes = write_site(runs)
    assert index == runs / "site" / "index.html"
    told = rows(index)
    assert "12.3" in told["cart--report--v0001"]
    assert "mean returns, all starts" in told["cart--report--v0001"]
    assert "0, 1" in told["cart--report--v0001"]
    assert "ambiguous" in told["cart--diagnose--v0001"]
    assert "a spring of 3 N/m was left out" in told["cart--diagnose--v0001"]
    assert "collect v0001" in told["cart--diagnose--v0001"]  # by the recording's bytes: it is no parent
    assert "recording of pendulum every 0.02 s: theta, theta_dot, torque" in told["cart--collect--v0001"]
    assert "2 of 3" in told["proof"]
    assert "changed after it was written" in told["cart--report--v0002"]
    assert "changed after it was written" in told["cart--collect--v0002"]
    assert len(told) == 9
    assert notes[0] == "9 artifacts of 3 experiment(s), 5 reports"
    assert len(notes) == 3
    check_policy(index.read_text(encoding="utf-8"))


def test_equal_runs_give_equal_bytes_and_a_site_is_replaced(runs):
    index, _ = write_site(runs)
    before = index.read_bytes()
    (runs / "site" / "old.html").touch()
    assert write_site(runs)[0].read_bytes() == before  # it is none of the runs, though it lies among them
    assert not (runs / "site" / "old.html").exists()


def test_no_link_is_broken_and_no_browser_complains_wherever_the_folder_is(runs, tmp_path):
    out = tmp_path / "out"
    write_site(runs, out)
    runs.rename(tmp_path / "gone")
    moved = out.rename(tmp_path / "moved here")
    seen, ahead = set(), [moved / "index.html"]
    while ahead:
        page = ahead.pop()
        seen.add(page)
        document, complaints = opened(page, tmp_path / "profile")
        assert not complaints
        found = Page(document)
        assert all(a.get("src", "data:").startswith("data:") for _, a in found.elements)
        anchors = {a["id"] for _, a in found.elements if "id" in a}
        for link in (a["href"] for tag, a in found.elements if tag == "a"):
            path, _, anchor = link.partition("#")
            if not path:
                assert unquote(anchor) in anchors, link
                continue
            target = page.parent / unquote(path)
            assert target.is_file(), link
            assert moved in target.resolve().parents
            if target not in seen:
                ahead.append(target)
    assert seen == set(moved.rglob("*.html"))
    assert len(seen) == 7


def test_the_browser_would_complain(tmp_path):
    page = tmp_path / "bad.html"
    page.write_text(
        '<!doctype html><title>x</title><p>it is</p><script>throw Error("nothing loads")</script>'
    )
    document, complaints = opened(page, tmp_path / "profile")
    assert "it is" in document
    assert "nothing loads" in complaints[0]


def test_without_runs_it_says_how_to_make_some(tmp_path):
    (tmp_path / "runs").mkdir()
    index, notes = write_site(tmp_path / "runs")
    assert "gpsim run full-loop budget=smoke" in index.read_text()
    assert notes == ["0 artifacts of 0 experiment(s), 0 reports"]


def test_an_artifact_of_another_version_is_listed_all_the_same(tmp_path):
    Store(tmp_path, "x").publish(
        Recipe("evaluate", {}, {}, {}), lambda folder: write_json(folder / "evaluation.json", {"returns": 3})
    )
    assert "written otherwise" in rows(write_site(tmp_path)[0])["x--evaluate--v0001"]


def test_it_is_refused_in_one_line(runs, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").touch()
    for words, text in (
        (["--site", "--out", str(tmp_path / "mine")], "holds something that is no site"),
        (["--site", "--out", str(tmp_path / "no" / "site")], "no such folder"),
        (["--site", f"runs_dir={tmp_path / 'none'}"], "no such folder"),
        (["--out", str(tmp_path / "x")], "--out goes with --site"),
    ):
        result = CliRunner().invoke(app, ["report", *words])
        assert isinstance(result.exception, UsageError)
        assert text in str(result.exception)
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["thesis.txt"]
    result = CliRunner().invoke(app, ["report", "--site", f"runs_dir={runs}"])
    assert result.output.splitlines()[0] == f"site: {runs / 'site' / 'index.html'}"
    assert json.loads((runs / "proof/prove.json").read_text())["seed"] == 5
