"""Judgement: the leading account, what else was tried and how far that is behind, and whether anything is left over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Fit, Hypothesis
from gpsim.diagnosis.settings import VerdictSettings
from gpsim.effects import CURVES, Gate, Moment
from gpsim.findings import Claims, Odds, RankedHypothesis


@dataclass(frozen=True)
class Tried:
    """An account that was fitted: nats that it is behind the leader, its prices paid; refused: why it does not lead."""

    hypothesis: Hypothesis
    behind: float
    refused: str = ""

    @property
    def entry(self) -> RankedHypothesis:
        """As it is reported. gates: for each effect `time`, the channel of its region, or nothing."""
        terms = self.hypothesis.terms
        return RankedHypothesis(
            nats_behind=round(self.behind, 2),
            effects=tuple((t.family, t.on) for t in terms),
            gates=tuple(_limited_in(t.gate) for t in terms),
            scheme=self.hypothesis.scheme,
            windows="all",
            refused=self.refused or None,
        )


@dataclass(frozen=True)
class Judgement:
    """The leading fit; the base integrated as it is (null); the leader without each of its terms, others fitted anew.

    rivals: accounts that these data cannot rule out; probabilities: of the leader, then of each of them; ranking: all
    that was tried, the best first; noise: (S,) standard deviation that is taken for noise; structured: whether
    something is left over that chance would not make, by p_value.
    """

    leader: Fit
    null: Fit
    without: tuple[Hypothesis, ...]
    gains: tuple[float, ...]
    rivals: tuple[Fit, ...]
    probabilities: tuple[float, ...]
    ranking: tuple[Tried, ...]
    noise: FloatArray
    p_value: float
    structured: bool


def claims_of(hypothesis: Hypothesis) -> Claims:
    """Family and place of each of its terms."""
    return tuple((t.family, t.on) for t in hypothesis.terms)


def odds_against(ranking: Sequence[Tried], leader: Hypothesis, claim: tuple[str, str]) -> Odds:
    """The log odds of the leader against the best account without a claim, and which that is.

    Of a measured curve none: it stands on top of whichever laws are right.
    """
    if claim[0] in CURVES:
        return Odds(None, ())
    rivals = [r for r in ranking if claim not in r.hypothesis.claims and not r.refused]
    if not rivals:
        return Odds(None, ())
    best = min(rivals, key=lambda r: r.behind)
    return Odds(round(best.behind, 2), claims_of(best.hypothesis))


def rivals_among(tried: Sequence[Tried], leader: Hypothesis, settings: VerdictSettings) -> list[Tried]:
    """Accounts that cannot be ruled out: near the leader, and not the leader, or one another, with something added."""
    out: list[Tried] = []
    for one in sorted(tried, key=lambda t: t.behind):
        said = [leader.claims, *(r.hypothesis.claims for r in out)]
        fresh = not any(claims <= one.hypothesis.claims for claims in said)
        if one.behind < settings.tie and fresh and not one.refused and len(out) < settings.rivals:
            out.append(one)
    return out


def probabilities_of(rivals: Sequence[Tried]) -> tuple[float, ...]:
    """Of the leader, then of its rivals."""
    weights = np.array([1.0, *(np.exp(-r.behind) for r in rivals)])
    return tuple(float(w) for w in weights / weights.sum())


def _limited_in(gate: Gate) -> str:
    if not gate:
        return ""
    at = gate.looks_at
    return "time" if at is None else at.value if isinstance(at, Moment) else at
