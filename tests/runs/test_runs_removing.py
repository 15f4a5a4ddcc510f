"""rm and gc: nothing that something else needs goes, nothing that is being made, and no half of an artifact stays."""

import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_runs import diagnosed, made, orphans, recorded, snapshot, spoil, whole_artifacts

from gpsim.artifacts import Recipe, Store, needed
from gpsim.errors import UsageError
from gpsim.runs import collect_garbage, garbage, named, read_catalogue, removal_of, remove

STAGES = ("train-source", "collect", "fit-gp", "evaluate")


@pytest.fixture
def root(tmp_path):
    return tmp_path / "runs"


def take_away(root: Path, *words: str, with_dependents: bool = False, beside: tuple[Path, ...] = ()):
    catalogue = read_catalogue(root, beside)
    asked = [named(catalogue, word) for word in words]
    return remove(catalogue, removal_of(catalogue, asked, with_dependents), beside)


def names(root: Path) -> list[str]:
    return sorted(path.relative_to(root).as_posix() for path in whole_artifacts(root))


@st.composite
def families(draw):
    """Artifacts, each resting on some of those before it; elsewhere, twins and recordings among them."""
    count = draw(st.integers(3, 8))
    return [
        {
            "stage": draw(st.sampled_from(STAGES)),
            "experiment": draw(st.sampled_from(["cartpole", "limo"])),
            "parents": draw(st.lists(st.integers(0, n - 1), max_size=3, unique=True)) if n else [],
            "how": draw(st.sampled_from(["plain", "plain", "plain", "twin", "elsewhere", "by files"])),
        }
        for n in range(count)
    ]


def build(family, root: Path, elsewhere: Path):
    built = []
    for n, member in enumerate(family):
        parents = {f"role{i}": built[i] for i in member["parents"]}
        more = {"experiment": member["experiment"]}
        if member["how"] == "by files":
            built.append(diagnosed(root, recorded(root, f"{n}\n"), n))
            continue
        if member["how"] == "elsewhere":
            built.append(made(root, member["stage"], n, parents, out=elsewhere / str(n), **more))
            continue
        built.append(made(root, member["stage"], n, parents, **more))
        if member["how"] == "twin":
            made(root, member["stage"], n, parents, code="later", **more)
    return built


@settings(max_examples=30, deadline=None)
@given(families(), st.data())
def test_whatever_is_removed_all_that_is_left_has_all_of_its_parents(family, data):
    with TemporaryDirectory() as place:
        root, elsewhere = Path(place) / "runs", Path(place) / "out"
        elsewhere.mkdir()
        build(family, root, elsewhere)
        assert not orphans(root, elsewhere)
        for _ in range(4):
            before = whole_artifacts(root, elsewhere)
            newest = {
                p.parent: p for p in sorted(before) if p.is_relative_to(root)
            }  # by number, all of one second
            if not before:
                break
            what = data.draw(st.sampled_from(["rm", "rm with all", "gc"]))
            if what == "gc":
                keep = data.draw(st.integers(0, 2))
                went = collect_garbage(root, keep, [elsewhere])
                assert keep == 0 or set(newest.values()) <= set(whole_artifacts(root))
            else:
                chosen = data.draw(
                    st.lists(st.sampled_from(sorted(before)), min_size=1, max_size=2, unique=True)
                )
                state = snapshot(Path(place))
                try:
                    went = take_away(
                        root, *map(str, chosen), with_dependents=what == "rm with all", beside=(elsewhere,)
                    )
                except UsageError as error:
                    assert what == "rm"
                    assert "needed by" in str(error)
                    assert snapshot(Path(place)) == state
                    continue
                assert {e.path for e in went.entries} >= set(chosen)
            after = whole_artifacts(root, elsewhere)
            assert set(before) - set(after) == {entry.path for entry in went.entries}
            assert not orphans(root, elsewhere)
            assert not list(Path(place).rglob(".removed-*"))


def test_what_was_written_elsewhere_counts_where_it_is_looked_for(root, tmp_path):
    recording = made(root, "collect", 1)
    made(root, "fit-gp", 1, {"recording": recording}, out=tmp_path / "mine" / "gp")
    with pytest.raises(UsageError, match=r"needed by .*mine/gp"):
        take_away(root, "collect/v1", beside=(tmp_path / "mine",))
    # A parent elsewhere is known from its child.
    parent = made(root, "import", 2, out=tmp_path / "drive")
    made(root, "diagnose", 2, {"recording": parent})
    assert str(tmp_path / "drive") in {entry.name for entry in read_catalogue(root).entries}
    with pytest.raises(UsageError, match="needed by cartpole/diagnose/v0001"):
        take_away(root, str(tmp_path / "drive"))


def test_what_is_broken_may_go_and_is_never_collected(root):
    parent = made(root, "collect", 1)
    child = made(root, "fit-gp", 1, {"recording": parent})
    made(root, "collect", 2)
    spoil(parent)
    assert garbage(read_catalogue(root), keep=1).entries == ()
    take_away(root, "collect/v1")
    assert child.path.is_dir()
    (child.path / "content.txt").unlink()
    assert [e.damage is not None for e in read_catalogue(root).entries if e.stage == "fit-gp"] == [True]


def test_newest_is_by_the_clock_not_by_a_number_that_was_free_again(root):
    for n in range(3):
        made(root, "collect", n)
    shutil.rmtree(root / "cartpole/collect/v0001")
    again = Store(root, "cartpole").publish(
        Recipe("collect", {"n": 9}, {}, {}), lambda folder: (folder / "a").touch(), number=1
    )
    timings = again.path / "timings.json"
    timings.write_text(
        timings.read_text().replace('"finished": "2', '"finished": "3')
    )  # a thousand years later
    collect_garbage(root, keep=1)
    assert names(root) == ["cartpole/collect/v0001"]


def test_nothing_of_which_something_is_being_made_goes(root):
    parent, other = made(root, "collect", 1), made(root, "collect", 2)
    seen = []

    def write(folder: Path) -> None:
        (folder / "a").touch()
        with pytest.raises(UsageError, match="cartpole/collect/v0001: a process is using it"):
            take_away(root, "collect/v1")
        dead = folder.with_name(".tmp-0123456789ab")
        dead.mkdir()
        seen.extend(entry.name for entry in collect_garbage(root, keep=0).entries)
        assert not dead.exists()
        assert folder.is_dir()
        kinds = sorted(left.kind for left in read_catalogue(root).leftovers)
        assert kinds == ["claimed", "making"]

    store = Store(root, "cartpole")
    recipe = Recipe("fit-gp", {}, {"recording": parent}, {})
    with store.claimed(recipe, lambda who: None):
        claims = list(root.rglob(".making-*.lock"))
        store.publish(recipe, write)
        assert claims
        assert list(root.rglob(".making-*.lock")) == claims
    assert seen == ["cartpole/collect/v0002"]
    assert not other.path.exists()
    assert not orphans(root)


def test_what_was_made_of_it_after_it_was_planned_stops_a_removal(root):
    parent = made(root, "collect", 1)
    catalogue = read_catalogue(root)
    removal = removal_of(catalogue, list(catalogue.entries))
    made(root, "fit-gp", 1, {"recording": parent})
    with pytest.raises(UsageError, match="cartpole/fit-gp/v0001: now needed by others"):
        remove(catalogue, removal)
    assert len(names(root)) == 2


def test_nothing_is_made_of_what_went_meanwhile(root):
    parent = made(root, "collect", 1)
    take_away(root, "collect/v1")
    with pytest.raises(UsageError, match="collect/v0001: removed before it could be used; run again"):
        made(root, "fit-gp", 1, {"recording": parent})
    assert not whole_artifacts(root)
    with pytest.raises(UsageError, match="removed before"), needed([parent.path]):
        pass


def test_removing_and_making_at_the_same_moment_leave_no_orphan(root):
    for turn in range(8):
        parent = made(root, "collect", turn)

        def child(n, parent=parent):
            try:
                made(root, "fit-gp", (n, parent.path.name, parent.digest), {"recording": parent})
            except UsageError as error:
                assert "removed before" in str(error)

        def gone(n, parent=parent):
            try:
                take_away(root, str(parent.path))
            except UsageError as error:
                assert any(text in str(error) for text in ("needed by", "being made", "meanwhile", "no such"))

        with ThreadPoolExecutor(4) as pool:
            for work in (child, gone, child, gone):
                pool.submit(work, turn).add_done_callback(lambda future: future.result())
        assert not orphans(root)


@pytest.mark.parametrize("after", [0, 1, 2])
def test_cut_off_a_removal_leaves_no_half_artifact_and_no_orphan(root, monkeypatch, after):
    parent = made(root, "collect", 1)
    child = made(root, "fit-gp", 1, {"recording": parent})
    calls = []
    rename = Path.rename

    def cut_off(path, target):
        if len(calls) == after:
            raise KeyboardInterrupt
        calls.append(path)
        return rename(path, target)

    def half(path, **options):
        next(p for p in sorted(path.rglob("*")) if p.is_file()).unlink()
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", cut_off)
        patch.setattr(shutil, "rmtree", half)
        with pytest.raises(KeyboardInterrupt):
            take_away(root, "collect/v1", with_dependents=True)
    assert calls == [child.path, parent.path][:after]
    assert not orphans(root)
    catalogue = read_catalogue(root)
    assert all(entry.whole for entry in catalogue.entries)
    assert len(catalogue.entries) == 2 - after
    assert [left.kind for left in catalogue.leftovers] == after * ["removing"]
    assert Store(root, "cartpole").find(Recipe("fit-gp", {"n": 1}, {"recording": parent}, {"seed": 0})) == (
        None if after else child
    )
    collect_garbage(root)
    assert not list(root.rglob(".removed-*"))


def test_what_cannot_be_renamed_is_one_line(root, monkeypatch):
    made(root, "collect", 1)

    def refused(path, target):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "rename", refused)
    with pytest.raises(UsageError, match=r"v0001: cannot be removed \(Permission denied\); make .* writable"):
        take_away(root, "collect/v1")


def test_unfinished_leftovers_go_and_other_programs_files_stay(root):
    made(root, "collect", 1)
    shelf = root / "cartpole/collect"
    dead = shelf / ".tmp-0123456789ab"
    dead.mkdir()
    (dead / "big").write_bytes(bytes(1000))
    for name in (".tmp-0123456789ab.lock", ".making-0123456789abcdef.lock", ".tmp-mine", ".hidden"):
        (shelf / name).touch()
    planned = garbage(read_catalogue(root))
    assert {left.path.name for left in planned.leftovers} == {dead.name, ".making-0123456789abcdef.lock"}
    assert planned.bytes == 1000
    collect_garbage(root)
    assert sorted(path.name for path in shelf.iterdir()) == [".hidden", ".tmp-mine", "v0001"]
