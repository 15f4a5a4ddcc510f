"""gpsim runs and --dry-run as a person meets them."""

import json
import sys
from dataclasses import asdict
from pathlib import Path

import pytest
from gpsim.cli.main import main
from made_runs import made, snapshot, spoil

from gpsim.artifacts import Recipe, Store
from gpsim.reports.runs_text import bytes_text, phrase
from gpsim.stages.runs import compare_runs, list_runs, show_run

STAGES = ["train-source", "collect", "build-residuals", "fit-gp", "train-gp-policy", "certify", "evaluate"]


@pytest.fixture
def said(monkeypatch, capsys):
    def run(*words: str):
        monkeypatch.setattr(sys, "argv", ["gpsim", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code or 0, *capsys.readouterr()

    return run


def evaluated(root: Path, mean: float, **config: object) -> None:
    content = {"returns_all": {"Effects": {"mean": mean, "interval": [1, 2]}}, "judged_on": "so many words"}

    def write(folder: Path) -> None:
        (folder / "evaluation.json").write_text(json.dumps(content))

    Store(root, "cartpole").publish(Recipe("evaluate", config, {}, {"seed": 0}, code="gpsim 0.0.1"), write)


@pytest.mark.parametrize("command", [*STAGES, "diagnose", "report", "run full-loop", "status"])
def test_a_dry_run_in_an_empty_folder_ends_well_and_writes_nothing(command, said, tmp_path):
    words = command.split() + ([] if command == "status" else ["--dry-run"])
    code, out, err = said(*words, "budget=smoke")
    assert (code, err) == (0, "")
    assert out.splitlines()[0].startswith(("make    ", "waits   "))
    assert ("make first: gpsim " in out) == (
        command not in ("train-source", "certify", "run full-loop", "status")
    )
    assert not list(tmp_path.iterdir())


def test_a_dry_run_refuses_what_the_command_refuses(said, tmp_path):
    for words in (
        ["train-source", "--dry-run", "variant=sauce"],
        ["status", "polcy.gamma=1"],
        ["status", "deployed=x.bag"],
        ["diagnose", "nowhere", "--dry-run"],
        ["collect", "--dry-run", "--plan", "plan.csv"],
        ["import", "--inspect", "--dry-run", "x.csv"],
    ):
        code, out, err = said(*words)
        assert (code, out) == (2, "")
        assert err.startswith("error: ")
    assert not list(tmp_path.iterdir())


def test_an_import_can_be_tried(said, tmp_path):
    rows = "\n".join(f"{0.02 * k:.2f},{k},0,0,0,1" for k in range(50))
    (tmp_path / "log.csv").write_text(f"t,x,x_dot,theta,theta_dot,force\n{rows}\n")
    before = snapshot(tmp_path)
    code, out, err = said("import", "log.csv", "system=cartpole", "--out", "drive", "--dry-run")
    assert (code, err) == (0, "")
    assert out.splitlines()[-1] == "import: would write drive; nothing was written"
    assert snapshot(tmp_path) == before
    assert said("import", "log.csv", "system=cartpole", "--out", "drive")[0] == 0
    code, _, err = said("import", "log.csv", "system=cartpole", "--out", "drive", "--dry-run")
    assert code == 2
    assert "drive: exists already" in err


def test_list_says_what_is_there_its_state_and_what_it_says(said, tmp_path):
    root = tmp_path / "runs"
    evaluated(root, 48.25)
    parent = made(root, "collect", 1)
    made(root, "import", 1, {"recording": parent}, experiment="limo")
    spoil(made(root, "collect", 2))
    left = root / "cartpole/collect/.tmp-0123456789ab"
    left.mkdir()
    before = snapshot(tmp_path)
    found = list_runs(Path("runs"))
    assert {a.name: a.state for a in found.artifacts} == {
        "cartpole/evaluate/v0001": "stale",
        "cartpole/collect/v0001": "stale",
        "cartpole/collect/v0002": "broken",
        "limo/import/v0001": "finished",
    }
    whole = (path for path in root.rglob("*") if path.is_file() and ".keys" not in path.parts)
    assert found.bytes == sum(path.stat().st_size for path in whole)
    code, out, _ = said("runs", "list")
    assert code == 0
    assert "return: Effects 48.2" in out
    assert (
        "stale: cartpole/evaluate/v0001: code: the stage's format 1 → 2; code: gpsim 0.0.1 → gpsim 0." in out
    )
    assert "broken: runs/cartpole/collect/v0002/manifest.json: changed after it was written" in out
    assert f"left unfinished: runs/cartpole/collect/{left.name}, 0 B" in out
    _, out, _ = said("runs", "list", "--experiment", "limo")
    assert "cartpole/" not in out
    assert "limo/import/v0001" in out
    _, out, _ = said("runs", "list", "--runs-dir", "elsewhere")
    assert "elsewhere: 0 artifacts, 0 B" in out
    assert snapshot(tmp_path) == before


def test_a_parent_that_is_gone_makes_stale_and_a_changed_byte_is_found_where_it_is_looked_for(said, tmp_path):
    root = tmp_path / "runs"
    parent = made(root, "import", 1)
    child = made(root, "import", 2, {"recording": parent})
    parent.path.rename(tmp_path / "moved")
    (row,) = list_runs(Path("runs")).artifacts
    assert row.state == "stale"
    assert [phrase(d) for d in row.why] == [f"parent recording: {parent.path} → gone"]
    assert f"made from recording: gone (import {parent.digest[:12]})" in said("runs", "show", "import/v2")[1]
    (child.path / "content.txt").write_text("Same")
    assert list_runs(Path("runs")).artifacts[0].damage is None
    assert "changed" in str(list_runs(Path("runs"), verify=True).artifacts[0].damage)
    shown = show_run(Path("runs"), "import/v2")
    assert shown.artifact.state == "broken"
    assert "content.txt: changed after it was written" in said("runs", "show", "import/v2")[1]


def test_show_says_what_rests_on_what(said, tmp_path):
    root = tmp_path / "runs"
    parent = made(root, "collect", 1)
    child = made(root, "fit-gp", 1, {"recording": parent})
    made(root, "evaluate", 1, {"gp": child}, experiment="limo")
    code, out, _ = said("runs", "show", "fit-gp/v1")
    assert code == 0
    assert "made from recording: cartpole/collect/v0001" in out
    assert "needed by limo/evaluate/v0001" in out
    assert '"n": 1' not in out
    assert '"n": 1' in said("runs", "show", "fit-gp/v1", "--all")[1]
    assert "needed by 2 in all" in said("runs", "show", "cartpole/collect/v0001")[1]
    for word, message in (
        ("fit-gp/v7", "no such artifact; there are cartpole/fit-gp/v0001 (gpsim runs list)"),
        ("v1", "several: cartpole/collect/v0001, cartpole/fit-gp/v0001, limo/evaluate/v0001; name one"),
    ):
        code, _, err = said("runs", "show", word)
        assert code == 2
        assert message in err
    assert said("runs", "show", str(child.path))[1] == said("runs", "show", "runs/cartpole/fit-gp/v0001")[1]


def test_a_version_without_a_manifest_is_broken_and_can_be_looked_at_and_removed(said, tmp_path):
    path = made(tmp_path / "runs", "collect", 1).path
    (path / "manifest.json").unlink()
    code, out, _ = said("runs", "show", "collect/v1")
    assert code == 0
    assert out.startswith(
        "cartpole/collect/v0001: broken\n  broken: runs/cartpole/collect/v0001: not an artifact"
    )
    code, _, err = said("runs", "diff", "collect/v1", "collect/v1")
    assert code == 2
    assert "not an artifact" in err
    assert said("runs", "rm", "collect/v1", "--yes")[0] == 0
    assert not path.exists()


def test_diff_goes_key_by_key(said, tmp_path, monkeypatch):
    root = tmp_path / "runs"
    evaluated(root, 1.5, gp={"n_train": 250, "file": "a" * 64})
    monkeypatch.setattr("gpsim.artifacts.store.package_versions", lambda: {"numpy": "9.9"})
    monkeypatch.setattr("gpsim.artifacts.store.git_commit", lambda: "c" * 40)
    evaluated(root, 2.5, gp={"n_train": 500, "file": "b" * 64}, more=True)
    code, out, _ = said("runs", "diff", "evaluate/v1", "evaluate/v2")
    assert code == 0
    for line in (
        "cartpole/evaluate/v0001 → cartpole/evaluate/v0002",
        "  gp.n_train: 250 → 500",
        "  more: absent → true",
        "  file gp.file: changed",
        "  returns_all.Effects.mean: 1.5 → 2.5",
        "  file evaluation.json: differs",
    ):
        assert line in out.splitlines()
    assert "→ 9.9" in out
    assert "code: commit" in out
    assert "interval" not in out
    assert "are equal: same recipe, same bytes" in said("runs", "diff", "evaluate/v1", "evaluate/v1")[1]
    found = compare_runs(Path("runs"), "evaluate/v1", "evaluate/v2")
    assert json.loads(json.dumps(asdict(found)))["differences"][0] == {
        "kind": "setting", "key": "gp.n_train", "old": 250, "new": 500,
    }  # fmt: skip


def test_rm_asks_names_what_needs_it_and_can_only_look(said, tmp_path, monkeypatch):
    root = tmp_path / "runs"
    parent = made(root, "collect", 1)
    made(root, "fit-gp", 1, {"recording": parent})
    before = snapshot(tmp_path)
    code, _, err = said("runs", "rm", "collect/v1", "--yes")
    assert code == 2
    assert "cartpole/collect/v0001: needed by cartpole/fit-gp/v0001; remove those first, or use" in err
    code, out, _ = said("runs", "rm", "collect/v1", "--with-dependents", "--dry-run")
    assert code == 0
    assert out.splitlines()[0].startswith("cartpole/fit-gp/v0001, ")
    assert out.splitlines()[-1].startswith("2 artifacts, ")
    assert out.splitlines()[-1].endswith("; nothing was removed")
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    code, _, err = said("runs", "rm", "fit-gp/v1")
    assert code == 2
    assert "add --yes" in err
    for answer, there in ((False, True), (True, False)):
        assert snapshot(tmp_path) == before
        monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
        monkeypatch.setattr("typer.confirm", lambda text, answer=answer: answer)
        assert said("runs", "rm", "fit-gp/v1")[0] == 0
        assert (root / "cartpole/fit-gp/v0001").exists() == there
    assert said("runs", "rm", "collect/v1", "--yes")[1].endswith("removed\n")
    assert not list(root.rglob("v*"))


def test_gc_shows_what_and_how_many_bytes(said, tmp_path):
    root = tmp_path / "runs"
    for n in range(3):
        made(root, "collect", n)
    before = snapshot(tmp_path)
    code, out, _ = said("runs", "gc", "--keep", "1", "--dry-run")
    assert code == 0
    sizes = [sum(f.stat().st_size for f in (root / f"cartpole/collect/v000{n}").iterdir()) for n in (1, 2)]
    assert out.splitlines()[-1] == f"2 artifacts, {bytes_text(sum(sizes))}; nothing was removed"
    assert snapshot(tmp_path) == before
    assert said("runs", "gc")[1] == "nothing to remove\n"
    assert snapshot(tmp_path) == before
    assert said("runs", "gc", "--keep", "1")[0] == 2  # nobody to ask
    assert said("runs", "gc", "--keep", "1", "--yes")[0] == 0
    assert [path.name for path in (root / "cartpole/collect").iterdir()] == ["v0003"]
    left = root / "cartpole/collect/.tmp-0123456789ab"
    left.mkdir()
    assert said("runs", "gc")[1].splitlines() == [
        "left unfinished: runs/cartpole/collect/.tmp-0123456789ab, 0 B",
        "1 leftover, 0 B",
        "removed",
    ]
    assert not left.exists()
