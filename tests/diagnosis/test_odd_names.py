"""A system whose channels hold formulas, tags, quotes and markup, from its recording to page, figures and simulator."""

import json
from dataclasses import replace

import numpy as np
import pytest
from gpsim.cli.main import app
from pages import check_policy
from typer.testing import CliRunner

from gpsim import load_simulator
from gpsim.errors import UsageError
from gpsim.recordings import read_recording, write_recording
from gpsim.stages.diagnose import read_corrected

from .own_systems import ODD_NAMES, ODD_SLIDER
from .worlds import World, record

pytestmark = pytest.mark.pictures

EPISODES = ["NA", "<i>e</i> $a$ [bold]", "007", "null", "[/] " + "e" * 180]
X, V, F = ODD_NAMES


def odd_recording(system):
    world = World("slider", filters=[lambda u, t, h, m: 0.5 * u])
    known = record(world, seed=1, episodes=5, steps=105)
    return replace(
        known,
        system=system.name,
        state=system.state,
        action=system.action,
        parameters=system.defaults(),
        noise={X: known.noise["q"], V: known.noise["q_dot"]},
        episodes=tuple(replace(e, name=name) for e, name in zip(known.episodes, EPISODES, strict=True)),
    )


FEW = "diagnose.families.only=[actuator_gain,viscous_friction]"


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("odd")
    (folder / "odd.py").write_text(ODD_SLIDER, encoding="utf-8")
    (folder / "log").mkdir()
    odd = load_simulator(f"{folder / 'odd.py'}:Odd")
    write_recording(odd_recording(odd), folder / "log", "csv")
    result = CliRunner().invoke(app, ["diagnose", str(folder / "log"), "--out", str(folder / "out"), FEW])
    assert result.exit_code == 0, result.output
    return folder / "out", result.output


def test_the_terminal_prints_the_names_letter_by_letter(diagnosed):
    said = " ".join(diagnosed[1].split())
    assert f"actuator gain on {F}" in said
    assert f"{X} 0.27" in said


def test_the_report_names_channels_and_episodes_as_they_are(diagnosed):
    report = json.loads((diagnosed[0] / "diagnosis.json").read_text(encoding="utf-8"))
    options = [report["effects"], *(a["effects"] for a in report["alternatives"])]
    assert ("actuator_gain", F) in [(e["family"], e["on"]) for effects in options for e in effects]
    assert set(report["fit"]["rollout"]) == {"horizon_s", X, V}
    assert report["fit"]["held_out"] == [EPISODES[4]]


def test_no_element_of_the_page_comes_from_a_name(diagnosed):
    page = check_policy((diagnosed[0] / "report.html").read_text(encoding="utf-8"))
    known = {
        "html",
        "head",
        "meta",
        "style",
        "title",
        "body",
        "main",
        "h1",
        "h2",
        "h3",
        "p",
        "table",
        "tr",
        "th",
        "td",
    }
    assert page.tags == known | {"img", "pre", "details", "summary", "div", "span", "b", "figure"}
    assert page.attributes == {
        "lang",
        "charset",
        "http-equiv",
        "name",
        "content",
        "class",
        "alt",
        "src",
        "title",
        "data-head",
    }
    assert f"actuator gain on {F}" in page.text
    assert X in page.text


def test_a_long_name_is_short_in_tables_and_whole_in_their_titles(diagnosed):
    page = check_policy((diagnosed[0] / "report.html").read_text(encoding="utf-8"))
    titles = [a["title"] for tag, a in page.elements if tag == "td" and "title" in a]
    titles = [title for title in titles if not title.endswith("%")]  # the intervals of shares
    assert titles == [f"{V}_rate", V] * 2  # in the account and in the table of every model
    pictures = [a.get("title", "") for tag, a in page.elements if tag == "img"]
    assert all(V in title for title in (pictures[0], pictures[-1]))


def test_the_figures_are_drawn(diagnosed):
    drawn = {path.name: path.read_bytes() for path in (diagnosed[0] / "figures").iterdir()}
    usual = {
        "decomposition.png",
        "held_out_rollout.png",
        "residual_inputs.png",
        "residual_time.png",
        "traces.png",
    }
    assert set(drawn) >= usual
    assert all(name.startswith("curve_") for name in set(drawn) - usual)
    assert all(content.startswith(b"\x89PNG") for content in drawn.values())


def test_the_corrected_simulator_steps(diagnosed):
    plant, rng = read_corrected(diagnosed[0], gp=True), np.random.default_rng(0)
    assert (plant.state.names, plant.action.names) == ((X, V), (F,))
    state = plant.step(np.zeros((1, 2)), np.ones((1, 1)), plant.begin(1, rng), rng)
    assert state[0, 1] == pytest.approx(0.02 * 0.5 / 2.0, rel=0.02)


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_the_recording_comes_back_as_it_was(tmp_path, form):
    (tmp_path / "odd.py").write_text(ODD_SLIDER, encoding="utf-8")
    written = odd_recording(load_simulator(f"{tmp_path / 'odd.py'}:Odd"))
    write_recording(written, tmp_path, form)
    read = read_recording(tmp_path)
    assert (read.state, read.action) == (written.state, written.action)
    assert [e.name for e in read.episodes] == EPISODES


def test_the_one_name_that_the_report_needs_for_itself_is_refused(tmp_path):
    (tmp_path / "tank.py").write_text(
        "class Tank:\n    state = {'horizon_s': 'm'}\n    action = {'u': 'V'}\n    parameters = {}\n"
        "    def rates(self, state, action, p):\n        return {'horizon_s': action['u'] - state['horizon_s']}\n"
    )
    (tmp_path / "log.csv").write_text("t,horizon_s,u\n0.0,1.0,0\n0.1,1.1,1\n0.2,1.2,0\n0.3,1.1,0\n")
    words = ["diagnose", str(tmp_path / "log.csv"), "--simulator", f"{tmp_path}/tank.py:Tank"]
    result = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "out")])
    assert isinstance(result.exception, UsageError)
    assert "'horizon_s'" in str(result.exception)
