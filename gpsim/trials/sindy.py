"""PySINDy as a namer, the rival that regresses: which terms of a library the residual force needs.

Brunton, Proctor and Kutz (2016), "Discovering governing equations from data by sparse identification of nonlinear
dynamical systems". The generalised force that the base simulator lacks, computed from one-step accelerations, is
regressed on a library whose terms are families of the catalogue; sequentially thresholded least squares of PySINDy
selects them, its threshold chosen by BIC. It applies where every true effect is such a term and acts everywhere. What
is less than a hundredth of the forces at work is left alone: there the integrator's error would be named.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.recordings import Recording
from gpsim.trials.worlds import SYSTEMS, dynamics

Claims = tuple[tuple[str, str], ...]
THRESHOLDS = np.geomspace(0.1, 0.6, 10)  # of coefficients of normalised columns; 0.1 is PySINDy's own
NEGLIGIBLE = 0.01
LIBRARY: Mapping[str, Callable[[FloatArray, FloatArray, FloatArray], FloatArray]] = {
    "constant_force": lambda q, v, u: np.ones_like(q),
    "viscous_friction": lambda q, v, u: v,
    "quadratic_drag": lambda q, v, u: np.abs(v) * v,
    "coulomb_friction": lambda q, v, u: np.sign(v),
    "spring": lambda q, v, u: q,
    "gravity": lambda q, v, u: np.sin(q),
    "actuator_gain": lambda q, v, u: u,
    "actuator_asymmetry": lambda q, v, u: np.abs(u),
}
ALONE = {"spring": "constant_force", "actuator_asymmetry": "actuator_gain"}
"""Families of two terms: the first brings the second along."""


def installed() -> bool:
    """Whether the optional package is there."""
    try:
        import pysindy  # noqa: F401
    except ImportError:
        return False
    return True


def applies(content: Mapping[str, Any]) -> bool:
    """Whether a world is one that such a regression could name."""
    system = SYSTEMS[content["world"]["system"]]
    effects = content["effects"]
    known = all(
        (e["family"] in LIBRARY or (e["family"], e["on"]) == ("parameter_offset", "gravity"))
        and not e["region"]
        and e["since"] is None
        and not e["outside"]
        for e in effects
    )
    return not system.vehicle and known


def name(recording: Recording) -> Claims:
    """Families and places that the sparse regression finds."""
    import pysindy

    system = SYSTEMS[recording.system]
    before = np.concatenate([e.states[:-1] for e in recording.episodes])
    after = np.concatenate([e.states[1:] for e in recording.episodes])
    action = np.concatenate([e.actions for e in recording.episodes])
    middle = (before + after) / 2
    inverse, force = dynamics(system.name, recording.parameters, middle, action)
    acceleration = (after - before)[:, 1::2] / recording.dt
    moving = (np.linalg.inv(inverse) * acceleration[:, None, :]).sum(axis=2)
    lacking = moving - force
    found: list[tuple[str, str]] = []
    for c, coordinate in enumerate(system.coordinates):
        if np.mean(lacking[:, c] ** 2) < NEGLIGIBLE**2 * np.mean(moving[:, c] ** 2):
            continue
        terms = [t for t in LIBRARY if _offered(t, c, system.name)]
        columns = [LIBRARY[t](middle[:, 2 * c], middle[:, 2 * c + 1], action[:, 0]) for t in terms]
        chosen = _selected(np.stack(columns, axis=1), lacking[:, c], pysindy.STLSQ)
        found += _claims(
            [t for t, taken in zip(terms, chosen, strict=True) if taken], coordinate, system.action
        )
    return tuple(sorted(set(found)))


def _offered(term: str, coordinate: int, system: str) -> bool:
    if term.startswith("actuator"):
        return coordinate == 0
    if term == "gravity":
        return system == "pendulum" or (system == "cartpole" and coordinate == 1)
    return True


def _selected(library: FloatArray, target: FloatArray, optimiser: Any) -> FloatArray:
    """(T,) which columns the best threshold keeps; none where nothing beats nothing."""
    size = np.sqrt(np.mean(library**2, axis=0))
    scale = max(float(np.sqrt(np.mean(target**2))), 1e-300)
    x, y = library / np.where(size > 0, size, 1.0), target / scale
    n = len(y)
    best, kept = n * np.log(np.mean(y**2)), np.zeros(x.shape[1], dtype=np.bool_)
    for threshold in THRESHOLDS:
        mask = np.abs(optimiser(threshold=threshold, alpha=1e-6).fit(x, y[:, None]).coef_.ravel()) > 0
        if not mask.any():
            continue
        left = y - x[:, mask] @ np.linalg.lstsq(x[:, mask], y, rcond=None)[0]
        bic = n * np.log(max(float(np.mean(left**2)), 1e-300)) + mask.sum() * np.log(n)
        if bic < best:
            best, kept = bic, mask
    return np.asarray(kept)


def _claims(terms: list[str], coordinate: str, action: Mapping[str, str]) -> Claims:
    brought = {ALONE[t] for t in terms if t in ALONE}
    out = []
    for term in (t for t in terms if t not in brought):
        if term.startswith("actuator"):
            out.append((term, next(iter(action))))
        else:
            out.append(("parameter_offset", "gravity") if term == "gravity" else (term, coordinate))
    return tuple(out)
