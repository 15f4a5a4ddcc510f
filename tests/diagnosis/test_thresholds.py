"""No threshold is hidden in a module: what stays a constant says why, and every setting is read by some step."""

import ast
import dataclasses
import io
import tokenize
from pathlib import Path

import numpy as np
import pytest

from gpsim.diagnosis.data import cut
from gpsim.diagnosis.fitting import descent
from gpsim.diagnosis.run import Memo, Run, budget
from gpsim.diagnosis.settings import Settings, read_settings
from gpsim.diagnosis.setup import prepare
from gpsim.errors import UsageError
from gpsim.simulators import make_simulator

from .worlds import World, record

ROOT = Path(__file__).resolve().parents[2]
DIAGNOSIS = ROOT / "gpsim/diagnosis"
FILES = sorted(DIAGNOSIS.rglob("*.py"))


def unexplained(source):
    """Lines of module constants that hold a number, without a comment on their lines or a docstring below them."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    commented = {t.start[0] for t in tokens if t.type == tokenize.COMMENT}
    body = ast.parse(source).body
    for node, below in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign | ast.AnnAssign) or not node.value:
            continue
        numbers = [
            n for n in ast.walk(node.value) if isinstance(n, ast.Constant) and type(n.value) in (int, float)
        ]
        said = commented & set(range(node.lineno, node.end_lineno + 1))
        documented = (
            isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
            and isinstance(below.value.value, str)
        )
        if numbers and not said and not documented:
            yield node.lineno


def test_a_number_that_a_module_keeps_says_why():
    wrong = {path: list(unexplained(path.read_text(encoding="utf-8"))) for path in FILES}
    wrong = {path.relative_to(ROOT): lines for path, lines in wrong.items() if lines}
    assert not wrong, "no reason beside the constants in these lines; or make them settings"


@pytest.mark.parametrize(
    ("source", "lines"),
    [
        ("A = 3.0\n", [1]),
        ("A: float = -3.0\nB, C = 1, 'c'\n", [1, 2]),
        ("A = (\n    1.0,\n    2.0,\n)\n", [1]),
        ("A = {'a': 1}\n", [1]),
        ("A = 3.0  # m/s\n", []),
        ("A = (\n    1.0,  # m/s\n)\n", []),
        ('A = 3.0\n"""A speed."""\n', []),
        ("A = 'text'\nB = True\nclass C:\n    d = 3\n", []),
    ],
)
def test_what_counts_as_a_reason(source, lines):
    assert list(unexplained(source)) == lines


def test_every_setting_is_read_by_some_step():
    read = {
        node.attr
        for path in FILES
        if path.parent.name != "settings"
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute)
    }
    for step in dataclasses.fields(Settings):
        assert step.name in read, f"nobody reads the settings of {step.name}"
        unread = [f.name for f in dataclasses.fields(step.default_factory) if f.name not in read]
        assert not unread, f"nobody reads {unread} of {step.name}"


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"windows": {"at_once": 0}}, "diagnose.windows.at_once: expected at least 1, got 0"),
        ({"candidates": {"reach": -2.0}}, "diagnose.candidates.reach: expected at least 0, got -2.0"),
        ({"black_box": {"more": 95.0}}, "diagnose.black_box: more is a share of at most 1, got 95.0"),
        ({"intervals": {"level": float("nan")}}, "diagnose.intervals.level: expected at least 0, got nan"),
        ({"discretisation": {"substeps": []}}, "diagnose.discretisation: substeps is empty"),
        ({"discretisation": {"substeps": [0, 2]}}, "diagnose.discretisation.substeps: expected at least 1, got 0"),
    ],
)  # fmt: skip
def test_what_a_step_cannot_work_with_is_refused(values, said):
    with pytest.raises(UsageError) as caught:
        read_settings(values)
    assert str(caught.value) == said


def test_a_run_counts_what_it_simulates():
    run, plain = (
        Run(),
        2 * (budget.SUBSTEP_OVERHEAD + 10) * (budget.COST_PER_ROW + 2 * budget.COST_PER_CHANNEL),
    )
    run.budget.spend(10, 2, channels=2, dry=True, owned=False)
    assert run.budget.spent == plain * budget.DRY_FRICTION_FACTOR
    run.budget.spend(10, 2, channels=2, dry=False, owned=True)
    assert run.budget.spent == plain * (budget.DRY_FRICTION_FACTOR + budget.CLOSED_STEP_FACTOR)


def test_so_many_answers_are_remembered():
    asked, first, second = [], object(), object()
    memo = Memo(1)
    for what in (first, second, first):
        memo.answer(asked.append, (what,))
    assert asked == [first, second, first]


def test_windows_are_as_long_as_the_settings_say_and_the_search_sees_as_many():
    recording = record(World("slider"), seed=1, episodes=4, steps=120, noise=0.05)
    simulator = make_simulator("slider")
    settings = read_settings({"windows": {"length": 10}, "prepare": {"searched": 7, "fitted": 9}})
    assert cut(recording, settings.windows).length == 10
    question = prepare(recording, simulator, simulator.defaults(recording.parameters), Run(settings=settings))
    assert question.everything.windows.length in (10, 20)  # twice where noise hides what happens in one
    assert len(question.searched.windows) == 7
    assert len(question.everything.windows) == 9


def test_the_patterns_reach_as_far_as_twelve_steps_and_the_first_one_misses_none_between():
    far = [p for p in descent.FIRST_PATTERN if p >= 2.0]
    np.testing.assert_array_equal(far, np.arange(12.0, 1.5, -0.5))
    assert set(descent.PATTERN) <= set(descent.FIRST_PATTERN)
