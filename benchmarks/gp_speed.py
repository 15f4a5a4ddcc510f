"""Speed of gpsim's Gaussian process beside scikit-learn and GPyTorch, in one process on one thread.

    python benchmarks/gp_speed.py [--out FILE] [--repeats 300]

The data are what the GP sees in the cart-pole experiment: the acceleration that Coulomb friction (mu = 0.9) adds,
at states that random pushes reach. All libraries get the same data, kernel (thesis 4.9), start and bounds, and
their likelihoods are computed by gpsim's formula at the hyper-parameters they report.
"""

from __future__ import annotations

import os

# Before NumPy and torch load: they size their thread pools when imported.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from gpsim.gp import Bounds, FitSettings, HyperParameters, Predictor, TrainingData, condition, fit
from gpsim.gp.exact import Likelihood, log_marginal_likelihood
from gpsim.gp.fitting import first_start

try:
    import gp_rivals_gpytorch as _unused  # noqa: F401
except ImportError:
    pass

FloatArray = NDArray[np.float64]
GRAVITY, CART, POLE, HALF, PUSH, DT, FRICTION = 9.8, 1.0, 0.1, 0.5, 10.0, 0.02, 0.9


def cartpole_rates(state: FloatArray, force: float, mu: float) -> FloatArray:
    """(x_acc, theta_acc) of the cart-pole with Coulomb friction on the cart (thesis 4.11 to 4.13, corrected)."""
    _, x_dot, theta, theta_dot = state
    s, total = np.sign(x_dot), CART + POLE
    sin, cos = np.sin(theta), np.cos(theta)
    push = (-force - POLE * HALF * theta_dot**2 * (sin + mu * s * cos)) / total
    inertia = HALF * (4.0 / 3.0 - POLE * cos * (cos - mu * s * sin) / total)
    theta_acc = (GRAVITY * sin + cos * (push + mu * GRAVITY * s)) / inertia
    normal = total * GRAVITY - POLE * HALF * (theta_acc * sin + theta_dot**2 * cos)
    swing = POLE * HALF * (theta_dot**2 * sin - theta_acc * cos)
    return np.array([(force + swing - mu * normal * s) / total, theta_acc])


def friction_residual(count: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """`count` rows drawn from random-action episodes: inputs (x, x_dot, theta, theta_dot, force), target x_acc."""
    rows: list[FloatArray] = []
    targets: list[float] = []
    while len(rows) < 4 * count:
        state = rng.uniform(-0.05, 0.05, 4)
        for _ in range(500):
            force = float(rng.choice([-PUSH, PUSH]))
            true = cartpole_rates(state, force, FRICTION)
            rows.append(np.append(state, force))
            targets.append(float(true[0] - cartpole_rates(state, force, 0.0)[0]))
            state = state + DT * np.array([state[1], true[0], state[3], true[1]])
            if abs(state[2]) > 0.2 or abs(state[0]) > 2.4:
                break
    chosen = rng.choice(len(rows), count, replace=False)
    return np.array(rows)[chosen], np.array(targets)[chosen]
