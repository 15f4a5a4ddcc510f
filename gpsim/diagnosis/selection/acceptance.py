"""Acceptance: whether one hypothesis is worth taking over another. The one rule by which everything is named.

Richer and poorer are fits of the same windows. With `removed` the variance that the richer one takes off a channel,
`left` what the poorer one leaves there, `mismatch` what the base simulator leaves there (all three beyond known noise),
and `gain` the nats by which the richer one wins, its parameters paid (see `evidence`):

1. `does nothing`: a term of the richer one has no effect at its values. Refused: it may change the grid, and with it
   the numerical error.
2. `too few nats`: gain < per_term. Refused.
3. `one window`: without the one window that gains most, rule 2 refuses, and the richer one does not explain that window
   to the noise either. Refused: a moment that went wrong is no law, but a law that shows once leaves nothing of it.
4. `good share`: removed > good_share * left and > least_part * mismatch in some channel. Accepted.
5. `slight share`: removed > slight_share * left and > least_part * mismatch, gain > beyond_doubt (or > better_law for a
   richer law in a simpler one's place). Accepted if what the richer one leaves is white; else refused, but on trial:
   another term may yet bring that.
6. `better law`: a richer law in a simpler one's place, where part of it is seldom asked for: removed > good_share *
   left and > seldom_part * mismatch, gain > beyond_all_doubt; or removed > most_of_it * left, however small a part of
   the mismatch, gain > no_last_digits. Accepted or on trial as by rule 5.

All others are refused: `too small a share`. The worlds that show what each rule protects against are in
docs/method/acceptance.md.

Before all of them: `every joint`, what is left of friction or rotors that most joints of a robot have, taken where it
gains anything. `no place`, a region or an onset of the richer one that the poorer one lacks holds hardly any of the
samples, or nearly all, and is refused: it is a moment, or no gate at all. And `required`: what lacks an effect that the
user requires loses to what has it.

The numbers are `AcceptanceSettings`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import (
    Fit,
    Problem,
    expected,
    fit,
    gain,
    mean_squares,
    price,
    rescored,
    whiteness,
    window_costs,
)
from gpsim.diagnosis.run import kept
from gpsim.diagnosis.settings import AcceptanceSettings, schedules
from gpsim.effects import IN_EPISODE

LEAST_PART = 1e-4
"""Of what the base simulator leaves over there, that it must remove (a hundredth of the amplitude: with clean sensors
the last digits of a law are mended by another one)."""
ENOUGH_SHARE = 0.002
"""Of the variance left over, that is enough where the gain is beyond doubt and what is left is white."""
BETTER_LAW_GAIN = 5.0
"""Of gain that are beyond doubt for a richer law in a simpler one's place [nats] (it is not one of dozens, so less
than `beyond_doubt` will do)."""
SELDOM_PART = 1e-5
"""Of the mismatch, that a richer law which acts seldom must remove beside a good share of the rest."""
BEYOND_ALL_DOUBT = 50.0  # of gain for so small a part of the mismatch [nats]
MOST_OF_IT = 0.5
"""Of the variance left over, that a richer law may remove instead: any part of the mismatch will do."""
NO_LAST_DIGITS = 200.0  # of gain for that: the last digits of a law gain less [nats]
LEAST_HELD = 0.03  # of the samples, that a region or an onset must hold
MOST_HELD = 0.9  # of the samples, that it may hold: what holds more acts everywhere
ORDINARY_COST = 1.5  # times the median of all windows' costs: below, nothing unusual is left of a window


class Rule(StrEnum):
    """Which rule decided."""

    DOES_NOTHING = "does nothing"
    TOO_FEW_NATS = "too few nats"
    ONE_WINDOW = "one window"
    GOOD_SHARE = "good share"
    SLIGHT_SHARE = "slight share"
    BETTER_LAW = "better law"
    TOO_SMALL_A_SHARE = "too small a share"
    REQUIRED = "required"
    NO_PLACE = "no place"
    EVERY_JOINT = "every joint"


@dataclass(frozen=True)
class Acceptance:
    """The decision, the rule that made it, and by how much.

    nats: the gain, parameters paid; share: the most that is removed of what was left in a channel; on_trial: refused
    for the structure that is left, and for nothing else.
    """

    ok: bool
    rule: Rule
    nats: float
    share: float
    on_trial: bool = False


def accepts(problem: Problem, richer: Fit, poorer: Fit) -> Acceptance:
    """Whether the richer hypothesis is taken over the poorer one, by which rule, and by how much."""
    found = weigh(problem, richer, poorer)
    if found.on_trial and whiteness(problem, richer)[0] > problem.run.settings.acceptance.structured:
        found = replace(found, ok=True, on_trial=False)
    problem.run.trace.note(
        richer.hypothesis.names,
        poorer.hypothesis.names,
        found.ok,
        found.rule.value,
        gain=found.nats,
        price=price(problem, richer, poorer),
        share=found.share,
    )
    return found


def pays(problem: Problem, richer: Fit, poorer: Fit) -> bool:
    """Whether the richer hypothesis is accepted over the poorer one."""
    return accepts(problem, richer, poorer).ok


def may_pay(problem: Problem, richer: Fit, poorer: Fit) -> bool:
    """Whether it would be if nothing else were left over, which another term may yet bring about."""
    found = weigh(problem, richer, poorer)
    return found.ok or found.on_trial


def weigh(problem: Problem, richer: Fit, poorer: Fit) -> Acceptance:
    """`accepts` before anybody looks at what is left: rules 5 and 6 are on trial."""
    thresholds = problem.run.settings.acceptance
    poorer = on_its_grid(problem, poorer, richer)
    nats = gain(problem, richer, poorer)
    left, before = (mean_squares(problem, f.residuals) for f in (richer, poorer))
    removed = before - left  # the variance itself stops at known noise
    share = float(np.max((removed / poorer.variance)[problem.observed], initial=0.0))
    known = problem.run.known  # what the user requires, no rule decides
    more, fewer = (len(known.lacking(f.hypothesis.claims)) for f in (poorer, richer))
    if more != fewer:
        return Acceptance(more > fewer, Rule.REQUIRED, nats, share)
    if _of_every_joint(problem, richer, poorer):
        return Acceptance(nats > 0.0, Rule.EVERY_JOINT, nats, share)
    if richer.hypothesis.idle:
        return Acceptance(False, Rule.DOES_NOTHING, nats, share)
    if nats < thresholds.per_term:
        return Acceptance(False, Rule.TOO_FEW_NATS, nats, share)
    if not all(LEAST_HELD <= held <= MOST_HELD for held in _held(problem, richer, poorer)):
        return Acceptance(False, Rule.NO_PLACE, nats, share)
    if _in_one_window(problem, richer, poorer):
        return Acceptance(False, Rule.ONE_WINDOW, nats, share)
    rule = _rule(problem, thresholds, removed, nats, richer, poorer)
    return Acceptance(
        rule is Rule.GOOD_SHARE, rule, nats, share, on_trial=rule in (Rule.SLIGHT_SHARE, Rule.BETTER_LAW)
    )


def _of_every_joint(problem: Problem, richer: Fit, poorer: Fit) -> bool:
    """Whether all that the richer one has besides are rows that most of its robot's joints have."""
    alike = expected(problem, richer.hypothesis)
    new = [
        i for i, t in enumerate(richer.hypothesis.terms) if (t.family, t.on) not in poorer.hypothesis.claims
    ]
    return bool(new) and alike.issuperset(new) and poorer.hypothesis.claims < richer.hypothesis.claims


def _held(problem: Problem, richer: Fit, poorer: Fit) -> list[float]:
    """The share of the samples that each gate of the richer hypothesis holds which the poorer one lacks."""
    known = {(t.identity, t.gate.looks_at) for t in poorer.hypothesis.terms if t.gate}
    new = [t for t in richer.hypothesis.terms if t.gate and (t.identity, t.gate.looks_at) not in known]
    if not new:
        return []
    windows, channels = problem.windows, problem.simulator.state + problem.simulator.action
    valid, path = windows.valid[:, 1:], (windows.measured[:, :-1], windows.measured[:, 1:])
    shares = []
    for term in new:
        episodes = np.broadcast_to(windows.episode[:, None], valid.shape).astype(float)
        inside = term.gate.share(
            path, windows.actions, windows.t[:, :-1], np.diff(windows.t), channels, {IN_EPISODE: episodes}
        )
        shares.append(float(inside[valid].mean()))
    return shares


def _rule(
    problem: Problem,
    thresholds: AcceptanceSettings,
    removed: FloatArray,
    nats: float,
    richer: Fit,
    poorer: Fit,
) -> Rule:
    """The first of rules 4 to 6 that holds, else `too small a share`; of what is left nothing is known yet."""

    def removes(share: float, part: float) -> bool:
        worth = (removed > part * problem.mismatch) & problem.observed
        return bool((worth & (removed > share * poorer.variance)).any())

    if removes(thresholds.good_share, LEAST_PART):
        return Rule.GOOD_SHARE
    better = _better_law(richer, poorer)
    doubt = BETTER_LAW_GAIN if better else thresholds.beyond_doubt
    if nats > doubt and removes(ENOUGH_SHARE, LEAST_PART):
        return Rule.SLIGHT_SHARE
    seldom = nats > BEYOND_ALL_DOUBT and removes(thresholds.good_share, SELDOM_PART)
    most = nats > NO_LAST_DIGITS and removes(MOST_OF_IT, 0.0)
    if better and (seldom or most):
        return Rule.BETTER_LAW
    return Rule.TOO_SMALL_A_SHARE


def _better_law(richer: Fit, poorer: Fit) -> bool:
    """Whether they differ in one law of the same place, of which the one has more parameters, and in no gate."""
    new = [on for _, on in richer.hypothesis.claims - poorer.hypothesis.claims]
    old = [on for _, on in poorer.hypothesis.claims - richer.hypothesis.claims]
    alike = len(richer.hypothesis.terms) == len(poorer.hypothesis.terms)
    more = len(richer.hypothesis.parameters) > len(poorer.hypothesis.parameters)
    gates = [sum(bool(t.gate) for t in f.hypothesis.terms) for f in (richer, poorer)]
    return alike and more and len(new) == 1 and new == old and gates[0] == gates[1]


def on_its_grid(problem: Problem, poorer: Fit, richer: Fit) -> Fit:
    """The poorer fit on as fine a grid as the richer one has."""
    same = problem.as_finely(poorer.hypothesis, richer.hypothesis) is problem
    return poorer if same else _finer(problem, poorer)


@kept
def _finer(problem: Problem, at: Fit) -> Fit:
    """The fit on a grid twice as fine."""
    grid = replace(problem, substeps=2 * problem.substeps)
    return fit(grid, at.hypothesis, at.starts, iterations=schedules.GLANCE, near=True)


def _in_one_window(problem: Problem, richer: Fit, poorer: Fit) -> bool:
    """Whether the richer one is better in a single window only, and does not explain that one to the noise.

    A moment that went wrong is no law; a law that shows once leaves nothing of what happened.
    """
    thresholds = problem.run.settings.acceptance
    costs = [window_costs(problem, f.residuals[None], poorer.variance)[0] for f in (poorer, richer)]
    worst = int(np.argmax(costs[0] - costs[1]))
    if costs[1][worst] < ORDINARY_COST * float(np.median(costs[1])):
        return False
    others = np.arange(len(problem.windows)) != worst
    rest = problem.on(problem.windows.take(others))
    left = [
        rescored(rest, replace(f, residuals=f.residuals[others], starts=f.starts[others]))
        for f in (richer, poorer)
    ]
    return gain(rest, *left) + price(rest, *left) < thresholds.per_term
