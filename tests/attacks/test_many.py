"""Hundreds of hostile files, seeded: whatever they hold, a documented exit code and at most a few lines, no traceback."""

import pytest
from attacking import all_said
from hostile_variants import MAKERS, TEXTS, variants

FEW, MANY = range(2), range(2, 32)


def check(folder, kinds, numbers):
    calls = [variant.words for kind in kinds for variant in variants(folder, kind, numbers)]
    for said in all_said(calls, folder):
        said.check()
    return len(calls)


def test_a_few_of_every_kind(tmp_path):
    if "mujoco" in skipped():
        pytest.skip("needs mujoco")
    assert check(tmp_path, [*TEXTS, "a.mcap", "log.mat"], FEW) == 10


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*TEXTS, *MAKERS])
def test_many_of_a_kind(tmp_path, kind):
    if kind == "xml" and skipped():
        pytest.skip("needs mujoco")
    assert check(tmp_path, [kind], range(2, 92) if kind in TEXTS else MANY) >= 30


def skipped():
    try:
        import mujoco  # noqa: F401
    except ImportError:
        return ["mujoco"]
    return []
