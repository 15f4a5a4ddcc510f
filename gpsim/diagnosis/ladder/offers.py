"""Offers: what an absent law would gain, by lines around a fit, all other laws and start states following.

A law that has a slope where it does nothing is a column; one that jumps is tried at several starts. Lines foretell
gains well near a fit and mislead far from one, so that an offer orders what is fitted and decides nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Fit, Hypothesis, Shooting, Slopes, coordinates, step_sizes
from gpsim.diagnosis.ladder.laws import Law

Key = tuple[str, str, str]
LOOKS = 3  # simulations of an offer, each where the last one says


@dataclass(frozen=True)
class Offer:
    """A law, the nats that it promises, and the values of its parameters that it promises them with."""

    gain: float
    law: Law
    values: tuple[float, ...]


class Offers:
    """Absent laws around a fit. What each changes in the residual is simulated once, whatever is asked of it."""

    def __init__(self, shooting: Shooting, fit: Fit) -> None:
        self._shooting, self._fit = shooting, fit
        self.slopes = shooting.slopes(fit)
        self._changes: dict[Key, FloatArray] = {}

    def of(self, laws: Sequence[Law]) -> list[Offer]:
        """What each promises from its best start, beside all that stands."""
        return self._promised(laws, self.slopes.r, Lines(self.slopes, self._fit))

    def in_place(self, laws: Sequence[Law], of: Law, gone: slice, part: Fit) -> list[Offer]:
        """The same in the place `of` a law, whose rows in z are gone in a `part` of the account.

        What jumps at the very place of that law is simulated anew: beside it, it would have done something else.
        """
        lines = self._lines(gone, part)
        here = {
            o.key: self._started([o], part)
            for o in laws
            if not o.has_slope and (o.stiff or o.candidate.place.on == of.candidate.place.on)
        }
        return self._promised(laws, lines.slopes.r, lines, here)

    def simulated(self, offers: Sequence[Offer]) -> list[Offer]:
        """What each gains where it is simulated: at its size, and at the one that the way there then promises."""
        lines, out = Lines(self.slopes, self._fit), []
        for offer in offers:
            law, values, looks = offer.law, list(offer.values), [replace(offer, gain=0.0)]
            first = at_nothing(law)[1]
            size = law.candidate.declared[first]
            for _ in range(LOOKS):
                change = self._started([replace(law, starts=(tuple(values),))], self._fit)[:, :, 0]
                looks.append(Offer(lines.gain(self.slopes.r + change), law, tuple(values)))
                _, times = lines.along(-change)
                secant = size.none + times * (values[first] - size.none)
                values[first] = float(np.clip(secant, size.low, size.high))
            out.append(max(looks, key=lambda o: o.gain))
        return out

    def lost(self, gone: slice, part: Fit) -> float:
        """Nats by which the place of a law is worse where nothing stands in it, by the same lines."""
        return self._lines(gone, part).base - Lines(self.slopes, self._fit).base

    def _lines(self, gone: slice, part: Fit) -> Lines:
        """Around a part of the account, without the rows that are gone in it."""
        r = (part.residuals * self._shooting.noise.whitening).reshape(self.slopes.r.shape)
        kept = np.delete(np.arange(self.slopes.by_theta.shape[2]), gone)
        return Lines(Slopes(r, self.slopes.by_theta[:, :, kept], self.slopes.by_start), part)

    def _promised(
        self, laws: Sequence[Law], r: FloatArray, lines: Lines, here: Mapping[Key, FloatArray] | None = None
    ) -> list[Offer]:
        out = []
        for law in laws:
            changes = (here or {}).get(law.key)
            changes = self._changed(law) if changes is None else changes
            if law.spans:
                out.append(_spanned(law, lines, changes))
                continue
            smooth = law.has_slope
            out.append(self._smooth(law, lines, changes) if smooth else self._jumping(law, r, lines, changes))
        return out

    def _changed(self, law: Law) -> FloatArray:
        """(W, M, K) what a law changes in the whitened residual: its slope, or at each of its starts."""
        if law.key not in self._changes:
            smooth = law.has_slope
            found = column(self._shooting, self._fit, law) if smooth else self._started([law], self._fit)
            self._changes[law.key] = found
        return self._changes[law.key]

    def together(self, laws: Sequence[Law]) -> tuple[float, tuple[float, ...]]:
        """Nats that laws of one family promise with the same values at all of their places, and these."""
        changes, lines = self._started(laws, self._fit), Lines(self.slopes, self._fit)
        gains = [lines.gain(self.slopes.r + changes[:, :, k]) for k in range(changes.shape[2])]
        best = int(np.argmax(gains))
        return gains[best], laws[0].starts[best]

    def _started(self, laws: Sequence[Law], fit: Fit) -> FloatArray:
        """(W, M, K) what laws change at each of the first one's starts, beside a fit."""
        hypotheses = [fit.hypothesis] * len(laws[0].starts)
        for law in laws:
            both = zip(hypotheses, laws[0].starts, strict=True)
            hypotheses = [h.plus(law.term(v), law.candidate.declared) for h, v in both]
        thetas = np.stack([h.theta for h in hypotheses])
        copies = np.tile(fit.starts, (len(thetas), 1, 1))
        left = self._shooting.residuals(hypotheses[0], thetas, copies) * self._shooting.noise.whitening
        left = np.nan_to_num(left, nan=RAN_AWAY).reshape(len(thetas), *self.slopes.r.shape)
        before = (fit.residuals * self._shooting.noise.whitening).reshape(self.slopes.r.shape)
        return np.asarray(np.moveaxis(left - before, 0, 2))

    def _smooth(self, law: Law, lines: Lines, changes: FloatArray) -> Offer:
        own = coordinates(law.candidate.declared)
        z, first = at_nothing(law)
        gain, size = lines.along(changes[:, :, 0])
        if at := law.moments:
            held = np.eye(len(at) + 1) / own.prior[first] ** 2
            more, (total, *moments), _, _ = lines.heights(changes, held)
            moved = own.scale[at] * np.array(moments) / (total or 1.0)
            if total > 0.0 and (own.low[at] <= moved).all() and (moved <= own.high[at]).all():
                gain, size, z[at] = more, float(total), moved
        if not own.low[first] < size < own.high[first]:
            return Offer(0.0, law, tuple(p.starts[0] for p in law.candidate.declared))
        z[first] = size
        return Offer(gain, law, tuple(own.natural(z).tolist()))

    def _jumping(self, law: Law, r: FloatArray, lines: Lines, changes: FloatArray) -> Offer:
        promised = []
        first = law.candidate.declared[0]
        for k, start in enumerate(law.starts):
            promised.append((lines.gain(r + changes[:, :, k]), start))
            if law.grows:
                gain, times = lines.along(-changes[:, :, k])
                if first.low <= times * start[0] <= first.high:
                    promised.append((gain, (times * start[0], *start[1:])))
        gain, values = max(promised, key=lambda p: p[0])
        return Offer(gain, law, values)


def _spanned(law: Law, lines: Lines, changes: FloatArray) -> Offer:
    """A law whose parameters all follow lines, started in one after another."""
    gain, times, _, _ = lines.heights(-changes, np.zeros((changes.shape[2], changes.shape[2])))
    low, high = np.array([(p.low, p.high) for p in law.candidate.declared]).T
    values = np.clip(times @ np.array(law.starts), low, high)
    return Offer(gain, law, tuple(values.tolist()))


RAN_AWAY = 1e6  # standard deviations: a simulation that is no number


def at_nothing(law: Law) -> tuple[FloatArray, int]:
    """(P,) the coordinates of an absent law where it does nothing, and which of them is its size."""
    declared = law.candidate.declared
    z = np.where([p.place for p in declared], coordinates(declared).centre, 0.0)
    return z, next((i for i, p in enumerate(declared) if not p.place), 0)


def nudged(law: Law) -> tuple[float, list[float]]:
    """How far an absent law with a slope is moved from nothing, and its values there."""
    declared = law.candidate.declared
    own = coordinates(declared)
    z, first = at_nothing(law)
    alone = Hypothesis().plus(law.term([p.starts[0] for p in declared]), declared)
    step = float(step_sizes(alone, own)[first])
    step = -step if z[first] + step > own.high[first] else step
    z[first] += step
    return step, [float(v) for v in own.natural(z)]


def column(shooting: Shooting, fit: Fit, law: Law) -> FloatArray:
    """(W, M, 1 + P) the whitened slope of what an absent law takes off the residual, at nothing.

    Then how that changes where it sits one scale further along each of its P axes: its first moments are as linear.
    """
    step, values = nudged(law)
    places = [values]
    for i in law.moments:
        places.append([*values[:i], values[i] + law.candidate.declared[i].scale, *values[i + 1 :]])
    every = [fit.hypothesis.plus(law.term(own), law.candidate.declared) for own in places]
    copies = np.tile(fit.starts, (len(every), 1, 1))
    moved = shooting.residuals(every[0], np.stack([h.theta for h in every]), copies)
    white = (fit.residuals - moved) * shooting.noise.whitening / step
    white[1:] -= white[0]
    return np.asarray(np.moveaxis(np.nan_to_num(white).reshape(len(every), len(fit.starts), -1), 0, 2))


class Lines:
    """What an absent law gains by lines: start states, and the account's parameters within their bounds, follow."""

    def __init__(self, slopes: Slopes, point: Fit) -> None:
        own, self.slopes = coordinates(point.hypothesis.parameters), slopes
        size = slopes.by_theta.shape[2]
        self._j = slopes.off_starts(slopes.by_theta).reshape(slopes.r.size, size)
        held = np.diag(1.0 / own.prior**2)
        self._pull = held @ (point.z - own.centre)
        self._h = self._j.T @ self._j + held
        self._inverse = np.linalg.pinv(self._h, rcond=1e-12, hermitian=True) if size else self._h
        self._own, self._z = own, point.z
        self.base = self._cost(slopes.r)

    def _cost(self, r: FloatArray) -> float:
        left = self.slopes.off_starts(r[:, :, None])[:, :, 0].ravel()
        b = self._j.T @ left - self._pull
        d = self._inverse @ b
        if len(d):
            d = np.clip(self._z + d, self._own.low, self._own.high) - self._z
        return float(0.5 * left @ left - d @ b + 0.5 * d @ self._h @ d)

    def gain(self, r: FloatArray) -> float:
        """Nats, of the whitened residual (W, M) with the law."""
        return self.base - self._cost(r)

    def along(self, column: FloatArray) -> tuple[float, float]:
        """Nats and the size, of a law whose slope is a column (W, M)."""
        c = self.slopes.off_starts(column[:, :, None])[:, :, 0].ravel()
        r = self.slopes.off_starts(self.slopes.r[:, :, None])[:, :, 0].ravel()
        cj = self._j.T @ c
        size = float(c @ c - cj @ self._inverse @ cj)
        pull = float(c @ r - cj @ self._inverse @ (self._j.T @ r))
        return (0.5 * pull**2 / size, pull / size) if size > 1e-9 * float(c @ c) else (0.0, 0.0)

    def heights(
        self, columns: FloatArray, penalty: FloatArray
    ) -> tuple[float, FloatArray, float, FloatArray]:
        """Of a curve whose heights have columns (W, M, K): nats, the heights, effective parameters, deviations (K,)."""
        c = self.slopes.off_starts(columns).reshape(-1, columns.shape[2])
        r = self.slopes.off_starts(self.slopes.r[:, :, None])[:, :, 0].ravel()
        cj = c.T @ self._j
        own = c.T @ c - cj @ self._inverse @ cj.T
        pull = c.T @ r - cj @ self._inverse @ (self._j.T @ r)
        inverse = np.linalg.inv(own + penalty + 1e-12 * np.trace(own) * np.eye(len(own)))
        heights = inverse @ pull
        gain = float(heights @ pull - 0.5 * heights @ (own + penalty) @ heights)
        freedom = float(np.trace(inverse @ own))
        return gain, heights, freedom, np.sqrt(np.maximum(np.diag(inverse), 0.0))
