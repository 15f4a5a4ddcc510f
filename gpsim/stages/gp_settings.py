"""The configuration's `gp`: what the Gaussian processes see, and how they are fitted."""

from __future__ import annotations

from collections.abc import Mapping

from gpsim.corrected import Features
from gpsim.errors import UsageError
from gpsim.gp import Bounds, ChainSettings, FitSettings, Interval
from gpsim.settings import build, number, positive, texts, truth, whole
from gpsim.stages.building import base_plant
from gpsim.stages.stage import Request

OF_THE_STAGE = ("n_train", "inputs", "settle", "filter", "chain", "observations")
"""Settings of `gp` that say what is fitted, not how."""


def check(request: Request) -> None:
    """Raise UsageError for settings that no fit can have."""
    section = request.config["gp"]
    truth(section.get("filter", False), "gp.filter")
    count_of(request), settle_of(request)
    chain, settings = chain_of(request), fit_settings(request)
    if chain is not None:
        try:
            chain.of_slow(settings), chain.of_fast(settings)
        except ValueError as error:
            raise UsageError(f"gp.chain: {error}") from error
    base = base_plant(request.config)
    Features.of(input_names(request), base.state + base.action)


def input_names(request: Request) -> list[str]:
    """The names of the Gaussian processes' inputs, as configured."""
    return texts(request.config["gp"]["inputs"], "gp.inputs")


def fit_settings(request: Request) -> FitSettings:
    """How the Gaussian processes are fitted, as configured."""
    section = request.config["gp"]
    rest = {key: value for key, value in section.items() if key not in OF_THE_STAGE}
    floor = rest.pop("noise_floor", Bounds().noise_std.low)
    try:
        bounds = Bounds(noise_std=Interval(number(floor, "gp.noise_floor"), Bounds().noise_std.high))
    except ValueError as error:
        raise UsageError(f"gp.noise_floor: {error}") from error
    return build(FitSettings, rest, "gp", bounds=bounds)


def chain_of(request: Request) -> ChainSettings | None:
    """How a slow and a fast process share the residual; None: there is one."""
    section = request.config["gp"].get("chain")
    if section is None:
        return None
    if not isinstance(section, Mapping):
        raise UsageError(f"gp.chain: expected settings, as {{least_slow: 1.0}}, or null, got {section!r}")
    return build(ChainSettings, section, "gp.chain")


def settle_of(request: Request) -> int:
    """Control steps that an action must have stood for its row to count."""
    return whole(request.config["gp"].get("settle", 0), "gp.settle")


def count_of(request: Request) -> int:
    """Transitions that the Gaussian processes are conditioned on."""
    return positive(request.config["gp"]["n_train"], "gp.n_train")
