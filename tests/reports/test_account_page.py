"""The page of a diagnosis: the account and two pictures first, everything else folded, nothing let in."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from pages import check_policy
from rich_diagnoses import RICH, ambiguous, friction, measured, named, partial, share

from gpsim.channels import Channels
from gpsim.findings import NotAsked, RankedHypothesis
from gpsim.reports.account import account_of
from gpsim.reports.diagnosis_figures import account_figures, parts
from gpsim.reports.diagnosis_page import page
from gpsim.traces import BASE, EFFECTS, Trace, Traces

pytestmark = pytest.mark.pictures

STATE = Channels.of({"x": "m", "x_dot": "m/s", "theta": "rad", "theta_dot": "rad/s"})
T = np.arange(0.0, 2.0, 0.02)


def rolled() -> Traces:
    real = np.column_stack([np.sin(T), np.cos(T)])
    said = {BASE: real + 0.3, EFFECTS: real + 0.01}
    errors = {model: np.ones(2) for model in said}
    return Traces((0, 1), 1.0, True, (Trace("17", "median of 9", True, T, real, said, errors),))


def told(diagnosis, **given):
    return page(diagnosis, account_figures(diagnosis, STATE, rolled()), "cartpole", **given)


def first_screen(text):
    return text.partition('<div class="folded">')[0]


def test_what_was_not_asked_is_folded_below():
    held = NotAsked(
        because="constant command", channel="force", value=2.0, unit="N", families=("actuator_gain",)
    )
    text = told(replace(named(), not_asked=(held,)))
    line = "force never changes (2 N); not asked: actuator gain"
    assert line in text
    assert line not in first_screen(text)
    assert "could not be asked" not in told(named())


def test_every_hypothesis_says_why_it_is_not_the_account_and_a_better_one_why_it_was_refused():
    def tried(behind, *families, refused=None, windows="all"):
        of = tuple((family, "x") for family in families)
        return RankedHypothesis(
            nats_behind=behind, effects=of, scheme="fine", windows=windows, refused=refused
        )

    found = replace(ambiguous(), ranking=(
        tried(0.0, "coulomb_friction", "spring"),
        tried(-348.0, "load_friction", refused="held-out data do not improve with load_friction on x"),
        tried(-3.0, "quadratic_drag"),  # a file of an earlier version
        tried(0.5, *(e.family for e in ambiguous().alternatives[0].effects)),
        tried(4.0, "coulomb_friction", "spring", "backlash"),
        tried(9.0, "backlash"),
        tried(0.0, "backlash", windows="search"),
    ))  # fmt: skip
    found = replace(found, alternatives=(
        replace(found.alternatives[0], effects=tuple(replace(e, on="x") for e in found.alternatives[0].effects)),
    ))  # fmt: skip
    text = told(found)
    ranked = text.partition("All hypotheses that were fitted")[2].partition("</pre>")[0]
    _, *rows = ranked.partition("<pre>")[2].splitlines()
    ends = [
        "chosen", "refused", "refused", "not ruled out", "costs more", "fits worse", "On the windows", "given up",
    ]  # fmt: skip
    for row, word in zip(rows, ends, strict=True):
        assert word in row or row.startswith("Rejected during the search")
    assert "(held-out data do not improve with load_friction on x)" in rows[1]
    assert "(this file gives no reason)" in rows[2]


@pytest.mark.parametrize("verdict", RICH)
def test_the_first_screen_is_the_account(verdict):
    diagnosis = RICH[verdict]()
    text = told(diagnosis)
    page_ = check_policy(text)
    screen = check_policy(first_screen(text)).text
    account = account_of(diagnosis)
    assert f"Verdict: {verdict}" in screen
    for sentence in (account.where, account.slight, *account.rivals, *account.left, *account.next):
        assert sentence in screen
    for row in account.rows:
        assert row.effect in screen
        assert row.percent in screen
    assert account.command is None or account.command in screen
    assert "nats" not in screen
    assert "{" not in re.sub(r"base64,[^\"]*", "", screen)
    assert [tag for tag, _ in page_.elements].count("details") >= 5
    assert all("open" not in attributes for tag, attributes in page_.elements if tag == "details")


@pytest.mark.parametrize(
    ("verdict", "titles"),
    [
        ("named", ["Real, base and corrected", "What the mismatch is made of"]),
        ("partial", ["Real, base and corrected", "What the mismatch is made of"]),
        ("unknown", ["Real and base"]),
        ("none", ["Real and base"]),
    ],
)
def test_its_pictures_stand_beside_it(verdict, titles):
    screen = check_policy(first_screen(told(RICH[verdict]())))
    assert [a["alt"] for tag, a in screen.elements if tag == "img"] == titles


def test_the_mismatch_is_the_sum_of_its_parts():
    found = {part.name: part.share for part in parts(named())}
    assert found == {
        "Coulomb friction on x": pytest.approx(0.74),
        "viscous friction on x": pytest.approx(0.19),
        "small corrections": pytest.approx(0.012),
        "left": pytest.approx(0.028),
    }
    many = tuple(friction(on=f"q{i}", importance=share(0.1)) for i in range(8))
    found = parts(replace(named(), effects=many))
    assert [part.name for part in found[-2:]] == ["2 more", "left"]
    assert found[-2].share == pytest.approx(0.2)


def test_a_picture_that_fails_does_not_take_the_others_with_it():
    broken = replace(partial(), effects=(friction(), measured(visited=()), measured()))
    failed = []

    class Contained:
        def __init__(self, name):
            self.name = name

        def __enter__(self):
            return None

        def __exit__(self, kind, *_):
            failed.extend([self.name] if kind else [])
            return True

    assert set(account_figures(broken, STATE, None, Contained)) == {"decomposition", "measured_2"}
    assert failed == ["measured_1"]


@pytest.mark.filterwarnings("error")
def test_names_are_drawn_letter_by_letter():
    """No formulas, no labels that begin with `_` and vanish, no warnings of letters that the font lacks."""
    odd = ("_$a$ 位", r"$\\frac{", "x" * 90)
    state = Channels.of(dict.fromkeys((*odd, "theta"), "m^2 $"))
    effects = tuple(friction(on=name) for name in odd)
    strange = measured(odd[0], quantity=odd[0], input=odd[1], unit=odd[2])
    found = replace(partial(), effects=(*effects, strange))
    drawn = account_figures(found, state, rolled())
    assert set(drawn) == {"held_out_rollout", "decomposition", "measured_1"}
    assert all(picture.png.startswith(b"\x89PNG") for picture in drawn.values())
