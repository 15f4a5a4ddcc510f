"""The verdict: what may be said of an account, by how much of the mismatch it explains.

Whether something is left over is another question: with a real robot, or a clean sensor, something always is. The first
that holds:

1. `none`: no effect stands, and nothing is left that chance would not make, or it shows in no channel.
2. `unknown`: the effects surely explain less than `half`, or are no better than the base on held-out data.
3. `partial`: they surely explain less than `nearly_all`, or than `half` of one channel, the law of a headline effect
   holds approximately only, its size stopped at a bound, is not known or is one that no machine has, none is a claim by
   itself, or a model that names nothing foresees much more.
4. `ambiguous`: other explanations are not excluded, of what leads, or the odds against one are low.
5. `named`.

Surely: the whole 90 % interval lies below, and there is something to explain: where no rollout shows a mismatch and
nothing structured is left, a share of the fit windows is one of noise. Of what leads: rivals that have every headline
effect, as large, and say other things of the slight ones leave the claims as they are. The numbers: `VerdictSettings`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

from gpsim.diagnosis.attribution import Attribution
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.judgement.judgement import Judgement
from gpsim.diagnosis.report import Doubt, Share, StepErrors, Verdict
from gpsim.diagnosis.settings import Known, Settings
from gpsim.effects import Term

WORSE_ONE_STEP = 1.2
"""Times the base's error one step ahead: an account that surely makes more of it is not told."""
ALIKE = 0.2
"""Of what a headline effect does, by which rivals may differ in its size and claim the same (as far as a law may
depart from its curve; a Limo's delay is 0.27 s, or 0.13 s beside a lag)."""


def verdict_of(
    judgement: Judgement, attribution: Attribution, doubts: Collection[Doubt], settings: Settings
) -> Verdict:
    """By the rules above; doubts: what keeps it from being named. Whether it beats the base was asked before."""
    thresholds = settings.verdict
    if not judgement.leader.hypothesis.terms:
        return "unknown" if judgement.structured and attribution.explained.counts else "none"
    if misses(judgement, attribution, thresholds.half):
        return "unknown"
    if any(doubt != "odds" for doubt in doubts):
        return "partial"
    return "ambiguous" if doubts or contested(judgement, attribution, ALIKE) else "named"


def as_far_as_asked(verdict: Verdict, attribution: Attribution, known: Known) -> Verdict:
    """`unknown` for a `none` beside a mismatch that stands out of the noise, where families were left out."""
    limited = bool(known.only or known.without)
    return "unknown" if verdict == "none" and limited and attribution.explained.counts else verdict


def contested(judgement: Judgement, attribution: Attribution, alike: float) -> bool:
    """Whether a rival lacks one of the headline effects, or has it of another size; any counts where nothing leads.

    alike: share of what the leader's size does, by which a rival's may differ.
    """
    leader = judgement.leader.hypothesis
    leading = [i for i, role in enumerate(attribution.roles) if role == "headline"]

    def shares(rival: Hypothesis) -> bool:
        at = {term.identity: term for term in rival.terms}
        return all(_as_large(leader, i, at.get(leader.terms[i].identity), alike) for i in leading)

    return any(not leading or not shares(rival.hypothesis) for rival in judgement.rivals)


def _as_large(leader: Hypothesis, index: int, other: Term | None, alike: float) -> bool:
    """Whether another explanation has a term of the leader's, and each of its sizes; where it acts may differ."""
    if other is None:
        return False
    own = leader.terms[index].values
    sizes = [p for p in leader.declared[index] if not p.place and p.name in other.values]
    return all(abs(other.values[p.name] - own[p.name]) <= alike * abs(own[p.name] - p.none) for p in sizes)


def beats_the_base(attribution: Attribution, one_step: Iterable[StepErrors]) -> bool:
    """Whether an account is worth telling: better on rollouts, and in no rate much worse one step ahead.

    A wrong law may take off what windows show and make every single step worse.
    """
    share = attribution.share
    if share.share <= 0.0 or (share.low is not None and share.low <= 0.0):
        return False
    return not any(_worse(errors, WORSE_ONE_STEP) for errors in one_step)


def _worse(errors: StepErrors, times: float) -> bool:
    """Whether the error grows, all of its interval, in a rate whose error noise does not explain."""
    ratio = errors.after_over_before
    known = ratio is not None and ratio.low is not None and ratio.low > times
    return known and errors.after > errors.noise_floor * times


def misses(judgement: Judgement, attribution: Attribution, threshold: float) -> bool:
    """Whether the effects surely explain less than a share of the mismatch, and there is something to explain."""
    there = judgement.structured or attribution.explained.counts
    return there and surely_below(attribution.share, threshold)


def surely_below(share: Share, threshold: float) -> bool:
    """Whether all of the interval is; the share itself where there is none."""
    return (share.share if share.high is None else share.high) < threshold
