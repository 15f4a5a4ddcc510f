"""Odds: by how much the answer is ahead of the best that does without one of its effects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.judgement.ranking import Ranked
from gpsim.diagnosis.report import Odds


def odds_against(ranking: Sequence[Ranked], leader: Hypothesis, claim: tuple[str, str]) -> Odds:
    """The log posterior odds of the leader against the best without the claim, and which that is.

    Held-out windows count for those that are near, as they do for probabilities. Hypotheses that the search gave up
    count with its own, fewer windows: their odds are understated. Where the leader steps
    finely the rivals do, too: in coarse steps many a law passes for another. What is of no use is left out.
    """
    same = (r.behind for r in ranking if r.everything and r.hypothesis.claims == leader.claims)
    own = min(same, default=0.0)
    rivals = [r for r in ranking if claim not in r.hypothesis.claims and _as_fine(r.hypothesis, leader)]
    rivals = [r for r in rivals if not r.idle]
    if not rivals:
        return Odds(None, ())
    nats = [_behind(r, own) for r in rivals]
    best = int(np.argmin(nats))
    against = tuple((t.family, t.on) for t in rivals[best].hypothesis.terms)
    return Odds(round(nats[best], 2), against)


def _behind(rival: Ranked, own: float) -> float:
    """Nats that a rival is behind a leader, who is `own` behind the best."""
    if rival.in_all is not None:
        return rival.in_all
    return rival.behind - (own if rival.everything else 0.0)


def _as_fine(rival: Hypothesis, leader: Hypothesis) -> bool:
    return leader.scheme != "fine" or rival.scheme == "fine"
