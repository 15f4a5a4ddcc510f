"""Measured curves in words and as a picture."""

from gpsim.findings import Estimate, MeasuredCurve, NamedEffect
from gpsim.reports.account_effects import beyond, curve_sentence, effect_name, slight_text
from gpsim.reports.canvas import style
from gpsim.reports.diagnosis_figures import measured_picture

ABOUT = {"quantity": "force on q", "unit": "N", "input": "q_dot", "input_unit": "m/s", "freedom": 8.1}
CURVE = MeasuredCurve(
    **ABOUT,
    at=(-0.64, -0.36, 0.0, 0.5),
    values=(2.2, 3.07, 0.0, -2.94),
    low=(2.0, 3.0, -0.1, -3.0),
    high=(2.4, 3.1, 0.1, -2.8),
    visited=(-0.64, 0.5),
)
MAP = MeasuredCurve(
    **ABOUT, at=(-1.0, 1.0), values=(-0.5, 0.5, -1.0, 1.0), visited=(-1.0, 1.0)
)  # of earlier versions


def effect(curve):
    return NamedEffect(
        family="force_curve",
        on="q",
        site="force",
        parameters={"scale": Estimate(1.0, 0.99, 1.01, "1")},
        region={},
        since=None,
        probability=1.0,
        evidence_gain=100.0,
        explains=1.0,
        form="approximate",
        curve=curve,
    )


def test_a_sentence_says_where_it_goes():
    said = curve_sentence(effect(CURVE))
    assert said.startswith(
        "no catalogue law for force on q over q_dot; it goes from 2.2 N at q_dot = -0.64 m/s over "
    )
    assert said.endswith("3.07 at -0.36 to -2.94 at 0.5")
    assert effect_name(effect(CURVE)) == "measured force on q"


def test_a_table_has_its_extent_and_so_has_the_sentence_of_a_map():
    assert slight_text([effect(CURVE)]).endswith("measured force on q (-2.94 to 3.07 N)")
    assert curve_sentence(effect(MAP)).endswith("; it lies between -1 and 1 N")


def test_what_to_record_next_lies_beyond_what_was_measured():
    assert beyond(CURVE).startswith("record q_dot beyond [-0.64, 0.5] m/s, ")


def test_a_picture_is_drawn_with_a_caption_that_says_where_it_is_a_guess():
    with style():
        curve = measured_picture(effect(CURVE))
    assert "extrapolation" in curve.caption
    assert "8 effective parameters" in curve.caption
