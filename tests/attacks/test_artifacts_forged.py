"""Artifacts that somebody spoilt on purpose: one line each, nothing waited for, nothing lost beside them."""

import hashlib
import json
import os
import signal
import sys
from contextlib import contextmanager

import numpy as np
import pytest
from gpsim.cli.main import main

from gpsim.artifacts import MANIFEST, TIMINGS, Recipe, Store, read_artifact, read_timings
from gpsim.errors import UsageError
from gpsim.files import canonical, read_object
from gpsim.policies import Policy
from gpsim.stages.policy_files import read_policy, write_policy

DEEP = "[" * 100_000
PATIENCE = 20  # s after which a read is taken to wait for ever


@contextmanager
def impatient():
    """What waits on a pipe is a failure, not a test that never ends."""

    def give_up(*_):
        raise AssertionError("it waits for ever")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def write(folder):
    (folder / "fit.json").write_text("{}")
    (folder / "deep").mkdir()
    (folder / "deep" / "b.bin").write_bytes(bytes(64))
    return {"transitions": 3}


@pytest.fixture
def made(tmp_path):
    return Store(tmp_path / "runs", "cartpole").publish(Recipe("fit-gp", {"n": 1}, {}, {"seed": 0}), write)


@pytest.fixture
def said(monkeypatch, capsys):
    def run(*words):
        monkeypatch.setattr(sys, "argv", ["gpsim", *map(str, words)])
        with impatient(), pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code or 0, *capsys.readouterr()

    return run


def sealed(**changed):
    """A manifest that is of another shape and says the right hash of itself."""

    def change(text):
        manifest = json.loads(text) | changed
        manifest.pop("sha256")
        return json.dumps(manifest | {"sha256": hashlib.sha256(canonical(manifest)).hexdigest()})

    return change


MANIFESTS = {
    "a list": lambda text: "[]",
    "a text": lambda text: '"gpsim.artifact/1"',
    "a number": lambda text: "1e999",
    "nothing": lambda text: "",
    "100 000 levels": lambda text: '{"schema": "gpsim.artifact/1", "files": ' + DEEP,
    "levels that close": lambda text: '{"schema": "gpsim.artifact/1", "a": ' + "[" * 900 + "]" * 900 + "}",
    "files: list": sealed(files=["fit.json"]),
    "files: number": sealed(files={"fit.json": 3}),
    "stage: list": sealed(stage=[]),
    "key: null": sealed(key=None),
    "parents: list": sealed(parents=[{}]),
    "parents: text": sealed(parents={"gp": "x"}),
    "config: text": sealed(config="x"),
    "seeds: number": sealed(seeds=1),
}
POLICY = '{"format": "gpsim.policy/1", "activation": "tanh", "layers": %s}'
COMMANDS = [("runs", "list", "--verify"), ("runs", "gc", "--keep", "0", "--dry-run")]


@pytest.mark.parametrize("manifest", MANIFESTS)
def test_a_manifest_of_another_shape_is_one_line(made, manifest, said):
    path = made.path / MANIFEST
    path.write_text(MANIFESTS[manifest](path.read_text()))
    with pytest.raises(UsageError, match=r"manifest\.json: (damaged|changed)") as refused:
        read_artifact(made.path)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 1000
    for words in COMMANDS:
        code, out, err = said(*words)
        assert code in (0, 2), (words, err)
        assert "Traceback" not in out + err
    assert (made.path / "fit.json").is_file()


LINKS = {"a link to nothing": "nowhere", "a link to a folder": "/", "a link to a file": "fit.json"}
THINGS = ["a pipe", "a link to a pipe", "a link to itself", *LINKS]


def put(thing, path):
    """Something that is no file, in this place."""
    pipe = path if thing == "a pipe" else path.parent.parent / ".pipe"
    if "pipe" in thing:
        os.mkfifo(pipe)
    if "link" in thing:
        path.symlink_to({"a link to a pipe": pipe, "a link to itself": path.name, **LINKS}[thing])


@pytest.mark.parametrize("thing", THINGS)
def test_what_is_no_file_is_noticed_and_not_opened(made, thing):
    put(thing, made.path / "more")
    with impatient(), pytest.raises(UsageError, match="more: added after it was written; remove that file"):
        read_artifact(made.path)


@pytest.mark.parametrize("thing", THINGS)
@pytest.mark.parametrize("name", [MANIFEST, TIMINGS, "fit.json"])
def test_in_the_place_of_a_file_it_is_not_waited_for(made, thing, name, said):
    (made.path / name).unlink(missing_ok=True)
    put(thing, made.path / name)
    for words in COMMANDS:
        code, out, err = said(*words)
        assert code in (0, 2), (words, err)
        assert "Traceback" not in out + err
    with impatient():
        if name != TIMINGS:
            with pytest.raises(UsageError):
                read_artifact(made.path)
        else:
            assert read_artifact(made.path).digest == made.digest


@pytest.mark.parametrize(
    "timings",
    [
        *("[]", '"text"', "3", DEEP),
        '{"seconds": [], "finished": 3, "parents": []}',
        '{"parents": {"gp": [1]}}',
        '{"finished": "tomorrow", "parents": {"gp": "\\u0000"}, "transitions": {}}',
    ],
)
def test_facts_of_the_clock_of_another_kind_are_no_facts(made, timings, said):
    (made.path / TIMINGS).write_text(timings)
    assert not {"seconds"} & set(read_timings(made.path))
    for words in COMMANDS:
        code, out, err = said(*words)
        assert code == 0, (words, err)
        assert "Traceback" not in out + err


@pytest.mark.parametrize(
    "content",
    [
        *("[]", '"text"', "3", "null", DEEP, "{}"),
        *(POLICY % value for value in ('"x"', "[]", "{}", "null", "1e999")),
    ],
)
def test_a_policy_of_another_shape_is_one_line(tmp_path, content, a_policy):
    write_policy(tmp_path, a_policy)
    assert read_policy(tmp_path)
    (tmp_path / "policy.json").write_text(content)
    with pytest.raises(UsageError) as refused:
        read_policy(tmp_path)
    assert "\n" not in str(refused.value)


@pytest.fixture
def a_policy():
    weights = {"layer.0.weight": np.ones((2, 4), np.float32), "layer.0.bias": np.zeros(2, np.float32)}
    return Policy(weights, np.ones(4, np.float32))


def test_a_large_file_is_not_read(tmp_path):
    with (tmp_path / "big.json").open("wb") as stream:
        stream.truncate(1 << 34)
    with pytest.raises(UsageError, match=r"big\.json: 17179869184 bytes; the limit is"):
        read_object(tmp_path / "big.json")


def test_gc_follows_no_link_into_another_project(tmp_path, made, said):
    other = Store(tmp_path / "other" / "runs", "cartpole")
    theirs = [other.publish(Recipe("fit-gp", {"n": n}, {}, {"seed": 0}), write).path for n in range(3)]
    begun = other.root / "cartpole" / "fit-gp" / ".tmp-0123456789ab"
    begun.mkdir()
    runs = tmp_path / "runs"
    (runs / "linked").symlink_to(other.root / "cartpole")
    (runs / "cartpole" / "borrowed").symlink_to(other.root / "cartpole" / "fit-gp")
    (runs / "cartpole" / "fit-gp" / "v0007").symlink_to(theirs[0])
    (runs / "cartpole" / "fit-gp" / ".tmp-abcdefabcdef").symlink_to(theirs[1])
    (runs / "cartpole" / "fit-gp" / ".removed-abcdefabcdef").symlink_to(theirs[2])
    code, _, err = said("runs", "gc", "--keep", "0", "--yes")
    assert (code, err) == (0, "")
    for path in theirs:
        read_artifact(path)
    assert begun.is_dir()
    assert not made.path.exists()  # ours


def test_gc_of_a_runs_folder_that_is_a_link_does_its_work(tmp_path, made, said):
    (tmp_path / "here").symlink_to(tmp_path / "runs")
    code, *_ = said("runs", "gc", "--keep", "0", "--yes", "--runs-dir", "here")
    assert code == 0
    assert not made.path.exists()


def test_names_are_shown_escaped(made, said):
    (made.path / "a\x1b[2J\nerror: b").touch()
    code, out, _ = said("runs", "list", "--verify")
    assert code == 0
    assert "\x1b[2J" not in out
    assert "\nerror: b" not in out
