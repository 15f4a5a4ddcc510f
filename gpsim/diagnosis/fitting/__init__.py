"""Fitting: a hypothesis against windows, by multiple shooting."""

from gpsim.diagnosis.fitting.coordinates import Coordinates, coordinates
from gpsim.diagnosis.fitting.discretisation import (
    TOLERATED_NOISE,
    TOLERATED_STEP_ERROR,
    USUAL_SUBSTEP,
    dry_steps,
    growth,
    inexact,
    numerical_error,
    stepped,
)
from gpsim.diagnosis.fitting.evidence import autocorrelation, sensor_noise, unexplained, whiteness
from gpsim.diagnosis.fitting.hypothesis import Candidate, Hypothesis
from gpsim.diagnosis.fitting.predict import as_it_was, has_sensors, predicted, traced, without_sensors
from gpsim.diagnosis.fitting.problem import Problem, mean_squares
from gpsim.diagnosis.fitting.rollout import Extra, Pushes
from gpsim.diagnosis.fitting.shooting import Fit, Noise, Shooting, Slopes, fit, prior, step_sizes
from gpsim.diagnosis.fitting.simulate import simulate

__all__ = [
    "TOLERATED_NOISE",
    "TOLERATED_STEP_ERROR",
    "USUAL_SUBSTEP",
    "Candidate",
    "Coordinates",
    "Extra",
    "Fit",
    "Hypothesis",
    "Noise",
    "Problem",
    "Pushes",
    "Shooting",
    "Slopes",
    "as_it_was",
    "autocorrelation",
    "coordinates",
    "dry_steps",
    "fit",
    "growth",
    "has_sensors",
    "inexact",
    "mean_squares",
    "numerical_error",
    "predicted",
    "prior",
    "sensor_noise",
    "simulate",
    "step_sizes",
    "stepped",
    "traced",
    "unexplained",
    "whiteness",
    "without_sensors",
]
