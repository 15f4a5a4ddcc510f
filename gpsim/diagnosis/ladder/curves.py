"""Rung 3: a measured curve of one input, on top of the laws that stand.

A curve is asked for where laws leave a hundredth of the mismatch and more. Of every input the heights at a few knots
are fitted by lines (penalised splines of the first degree: Eilers and Marx 1996) while all laws stand as they are; the
input that takes most of what is left is fitted exactly. A curve never takes the place of a law: it says what laws
leave, over the range that was visited, and its share of the mismatch decides what the account may be called.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Candidate, Fit, Hypothesis, Problem
from gpsim.diagnosis.ladder.account import Account
from gpsim.diagnosis.ladder.laws import Law
from gpsim.diagnosis.ladder.offers import Lines
from gpsim.diagnosis.ladder.search import SETTLE, Search
from gpsim.effects import EffectParameter, Place, Shape, Term, effect_of
from gpsim.findings import MeasuredCurve
from gpsim.simulators import Simulator

OUTER = 0.01  # quantile of what was visited, at which the outer knots stand
STEP = 0.02  # of an input's typical effect, by which a height is moved to see what that changes
SMOOTH = 0.3  # of the typical effect: deviation a priori of a height's second difference


@dataclass(frozen=True)
class Input:
    """A curve on offer: its family, place and variant, the input's values that were visited, and units.

    size: the typical size of what it gives; column: of state and action, that is its input.
    """

    family: str
    on: str
    variant: str
    column: int
    size: float
    quantity: str
    unit: str

    @property
    def of(self) -> tuple[str, str]:
        """Where it acts, and of what it is a function."""
        return self.on, {"position": "position", "": "command"}.get(self.variant, "speed")

    @property
    def place(self) -> Place:
        """Where it acts."""
        return Place(self.on, self.unit, span=self.size)


def inputs(simulator: Simulator, offers: list[Candidate]) -> Iterator[Input]:
    """Every curve of one input: forces of speed and position, friction of speed, what commands deliver."""
    names = [*simulator.state.names, *simulator.action.names]
    spans = {c.place.on: c.place.span for c in offers if effect_of(c.family).site in ("force", "actuator")}
    for c in simulator.coordinates:
        if c.name in spans:
            for variant, of in (("speed", c.velocity), ("position", c.name), ("friction", c.velocity)):
                unit = c.force_unit
                yield Input(
                    "force_curve", c.name, variant, names.index(of), spans[c.name], f"force on {c.name}", unit
                )
    for action in simulator.action.names:
        if action in spans:
            unit = simulator.action.units[action]
            yield Input(
                "actuator_curve",
                action,
                "",
                names.index(action),
                spans[action],
                f"what reaches of {action}",
                unit,
            )


def curved(
    search: Search, offers: list[Candidate]
) -> tuple[dict[tuple[str, str, str], MeasuredCurve], set[str]]:
    """Curves on top of the account, which they join, by family, place and variant; and where laws are bent.

    That is where a curve would take a good part of what they leave, whether it joins or not.
    """
    settings = search.shooting.problem.run.settings.curves
    problem, found, bent = search.shooting.problem, dict[tuple[str, str, str], MeasuredCurve](), set[str]()
    if problem.windows.length < 3 or search.dear:
        return found, bent
    known = problem.run.known
    asked_for = not known.only
    every = [i for i in inputs(problem.simulator, offers) if known.asks((i.family, i.on), asked_for)]
    for _ in range(settings.most):
        left = search.left()
        if left <= max(search.numbers.crumb * search.missing(), search.numbers.rare):
            return found, bent
        dry = {t.on for t in search.account.hypothesis.terms if t.family == "coulomb_friction"}
        asked = [one for one in every if one.variant != "friction" or one.on in dry]
        tried = [t for one in asked if (t := _lined(search, one, settings.knots)) is not None]
        tried.sort(key=lambda t: -t[0])
        if not tried or tried[0][0] <= 0.0:
            return found, bent
        bent |= {c.on for gain, c, *_ in tried if gain > (1.0 - search.verdict.nearly_all) * left}
        _, one, heights, knots, freedom, band = tried[0]
        account = _fitted(search, one, knots, heights, freedom)
        gain = search.account.fit.cost - account.fit.cost
        if gain < max(settings.takes * left, _price(search, freedom)):
            return found, bent
        names = [*problem.simulator.state.names, *problem.simulator.action.names]
        search.say("a measured curve", True, f"{one.quantity} of {names[one.column]}", gain=gain)
        search.account = account
        found[one.family, one.on, one.variant] = _told(problem, one, account.hypothesis.terms[-1], band)
        every = [e for e in every if e is not one]
    return found, bent


def _visited(problem: Problem, column: int) -> FloatArray:
    """(N,) values of an input in the windows."""
    windows = problem.windows
    both = np.concatenate([windows.measured[:, :-1], windows.actions], axis=2)
    return np.asarray(both[windows.valid[:, 1:]][:, column])


def _lined(
    search: Search, one: Input, knots: int
) -> tuple[float, Input, FloatArray, FloatArray, float, FloatArray] | None:
    """Gain by lines of a curve, its heights and knots, its effective parameters and its deviations."""
    problem, point = search.shooting.problem, search.account.fit
    x = _visited(problem, one.column)
    places = np.unique(np.quantile(x, np.linspace(OUTER, 1.0 - OUTER, knots)))
    if len(places) < 4 or np.ptp(places) <= 0:
        return None
    columns = _columns(search, one, places, np.zeros(len(places)))
    if columns is None:
        return None
    held = replace(point, hypothesis=point.hypothesis.frozen(), z=np.empty(0))
    lines = Lines(search.shooting.slopes(point, parameters=False), held)
    penalty = _penalty(places, one.size)
    gain, heights, freedom, deviation = lines.heights(columns, penalty)
    return gain - _price(search, freedom), one, heights, places, freedom, deviation


def _price(search: Search, freedom: float) -> float:
    """Nats that a curve of so many effective parameters must bring."""
    return float(0.5 * freedom * np.log(max(search.shooting.noise.effective, 2.0)) + search.numbers.rare)


def _penalty(places: FloatArray, size: float) -> FloatArray:
    """(K, K) information a priori: heights are smooth, and no larger than what drives."""
    k = len(places)
    second = np.diff(np.eye(k), n=2, axis=0) / (SMOOTH * size)
    return np.asarray(second.T @ second + np.eye(k) / (3.0 * size) ** 2)


def _columns(search: Search, one: Input, places: FloatArray, heights: FloatArray) -> FloatArray | None:
    """(W, M, K) whitened slopes of what each height takes off the residual."""
    point, shooting = search.account.fit, search.shooting
    step = STEP * one.size
    with_it = Account(search.account.laws, point).hypothesis
    if heights.any():
        with_it = with_it.plus(_term(one, places, heights, 1.0), ())
    before = shooting.residuals(with_it, with_it.theta[None], point.starts[None])[0]
    out = []
    for k in range(len(places)):
        moved = heights.copy()
        moved[k] += step
        hypothesis = search.account.hypothesis.plus(_term(one, places, moved, 1.0), ())
        after = shooting.residuals(hypothesis, hypothesis.theta[None], point.starts[None])[0]
        out.append(((before - after) * shooting.noise.whitening / step).reshape(len(point.starts), -1))
    columns = np.stack(out, axis=2)
    return columns if np.isfinite(columns).all() else None


def _term(one: Input, places: FloatArray, heights: FloatArray, freedom: float) -> Term:
    shape = Shape((tuple(places.tolist()),), tuple(heights.tolist()))
    return Term(one.family, one.on, shape.values(freedom), variant=one.variant)


def _fitted(search: Search, one: Input, places: FloatArray, heights: FloatArray, freedom: float) -> Account:
    """The account with a curve, its scale and all laws fitted around its heights."""
    term = _term(one, places, heights, freedom)
    declared = effect_of(one.family).parameters(one.place)
    candidate = Candidate(one.family, one.place, one.variant, declared)
    law = Law(candidate, False, search.numbers.rare)
    account = search.account
    hypothesis: Hypothesis = account.hypothesis.frozen().plus(term, declared)
    found = search.fitted((law,), hypothesis, account.fit.starts, SETTLE).fit
    return Account((*account.laws, law), beside(account.fit, found, declared))


def beside(laws: Fit, found: Fit, declared: tuple[EffectParameter, ...]) -> Fit:
    """The fit of laws with a curve on top, whose scale alone was fitted: what is known of the laws is theirs."""
    p, windows = len(laws.z), len(laws.starts)
    by_window = np.zeros((windows, p + 1, p + 1))
    by_window[:, :p, :p], by_window[:, p:, p:] = laws.by_window, found.by_window
    hypothesis = laws.hypothesis.plus(found.hypothesis.terms[-1], declared)
    return replace(
        found,
        hypothesis=hypothesis,
        z=np.concatenate([laws.z, found.z]),
        prior=laws.prior + found.prior,
        by_window=by_window,
        gradients=np.concatenate([laws.gradients, found.gradients], axis=1),
    )


def _told(problem: Problem, one: Input, term: Term, deviation: FloatArray) -> MeasuredCurve:
    simulator = problem.simulator
    channels = [*simulator.state, *simulator.action]
    x = _visited(problem, one.column)
    effect = term.effect
    shape: Shape = effect.shape  # type: ignore[attr-defined]  # it is a measured curve
    times = term.values["scale"]
    values = times * np.array(shape.heights)
    half = 1.645 * np.abs(times) * deviation
    return MeasuredCurve(
        quantity=one.quantity,
        unit=one.unit,
        input=channels[one.column].name,
        input_unit=channels[one.column].unit,
        at=shape.axes[0],
        values=tuple(values.tolist()),
        low=tuple((values - half).tolist()),
        high=tuple((values + half).tolist()),
        visited=(float(x.min()), float(x.max())),
        freedom=float(term.values["freedom"]),
    )
