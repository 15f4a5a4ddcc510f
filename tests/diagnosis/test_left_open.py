"""What a diagnosis leaves open on disk, as earlier versions wrote it, and as simulators that are drawn."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from made_posteriors import LAG_OR_DELAY, made_plant, made_posterior

from gpsim.effects import to_json
from gpsim.errors import UsageError
from gpsim.posterior import from_two_files, left_open_data, left_open_from


def written(posterior):
    return json.loads(json.dumps(left_open_data(posterior)))


def test_a_posterior_is_what_it_was_after_a_file():
    posterior = made_posterior(*LAG_OR_DELAY)
    again = left_open_from(written(posterior), "posterior.json")
    assert left_open_data(again) == left_open_data(posterior)
    assert again.explanations[0].hypothesis == posterior.explanations[0].hypothesis


def test_the_two_files_of_earlier_versions_are_the_one_of_today():
    """Their posterior.json had the intervals, and terms that do nothing; left_open.json all else."""
    posterior = made_posterior(*LAG_OR_DELAY)
    today = written(posterior)
    planned = {k: v for k, v in today.items() if k != "level"} | {"schema": "gpsim.left_open/1"}
    idle = {"family": "constant_force", "on": "q"}
    drawn = [
        {
            "terms": [idle, *map(to_json, one.hypothesis.terms)],
            "parameters": [
                {"term": i + 1, "name": p.name, "low": low, "high": high}
                for (i, p), (low, high) in zip(
                    [(i, p) for i, group in enumerate(one.hypothesis.declared) for p in group],
                    one.intervals.tolist(),
                    strict=True,
                )
            ],
        }
        for one in posterior.explanations
    ]
    planned["explanations"] = [
        {k: v for k, v in entry.items() if k != "intervals"} for entry in today["explanations"]
    ]
    older = {"schema": "gpsim.posterior/1", "explanations": drawn}
    assert from_two_files(older, planned) == today
    drawn[0]["parameters"][0]["low"] = None
    assert np.isnan(left_open_from(from_two_files(older, planned), "").explanations[0].intervals[0, 0])


def test_drawn_simulators_are_the_explanations_with_their_intervals():
    posterior = made_posterior(*LAG_OR_DELAY)
    leader = made_plant(posterior)
    drawn = posterior.drawn_in(leader, "found").explanations
    assert [e.plant.terms for e in drawn] == [e.hypothesis.terms for e in posterior.explanations]
    assert [e.probability for e in drawn] == [0.5, 0.5]
    assert drawn[0].spread.level == 0.9
    first = posterior.explanations[0]
    assert [[s.low, s.high] for s in drawn[0].spread.sizes] == first.intervals.tolist()
    assert [asdict(s)["value"] for s in drawn[0].spread.sizes] == first.hypothesis.theta.tolist()
    np.testing.assert_allclose(drawn[0].spread.correlations, np.eye(len(first.covariance)))


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (
            lambda e: e["intervals"][0].__setitem__(0, "nan"),
            "the recording does not determine damping",
        ),
        (lambda e: e["covariance"][0].__setitem__(1, "nan"), "correlations are not finite"),
        (lambda e: e.pop("terms"), "not a posterior that this version can read"),
        (lambda e: e.update(probability=-0.6), "no explanation has a probability"),
    ],
)
def test_a_posterior_that_cannot_be_drawn_from_is_one_line(spoil, said):
    posterior = made_posterior(*LAG_OR_DELAY)
    content = written(posterior)
    spoil(content["explanations"][0])
    with pytest.raises(UsageError, match=said) as refused:
        left_open_from(content, "there").drawn_in(made_plant(posterior), "there")
    assert str(refused.value).startswith("there: ")
    assert "\n" not in str(refused.value)


def test_what_has_no_effect_is_drawn_in_the_base_simulators_own_scheme():
    posterior = made_posterior({})
    bare = replace(
        posterior.explanations[0],
        hypothesis=replace(posterior.explanations[0].hypothesis, terms=(), declared=()),
        covariance=np.empty((0, 0)),
        intervals=np.empty((0, 2)),
    )
    leader = replace(made_plant(posterior), terms=(), scheme="euler")
    assert (
        replace(posterior, explanations=(bare,)).drawn_in(leader, "").explanations[0].plant.scheme == "euler"
    )
