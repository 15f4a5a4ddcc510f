"""What a diagnosis leaves open, as simulators to draw: each explanation with its probability and how its sizes vary."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gpsim.corrected import EffectsPlant, Explanation, Size, Spread
from gpsim.diagnosis.assessment import correlations
from gpsim.diagnosis.fitting import Fit
from gpsim.diagnosis.judgement import Judgement
from gpsim.diagnosis.report import Diagnosis, Estimate, NamedEffect
from gpsim.diagnosis.setup import Question
from gpsim.effects import base_name, own_name, owner_of


def posterior(
    question: Question, judgement: Judgement, diagnosis: Diagnosis, plant: EffectsPlant
) -> tuple[Explanation, ...]:
    """The leading explanation, then its rivals. plant: the corrected simulator of the leader.

    Intervals are the account's, with all that widens them; correlations are the fit's.
    """
    told = [diagnosis.effects, *(rival.effects for rival in diagnosis.alternatives)]
    fits = [judgement.leader, *judgement.rivals]
    return tuple(
        _explanation(question, found, probability, effects, plant)
        for found, probability, effects in zip(fits, judgement.probabilities, told, strict=True)
    )


def _explanation(
    question: Question, found: Fit, probability: float, effects: Sequence[NamedEffect], plant: EffectsPlant
) -> Explanation:
    """Of several recordings, the machine as it is in the last one: as its corrected simulator."""
    names = [source.name for source in question.recording.sources]
    last = len(names) - 1 if names else None
    hypothesis = found.hypothesis
    terms = tuple(term.in_recording(last) for term in hypothesis.terms)
    sizes, rows, at = [], [], 0
    for i, (declared, effect) in enumerate(zip(hypothesis.declared, effects, strict=True)):
        own = {base_name(p.name) for p in declared if last is not None and owner_of(p.name) == last}
        for j, parameter in enumerate(declared):
            name = base_name(parameter.name)
            if parameter.name != (own_name(name, last) if last is not None and name in own else name):
                continue  # another recording's, or one that this recording has its own value of
            estimate = (effect.own or {}).get(names[last], {}).get(name) if last is not None and own else None
            estimate = estimate or effect.parameters[name]
            sizes.append(_size(i, name, estimate, parameter.low, parameter.high))
            rows.append(at + j)
        at += len(declared)
    every = correlations(question.everything, found) if rows else np.empty((0, 0))
    scheme = hypothesis.scheme if terms else plant.scheme
    spread = Spread(tuple(sizes), every[np.ix_(rows, rows)], question.run.settings.intervals.level)
    return Explanation(replace(plant, terms=terms, scheme=scheme), probability, spread)


def _size(term: int, name: str, estimate: Estimate, least: float, most: float) -> Size:
    low, high = (math.nan if edge is None else edge for edge in (estimate.low, estimate.high))
    return Size(term, name, estimate.value, low, high, least, most)
