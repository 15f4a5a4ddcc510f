"""Few laws, one after another from nothing: a model may be right but for a thing or two.

Rows of all of a robot's joints, which are usual, would make up for these between them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.diagnosis.fitting import Shooting, mean_squares, sensor_noise, whiteness
from gpsim.diagnosis.ladder.account import bill
from gpsim.diagnosis.ladder.offers import Offers
from gpsim.diagnosis.ladder.search import PROBED, Search
from gpsim.diagnosis.ladder.twins import swap
from gpsim.recordings import evenly

FEW, LEAVE = 3, 0.003  # laws that may be all that is missing; of the misfit, that they leave then
NEARLY = 0.1  # of the misfit: where few laws leave no more, others in their place may leave nothing
AS_NOISE = 2.0  # times the sensors' variance: as good as nothing
LEFT_BY_ONE = 0.7  # of the misfit: where the best law leaves more, more than few are missing
OFFERED = 15  # windows by which they are offered


def few_suffice(search: Search) -> bool:
    """Fit the search's account with few laws, each exactly; whether they leave nothing."""
    problem, measured = search.shooting.problem, search.account.fit.starts
    search.under_sensors()
    search.refit(3)
    search.base = search.account.fit
    some = evenly(len(measured), OFFERED)
    thin = Shooting(problem.on(problem.windows.take(some)))
    for _ in range(FEW):
        # Start states that were fitted without a law that is missing may be far from where they are with it.
        thin.noise = replace(search.shooting.noise, weights=thin.base_weights)
        point = thin.at(search.account.hypothesis, measured[some])
        absent = [law for law in search.laws if not (law.stiff or search.account.holds(law))]
        offers = Offers(thin, point)
        if not search.add_best(offers.simulated(offers.of(absent)), PROBED, measured):
            break
        if search.left() > LEFT_BY_ONE * search.missing():
            return False
        if search.left() <= 0.0 and whiteness(problem, search.account.fit) > search.verdict.chance:
            break
    search.only_few = search.left() <= NEARLY * search.missing()
    if search.only_few and search.left() > LEAVE * search.missing():
        swap(search)
    return search.left() <= LEAVE * search.missing() and _leave_little(search)


def _leave_little(search: Search) -> bool:
    """Whether a little is left in every channel: one joint that is far off hides all others in a sum."""
    problem, residual = search.shooting.problem, search.account.fit.residuals
    noise = AS_NOISE * sensor_noise(problem, residual) ** 2
    left, was = (np.maximum(mean_squares(problem, r) - noise, 0.0) for r in (residual, search.base.residuals))
    return bool((left <= NEARLY * was)[problem.observed].all())


def few_are_better(few: Search, usual: Search) -> bool:
    """Whether few laws explain more for their price than all that is usual does, each under its own noise.

    Where they leave much, more is missing than few laws, and their noise is what they leave.
    """
    if not _leave_little(few):
        return False
    effective, per_law = few.shooting.noise.effective, few.numbers.law
    saved = bill(usual.account.laws, effective, per_law) - bill(few.account.laws, effective, per_law)
    return saved > few.profiled(usual.account)
