"""Fitting: a hypothesis against windows, by multiple shooting."""

from gpsim.diagnosis.fitting.batch import Order, fit_all, fit_near, fit_order
from gpsim.diagnosis.fitting.discretisation import (
    FINER_GAIN,
    TOLERATED_NOISE,
    TOLERATED_STEP_ERROR,
    USUAL_SUBSTEP,
    dry_steps,
    enough_substeps,
    growth,
    inexact,
    numerical_error,
    rescored,
    settled,
    stepped,
)
from gpsim.diagnosis.fitting.evidence import (
    autocorrelation,
    channel_objectives,
    correlation_time,
    gain,
    price,
    scores,
    whiteness,
)
from gpsim.diagnosis.fitting.gauss_newton import Step, damped_step, jacobians, projected, state_jacobian
from gpsim.diagnosis.fitting.hypothesis import Candidate, Hypothesis
from gpsim.diagnosis.fitting.joint_rows import FEWEST_JOINTS, FREE_ROW, expected, is_row
from gpsim.diagnosis.fitting.multiple_shooting import Curvature, Fit, curvature, fit, start_slopes
from gpsim.diagnosis.fitting.predict import as_it_was, has_sensors, predicted, traced, without_sensors
from gpsim.diagnosis.fitting.problem import Problem, mean_squares, objective, window_costs
from gpsim.diagnosis.fitting.quadratic import Quadratic, quadratic
from gpsim.diagnosis.fitting.rollout import Extra, Pushes
from gpsim.diagnosis.fitting.score_test import Directions, child_of, screened, starts_of, stretched, stronger
from gpsim.diagnosis.fitting.simulate import simulate

__all__ = [
    "FEWEST_JOINTS",
    "FINER_GAIN",
    "FREE_ROW",
    "TOLERATED_NOISE",
    "TOLERATED_STEP_ERROR",
    "USUAL_SUBSTEP",
    "Candidate",
    "Curvature",
    "Directions",
    "Extra",
    "Fit",
    "Hypothesis",
    "Order",
    "Problem",
    "Pushes",
    "Quadratic",
    "Step",
    "as_it_was",
    "autocorrelation",
    "channel_objectives",
    "child_of",
    "correlation_time",
    "curvature",
    "damped_step",
    "dry_steps",
    "enough_substeps",
    "expected",
    "fit",
    "fit_all",
    "fit_near",
    "fit_order",
    "gain",
    "growth",
    "has_sensors",
    "inexact",
    "is_row",
    "jacobians",
    "mean_squares",
    "numerical_error",
    "objective",
    "predicted",
    "price",
    "projected",
    "quadratic",
    "rescored",
    "scores",
    "screened",
    "settled",
    "simulate",
    "start_slopes",
    "starts_of",
    "state_jacobian",
    "stepped",
    "stretched",
    "stronger",
    "traced",
    "whiteness",
    "window_costs",
    "without_sensors",
]
