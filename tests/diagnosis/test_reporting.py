"""What the report states beside the effects: what was held out, and every model's share."""

import re
from dataclasses import replace

import pytest
from made_diagnoses import made_diagnosis

from gpsim.findings import HeldOutFit, OverBefore, Ratio, Rollout, StepErrors
from gpsim.recordings import Episode, HeldOut
from gpsim.reports.diagnosis_page import page
from gpsim.residuals import held_out_names

from .worlds import World, record


@pytest.fixture(scope="module")
def recording():
    return record(World("slider"), episodes=12, steps=60)


def test_every_held_out_episode_is_listed_in_the_order_of_its_number(recording):
    late = replace(recording, held_out=HeldOut(episodes_from=8))
    assert held_out_names(late) == ["8", "9", "10", "11"]
    assert held_out_names(replace(recording, held_out=None)) == ["10", "11"]
    whole = recording.episodes[0]
    brief = Episode("brief", whole.t[:3], whole.states[:3], whole.actions[:2])
    short = replace(late, episodes=(*late.episodes, brief))  # too short for a window, not for a single step
    assert held_out_names(short) == ["8", "9", "10", "11", "brief"]
    last = replace(recording, episodes=recording.episodes[:2], held_out=None)
    assert held_out_names(last) == ["1"]


@pytest.mark.parametrize(
    ("left", "said"),
    [
        (Ratio(0.5, 0.41, 0.6), "50 (41 to 60)"),
        (Ratio(0.5, None, None), "50"),
        (Ratio(None, None, None), ""),
    ],
)
def test_the_page_gives_every_models_share_of_the_bases_error(left, said):
    errors = StepErrors(before=1.0, after=0.5, unit="m", over_before=OverBefore(left, left, left, left))
    assert shown(errors) == {"base + GP": said, "noise floor": ""}
    assert shown(replace(errors, over_before=None)) == {"base + GP": "", "noise floor": ""}


def shown(errors):
    """Of the base's error, in per cent, as the page shows it."""
    fit = HeldOutFit((), {"q_acc": errors}, Rollout(1.0, {}))
    line = (
        page(made_diagnosis(fit=fit), {}, "found").split("of the base's, 90 % interval")[-1].split("</tr>")[0]
    )
    cells = dict(re.findall('<td data-head="([^"]*)">([^<]*)</td>', line))
    return {head: cells[head] for head in ("base + GP", "noise floor")}
