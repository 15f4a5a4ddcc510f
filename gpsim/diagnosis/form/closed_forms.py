"""Closed forms of one to four parameters, fitted to a measured curve: form found, not known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from gpsim.channels import FloatArray
from gpsim.diagnosis.report import FoundForm

FOLLOWS = 0.01  # of what a curve does, on squares, that a form may miss to be offered
FEWER = 1.5  # times what the best one misses: a form of fewer parameters is as good
PERIODS = (0.5, 1.0, 2.0)  # of what was visited, from which a sine's period is looked for

Law = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True)
class _Form:
    """law: of the input in units of its reach, and the parameters; formula: with their names in braces."""

    name: str
    names: tuple[str, ...]
    law: Law
    starts: Sequence[tuple[float, ...]]
    formula: str


def _power(x: FloatArray, p: FloatArray) -> FloatArray:
    return np.asarray(p[0] * np.sign(x) * np.abs(x) ** np.clip(p[1], 0.05, 8.0))


def _exponential(x: FloatArray, p: FloatArray) -> FloatArray:
    return np.asarray(p[0] + p[1] * np.exp(np.clip(-x / _apart(p[2]), -50.0, 50.0)))


def _tanh(x: FloatArray, p: FloatArray) -> FloatArray:
    return np.asarray(p[0] * np.tanh(x / _apart(p[1])))


def _rational(x: FloatArray, p: FloatArray) -> FloatArray:
    return np.asarray(p[0] * x / (1.0 + np.abs(x) / max(abs(float(p[1])), 1e-6)))


def _sine(x: FloatArray, p: FloatArray) -> FloatArray:
    return np.asarray(p[0] + p[1] * np.sin(2.0 * np.pi * x / _apart(p[2]) + p[3]))


def _cubic(x: FloatArray, p: FloatArray) -> FloatArray:
    return np.asarray(p[0] * x + p[1] * x**3)


FORMS = (
    _Form("power", ("a", "p"), _power, [(1.0, 0.5), (1.0, 3.0), (-1.0, 0.5), (-1.0, 3.0)], "{a} sgn(x) |x|^{p}"),
    _Form("tanh", ("a", "b"), _tanh, [(1.0, 0.3), (-1.0, 0.3)], "{a} tanh(x / {b})"),
    _Form("rational", ("a", "b"), _rational, [(1.0, 0.5), (-1.0, 0.5)], "{a} x / (1 + |x| / {b})"),
    _Form("cubic", ("a", "b"), _cubic, [(1.0, 0.0), (-1.0, 0.0)], "{a} x + {b} x^3"),
    _Form("exponential", ("c", "a", "b"), _exponential, [(0.0, 1.0, 0.5), (0.0, -1.0, 0.5), (0.0, 1.0, -0.5)],
          "{c} + {a} exp(-x / {b})"),
    _Form("sine", ("c", "a", "period", "phase"), _sine,
          [(0.0, 0.7, period, phase) for period in PERIODS for phase in (0.0, 2.0, 4.0)],
          "{c} + {a} sin(2 pi x / {period} + {phase})"),
)  # fmt: skip


def closed_form(x: FloatArray, curve: FloatArray) -> FoundForm | None:
    """The simplest form that follows a curve over what was visited; None where none does."""
    reach, size = float(np.max(np.abs(x), initial=0.0)), float(np.sqrt(np.mean(curve**2)))
    if reach <= 0.0 or size <= 0.0:
        return None
    tried = [(_fitted(form, x / reach, curve / size), form) for form in FORMS]
    best = min(missed for (missed, _), _ in tried)
    if best > FOLLOWS:
        return None
    able = [(len(f.names), missed, p, f) for (missed, p), f in tried if missed <= max(FEWER * best, 1e-4)]
    _, missed, p, form = min(able, key=lambda one: one[:2])
    parameters = _in_units(form, p, reach, size)
    text = form.formula.format(**{name: f"{value:.3g}" for name, value in parameters.items()})
    return FoundForm(form=form.name, formula=text.replace("+ -", "- "), parameters=parameters, misses=missed)


def _fitted(form: _Form, x: FloatArray, curve: FloatArray) -> tuple[float, FloatArray]:
    best, at = np.inf, np.array(form.starts[0])
    for start in form.starts:
        found = least_squares(lambda p: form.law(x, p) - curve, start, max_nfev=80)
        missed = float(np.mean(found.fun**2))
        if missed < best:
            best, at = missed, found.x
    return best, at


def _in_units(form: _Form, p: FloatArray, reach: float, size: float) -> dict[str, float]:
    """Parameters of the curve itself."""
    out = dict(zip(form.names, map(float, p), strict=True))
    if form.name == "cubic":
        return {"a": out["a"] * size / reach, "b": out["b"] * size / reach**3}
    if form.name == "power":
        exponent = float(np.clip(out["p"], 0.05, 8.0))
        return {"a": out["a"] * size / reach**exponent, "p": exponent}
    if form.name == "rational":
        return {"a": out["a"] * size / reach, "b": abs(out["b"]) * reach}
    if form.name == "sine":
        out["phase"] = float(np.mod(out["phase"], 2.0 * np.pi))
    return {
        name: v * (reach if name in ("b", "period") else 1.0 if name == "phase" else size)
        for name, v in out.items()
    }


def _apart(value: float) -> float:
    """A divisor that is not 0."""
    return value if abs(value) > 1e-6 else 1e-6
