"""Attribution: how much of the mismatch the account explains, how much each effect is, and which of them are claims."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.attribution.importance import importances, players
from gpsim.diagnosis.attribution.judges import Judge, rollout_judge, window_judge
from gpsim.diagnosis.attribution.less import accounts_without
from gpsim.diagnosis.attribution.roles import deciding, growth, role_of, sure_rows
from gpsim.diagnosis.attribution.shares import Mismatch
from gpsim.diagnosis.fitting import Fit
from gpsim.diagnosis.report import Explained, JudgedOn, Role, Share
from gpsim.diagnosis.run import kept
from gpsim.diagnosis.setup import Question
from gpsim.effects import closed

SEED = 2040  # of the draws: the same account is judged alike, whoever asks


@dataclass(frozen=True)
class Attribution:
    """What an account is worth.

    explained: of the mismatch; importance, needed, roles: of each of its terms; grows: by how much some channel's
    squared error surely grows without it; judge: what it was judged by; noise: (S,) the sensors' noise; squares: (B, S)
    what the account leaves.
    """

    explained: Explained
    importance: tuple[Share, ...]
    needed: tuple[Share, ...]
    roles: tuple[Role, ...]
    grows: tuple[float, ...]
    judge: Judge = field(repr=False)
    noise: FloatArray = field(repr=False)
    squares: FloatArray = field(repr=False)

    @property
    def share(self) -> Share:
        """What is explained over all channels that count."""
        return self.explained.rollout or Share(0.0)


def explained_by(question: Question, leader: Fit, null: Fit) -> Explained:
    """Which share of the mismatch an account takes off in a recording that nothing of it was learnt from."""
    rng = np.random.default_rng(SEED)
    rolled, noise = rollout_judge(question, leader, null, rng)
    counts = bool(rolled.mismatch.counts.any())
    judge: Judge = rolled if counts else window_judge(question, leader, null, noise, rng)
    squares = judge.squares([[leader.hypothesis]])[0]
    names = question.everything.simulator.state.names
    judged_on: JudgedOn = "held-out rollouts" if counts else "fit windows"
    return _explained(judge.mismatch, squares, names, judged_on, counts)


@kept
def attribute(question: Question, leader: Fit, null: Fit) -> Attribution:
    """Judge an account on what it did not learn from. null: the base, integrated as the account is."""
    rng = np.random.default_rng(SEED)
    rolled, noise = rollout_judge(question, leader, null, rng)
    counts = bool(rolled.mismatch.counts.any())
    judge: Judge = rolled if counts else window_judge(question, leader, null, noise, rng)
    if not leader.hypothesis.terms:
        nothing = Explained(rollout=Share(0.0, 0.0, 0.0), judged_on=judge.judged_on, counts=counts)
        return Attribution(nothing, (), (), (), (), judge, noise, judge.mismatch.before)
    mismatch, problem = judge.mismatch, question.everything
    squares, whole = judge.squares([judge.leaders, [leader.hypothesis]])
    overall, all_of_it = mismatch.overall(squares), mismatch.overall(whole)
    explained = _explained(mismatch, squares, problem.simulator.state.names, judge.judged_on, counts)
    without = judge.squares([[less] for less in accounts_without(problem, leader, null)])
    lost = all_of_it - mismatch.overall(without)
    dear = closed(problem.simulator) is not None
    parts = importances(judge, leader.hypothesis, all_of_it, overall, lost[:, 0], dear=dear)
    importance = tuple(mismatch.share(values) for values in parts)
    needed = tuple(mismatch.share(values) for values in lost)
    settings, left = problem.run.settings.attribution, 1.0 - float(overall[0])
    played = [mismatch.share(parts[list(g)].sum(axis=0)) for g in players(leader.hypothesis) for _ in g]
    order = [i for g in players(leader.hypothesis) for i in g]
    together = dict(zip(order, played, strict=True))
    grows = tuple(growth(mismatch, whole, less) for less in without)
    sure = sure_rows(problem, leader)
    roles: tuple[Role, ...] = tuple(
        "headline"
        if i in sure
        else role_of(together[i], need, left, deciding(mismatch, whole, less), by, settings)
        for i, (need, less, by) in enumerate(zip(needed, without, grows, strict=True))
    )
    return Attribution(explained, importance, needed, roles, grows, judge, noise, squares)


def _explained(
    mismatch: Mismatch, squares: FloatArray, names: Sequence[str], judged_on: JudgedOn, counts: bool
) -> Explained:
    every = mismatch.by_channel(squares)
    channels = {name: mismatch.share(every[:, i]) for i, name in enumerate(names) if mismatch.counts[i]}
    overall = mismatch.share(mismatch.overall(squares)) if channels else None
    return Explained(rollout=overall, channels=channels, judged_on=judged_on, counts=counts)
