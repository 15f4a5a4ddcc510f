"""Corrected simulators: the base with what recordings taught, by a Gaussian process or by named effects."""

from gpsim.corrected.command_filter import CommandFilter, fit_filter, mean_rates, settled_rows
from gpsim.corrected.effects_plant import EffectsPlant, ages_of, describe, plant_from, value_key
from gpsim.corrected.features import Feature, Features
from gpsim.corrected.gp_plant import (
    PREDICTIONS,
    CorrectedPlant,
    FunctionCorrection,
    GpCorrection,
    Prediction,
    arrived_inputs,
)
from gpsim.corrected.posterior_plant import Drawable, PosteriorPlant, Size, Spread
from gpsim.corrected.smoothing import Smoother
