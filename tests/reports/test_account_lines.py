"""The account in a terminal: never more than 24 lines and 100 columns, whatever it holds."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from made_diagnoses import made_diagnosis, made_effect, made_location, made_remainder
from rich.cells import cell_len
from rich_diagnoses import RICH, friction, named, partial, stribeck

from gpsim.findings import (
    Alternative,
    Combination,
    Estimate,
    Explained,
    HeldOutFit,
    Odds,
    RemainderGp,
    Rollout,
    RolloutErrors,
    Share,
    StepErrors,
)
from gpsim.reports.account import account_of
from gpsim.reports.account_lines import COLUMNS, LINES, account_lines
from gpsim.reports.sheets import printable

NAMES = st.text(max_size=150) | st.sampled_from(
    ["x", "theta_dot", "位置" * 40, "/robot/arm/joint" * 9, "a\nb", "\x1b[31m"]
)
NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
SHARES = st.builds(
    Share, st.floats(-2, 2) | st.just(math.nan), st.none() | st.floats(-2, 2), st.none() | st.floats(-2, 2)
)
ESTIMATES = st.builds(
    Estimate, NUMBERS, st.none() | NUMBERS, st.none() | NUMBERS, st.text(max_size=30), st.booleans()
)
EFFECTS = st.builds(
    made_effect,
    family=st.sampled_from(["coulomb_friction", "stribeck_friction", "a_family_of_somebody_else_with_a_long_name"]),
    on=NAMES | st.tuples(NAMES, NAMES),
    parameters=st.dictionaries(st.text(max_size=60), ESTIMATES, max_size=5),
    region=st.dictionaries(NAMES, st.tuples(NUMBERS, NUMBERS), max_size=2),
    since=st.none() | st.floats(-1e12, 1e12),
    since_episode=st.none() | NAMES,
    importance=st.none() | SHARES,
    odds=st.none() | st.builds(Odds, st.none() | NUMBERS, st.just(())),
    role=st.sampled_from(["headline", "headline", "slight"]),
    form=st.sampled_from(["holds", "approximate", "untested"]),
)  # fmt: skip
STEPS = st.builds(StepErrors, before=NUMBERS, after=NUMBERS, noise_floor=NUMBERS, unit=st.text(max_size=40))
RUNS = st.builds(RolloutErrors, before=NUMBERS, after=NUMBERS, unit=st.text(max_size=40))
DIAGNOSES = st.builds(
    made_diagnosis,
    verdict=st.sampled_from(list(RICH)),
    location=st.builds(
        made_location,
        channels=st.dictionaries(NAMES, st.floats(-1, 2), max_size=9),
        region=st.dictionaries(NAMES, st.tuples(NUMBERS, NUMBERS), max_size=4),
        since_episode=st.none() | NAMES,
        depends_on=st.lists(NAMES, max_size=9).map(tuple),
    ),
    effects=st.lists(EFFECTS, max_size=12).map(tuple),
    alternatives=st.lists(
        st.builds(Alternative, st.lists(EFFECTS, max_size=3).map(tuple), st.floats(0, 1)), max_size=4
    ).map(tuple),
    tell_apart=st.none() | st.text(max_size=900).map("record {}".format),
    fit=st.builds(
        HeldOutFit,
        st.just(()),
        st.dictionaries(NAMES, STEPS, max_size=9),
        st.builds(Rollout, st.floats(0, 1e6), st.dictionaries(NAMES, RUNS, max_size=9)),
    ),
    remainder=st.builds(
        made_remainder,
        structured=st.booleans(),
        depends_on=st.lists(NAMES, max_size=9).map(tuple),
        share=st.none() | NUMBERS,
        rate=st.none() | NAMES,
        gp=st.none() | st.just(RemainderGp(True, "effects", None)),
    ),
    explained=st.builds(Explained, rollout=st.none() | SHARES, one_step=st.dictionaries(NAMES, SHARES, max_size=5)),
    combinations=st.lists(
        st.builds(
            Combination,
            of=st.lists(NAMES, min_size=1, max_size=4).map(tuple),
            fixed=st.just("") | NAMES,
            open=st.just("") | NAMES,
            exponents=st.lists(st.floats(-2, 2), max_size=4).map(tuple),
            value=st.none() | NUMBERS,
            low=st.none() | NUMBERS,
            high=st.none() | NUMBERS,
        ),
        max_size=5,
    ).map(tuple),
    log_facts=st.lists(NAMES, max_size=9).map(tuple),
    not_measured=st.lists(NAMES, max_size=9).map(tuple),
    thinned=st.sampled_from([1, 10]),
    dt=st.none() | st.floats(1e-6, 1e3),
)  # fmt: skip


def check(lines):
    assert len(lines) <= LINES
    for line in lines:
        assert cell_len(line) <= COLUMNS, line
        assert line == printable(line)
        assert "\n" not in line
        assert line == line.rstrip()


@settings(max_examples=60, deadline=None, phases=set(Phase) - {Phase.shrink, Phase.explain})
@given(DIAGNOSES, st.text(max_size=200))
def test_it_never_leaves_its_room(diagnosis, folder):
    lines = account_lines(account_of(diagnosis, folder))
    check(lines)
    heads = [line.split()[0] for line in lines if line[:1].strip()]
    assert heads == [h for h in ("Verdict", "Where", "What", "Left", "Fit", "Next") if h in heads]
    assert {"Verdict", "Where", "Left", "Fit", "Next"} <= set(heads)


@pytest.mark.parametrize("verdict", RICH)
def test_every_verdict_is_told_whole(verdict):
    lines = account_lines(account_of(RICH[verdict](), "runs/cartpole/diagnose/v0001"))
    check(lines)
    assert not any(
        "…" in line and "Stribeck" not in line and "stri" not in line and "stati" not in line
        for line in lines
    )


def test_many_effects_are_cut_in_a_fixed_order():
    """First what a second line says, then rows: how many are not shown is said, and no part is lost."""
    many = tuple(stribeck(on=f"joint_{i}", importance=Share(0.09 - 0.001 * i)) for i in range(10))
    lines = account_lines(account_of(replace(partial(), effects=many)))
    check(lines)
    shown = [line for line in lines if "Stribeck" in line and "not tested" in line]
    assert len(shown) == 7
    assert "joint_0" in shown[0]
    assert any(line.strip() == "… and 3 more in report.html" for line in lines)
    assert any(line.startswith("Next") for line in lines)


def test_a_long_name_is_wrapped_and_not_cut():
    joint = "rotor_inertia_of_the_shoulder_lift_joint_of_the_left_arm"
    lines = account_lines(account_of(replace(named(), effects=(friction(on=joint),)), "runs/found"))
    check(lines)
    start = next(i for i, line in enumerate(lines) if line.startswith("What"))
    told = [line[9:].split("  ")[0] for line in lines[start + 1 : start + 4]]
    assert joint in "".join(told)


def test_a_folder_that_is_too_long_for_a_line_is_dir():
    short, long = "runs/found", "/a/long/path" * 20
    assert any(
        line.endswith(f"diagnosis={short} correction=effects+gp")
        for line in account_lines(account_of(partial(), short))
    )
    (line,) = [line for line in account_lines(account_of(partial(), long)) if "train-gp-policy" in line]
    assert line.strip() == "gpsim train-gp-policy diagnosis=DIR correction=effects+gp"
