"""Fitting: a hypothesis against windows, by multiple shooting."""

from gpsim.diagnosis.fitting.evidence import (
    FEW_JOINTS,
    TOLERATED_NOISE,
    TOLERATED_STEP_ERROR,
    USUAL_SUBSTEP,
    dry_steps,
    growth,
    inexact,
    numerical_error,
    sensor_noise,
    stepped,
    unexplained,
    whiteness,
)
from gpsim.diagnosis.fitting.hypothesis import Candidate, Hypothesis, coordinates
from gpsim.diagnosis.fitting.problem import (
    Problem,
    as_it_was,
    has_sensors,
    mean_squares,
    predicted,
    without_sensors,
)
from gpsim.diagnosis.fitting.shooting import Fit, Noise, Shooting, Slopes, fit, step_sizes
from gpsim.diagnosis.fitting.simulate import Extra, simulate
