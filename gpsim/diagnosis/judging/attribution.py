"""Attribution: how much of the mismatch the account explains, how much each effect is, and which of them are claims.

A headline accounts for a twentieth of the mismatch and is needed: by evidence beyond doubt, or by a part of the
mismatch that goes when it goes. So is an effect without which some channel's error grows fourfold in several blocks,
however little that is of the whole: where the base is far off in one channel, shares of the whole say nothing of
others.

Importance is the Shapley value (Shapley 1953) of the effects as players, a subset's worth being the share that it
explains with its own effects on and the others off, parameters as fitted: effects that explain the same share it, and
the values add up to what all explain. Alone it ranks redundant effects too high, so that need stands beside it: the
share that goes when an effect goes and the others are fitted anew.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations
from math import factorial

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Fit, Hypothesis
from gpsim.diagnosis.judging.judges import LOW, TINY, LossEvaluator, Mismatch, rollout_judge, window_judge
from gpsim.diagnosis.settings import VerdictSettings
from gpsim.diagnosis.setup import PreparedProblem
from gpsim.effects import closed
from gpsim.findings import Explained, JudgedOn, Odds, Role, Share

MOST = 6  # players at most: 64 subsets


def importances(
    judge: LossEvaluator,
    account: Hypothesis,
    whole: FloatArray,
    explained: FloatArray,
    needed: FloatArray,
    *,
    dear: bool = False,
) -> FloatArray:
    """(T, 1 + D) the Shapley values of the account's T terms, on all blocks and on each draw.

    whole: (1 + D,) the worth of all terms; explained: (1 + D,) what they are to add up to: a little less where the
    account is judged in parts of the recording that its parameters have not seen. Of a large account the families are
    the players, and what a family is worth its terms share as they are needed, (T,). dear: every subset costs
    simulations of a robot; of many players the mean of coming first and coming last then stands for all orders.
    """
    groups = players(account)
    count = len(groups)
    few = dear and count > ALL_ORDERS
    sizes = sorted({1, count - 1}) if few else range(1, count)
    subsets = [s for n in sizes if 0 < n < count for s in combinations(range(count), n)]
    worth = {frozenset[int](): np.zeros_like(whole), frozenset(range(count)): whole}
    if subsets:
        kept = [[term for i in subset for term in groups[i]] for subset in subsets]
        found = judge.mismatch.overall(judge.squares([[_only(account, terms)] for terms in kept]))
        worth |= dict(zip(map(frozenset, subsets), found, strict=True))
    shares = np.array([(_ends if few else _shapley)(i, count, worth) for i in range(count)])
    total = shares.sum(axis=0) if few else whole
    shares *= explained / np.where(total > 0.0, total, 1.0)
    out = np.empty((len(account.terms), *whole.shape))
    for share, group in zip(shares, groups, strict=True):
        weights = np.maximum(needed[list(group)], LEAST_WEIGHT)
        out[list(group)] = np.outer(weights / weights.sum(), share)
    return out


ALL_ORDERS = 3  # players of a robot's account of which all orders are asked: six subsets
LEAST_WEIGHT = 1e-9  # of a term that nothing needs: a family's parts add up all the same


def players(account: Hypothesis) -> list[tuple[int, ...]]:
    """The terms of each player: every term by itself, or those of a family, or of a site, so that few play."""
    terms = account.terms
    keys: list[list[str]] = [[str(i) for i in range(len(terms))], [t.family for t in terms]]
    keys.append([t.effect.site for t in terms])
    names = next((names for names in keys if len(set(names)) <= MOST), keys[-1])
    return [tuple(i for i, n in enumerate(names) if n == name) for name in dict.fromkeys(names)]


def _shapley(player: int, count: int, worth: dict[frozenset[int], FloatArray]) -> FloatArray:
    """(K,) of worths (K,) of every subset."""
    total = np.zeros_like(worth[frozenset()])
    for subset, value in worth.items():
        if player not in subset:
            size = len(subset)
            weight = factorial(size) * factorial(count - size - 1) / factorial(count)
            total = total + weight * (worth[subset | {player}] - value)
    return total


def _ends(player: int, count: int, worth: dict[frozenset[int], FloatArray]) -> FloatArray:
    """(K,) the mean of what a player brings before all others and after them, none of it less than nothing."""
    every = frozenset(range(count))
    return np.maximum(worth[frozenset({player})] + worth[every] - worth[every - {player}], 0.0) / 2.0


def _only(hypothesis: Hypothesis, kept: Sequence[int]) -> Hypothesis:
    """The hypothesis with some of its terms."""
    for index in reversed(range(len(hypothesis.terms))):
        if index not in kept:
            hypothesis = hypothesis.without(index)
    return hypothesis


NEGLIGIBLE = (
    0.01  # share of the mismatch: with so little left, a law in the place of another one is the same law
)
SEED = 2040  # of the draws: the same account is judged alike, whoever asks


@dataclass(frozen=True)
class Attribution:
    """What an account is worth.

    explained: of the mismatch; importance, needed, roles: of each of its terms; judge: what it was judged by; noise:
    (S,) the sensors' noise; squares: (B, S) what the account leaves.
    """

    explained: Explained
    importance: tuple[Share, ...]
    needed: tuple[Share, ...]
    roles: tuple[Role, ...]
    judge: LossEvaluator = field(repr=False)
    noise: FloatArray = field(repr=False)
    squares: FloatArray = field(repr=False)

    @property
    def share(self) -> Share:
        """What is explained over all channels that count."""
        return self.explained.rollout or Share(0.0)

    def told(self, odds: Odds, p_value: float, settings: VerdictSettings) -> Odds:
        """Odds as they may be told where chance, by a p_value, would not leave what the account leaves.

        A law that no catalogue has could then stand in the place of each of its own.
        """
        left, surely, most = 1.0 - self.share.share, 1.0 - (self.share.high or 0.0), math.log(settings.odds)
        if odds.nats is None or p_value >= settings.chance or left <= NEGLIGIBLE or surely <= 0.0:
            return odds
        return Odds(round(most, 2), ()) if odds.nats > most else odds


def explained_by(question: PreparedProblem, leader: Fit, null: Fit) -> Explained:
    """Which share of the mismatch an account takes off in a recording that nothing of it was learnt from."""
    judge, counts, _ = _judge(question, leader, null)
    squares = judge.squares([[leader.hypothesis]])[0]
    names = question.everything.simulator.state.names
    return _explained(judge.mismatch, squares, names, judge.judged_on, counts)


def attribute(
    question: PreparedProblem, leader: Fit, null: Fit, without: Sequence[Hypothesis], gains: Sequence[float]
) -> Attribution:
    """LossEvaluator an account on what it did not learn from.

    null: the base, integrated as the account is; without: the account without each of its terms, all others fitted;
    gains: what each term is worth by that [nats].
    """
    judge, counts, noise = _judge(question, leader, null)
    if not leader.hypothesis.terms:
        nothing = Explained(rollout=Share(0.0, 0.0, 0.0), judged_on=judge.judged_on, counts=counts)
        return Attribution(nothing, (), (), (), judge, noise, judge.mismatch.before)
    mismatch, problem = judge.mismatch, question.everything
    squares, whole = judge.squares([judge.leaders, [leader.hypothesis]])
    overall, all_of_it = mismatch.overall(squares), mismatch.overall(whole)
    explained = _explained(mismatch, squares, problem.simulator.state.names, judge.judged_on, counts)
    less = judge.squares([[part] for part in without])
    lost = all_of_it - mismatch.overall(less)
    dear = closed(problem.simulator) is not None
    parts = importances(judge, leader.hypothesis, all_of_it, overall, lost[:, 0], dear=dear)
    importance = tuple(mismatch.share(values) for values in parts)
    needed = tuple(mismatch.share(values) for values in lost)
    together = np.empty(len(parts))
    for group in players(leader.hypothesis):
        together[list(group)] = parts[list(group), 0].sum()
    left, settings = 1.0 - float(overall[0]), problem.run.settings.verdict
    roles = tuple(
        role_of(
            float(t),
            need,
            left,
            nats,
            _deciding(mismatch, whole, part, settings),
            _growth(mismatch, whole, part),
            settings,
        )
        for t, need, nats, part in zip(together, needed, gains, less, strict=True)
    )
    return Attribution(explained, importance, needed, roles, judge, noise, squares)


def role_of(
    importance: float,
    needed: Share,
    left: float,
    nats: float,
    decided: int,
    grows: float,
    settings: VerdictSettings,
) -> Role:
    """By the rule above. left: of the mismatch; decided: blocks in which it decides; grows: see `_growth`."""
    needs = needed.share > 0.0  # else all of it is no worse without
    if needs and grows >= settings.decides and decided >= settings.seldom:
        return "headline"
    surely = needed.share if needed.low is None else needed.low
    enough = surely > 0.0 and needed.share >= min(settings.needed, settings.of_left * left)
    if not enough and nats < settings.beyond_doubt:
        return "slight"
    decides = decided >= settings.seldom and needed.share >= settings.of_left * left
    return "headline" if decides or importance >= settings.headline else "slight"


def _judge(question: PreparedProblem, leader: Fit, null: Fit) -> tuple[LossEvaluator, bool, FloatArray]:
    """Rollouts where they show the mismatch, else the fit's windows; whether they do; the sensors' noise (S,)."""
    rng = np.random.default_rng(SEED)
    rolled, noise = rollout_judge(question, leader, null, rng)
    counts = bool(rolled.mismatch.counts.any())
    return rolled if counts else window_judge(question, leader, null, noise, rng), counts, noise


def _explained(
    mismatch: Mismatch, squares: FloatArray, names: Sequence[str], judged_on: JudgedOn, counts: bool
) -> Explained:
    every = mismatch.by_channel(squares)
    channels = {name: mismatch.share(every[:, i]) for i, name in enumerate(names) if mismatch.counts[i]}
    overall = mismatch.share(mismatch.overall(squares)) if channels else None
    return Explained(rollout=overall, channels=channels, judged_on=judged_on, counts=counts)


def _deciding(mismatch: Mismatch, squares: FloatArray, without: FloatArray, settings: VerdictSettings) -> int:
    """In how many blocks an effect decides: without it (B, S) far more is left than with it, and than noise makes."""
    clearly = without > settings.decides * np.maximum(squares, mismatch.floor)
    return int((clearly & mismatch.counts & (without > 0)).any(axis=1).sum())


def _growth(mismatch: Mismatch, squares: FloatArray, without: FloatArray) -> float:
    """By how much, surely, the squared error of some channel grows without an effect: the largest of the channels."""
    left, less, floor = (mismatch.sums(s) for s in (squares, without, mismatch.floor))
    ratio = np.maximum(less, floor) / np.maximum(np.maximum(left, floor), TINY)
    sure = np.quantile(ratio[1:], LOW, axis=0)
    return float(np.max(sure[mismatch.counts], initial=0.0))
