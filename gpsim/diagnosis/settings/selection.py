"""Settings of the selection: which of the candidates are taken."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import setting

EFFORT = "by hand, for a minute of one core at most; 2e8 rows take about twenty seconds"


@dataclass(frozen=True)
class AcceptanceSettings:
    """When one hypothesis is worth taking over another: the thresholds of its six rules."""

    per_term: float = setting(
        4.0,
        "nats",
        "that a term must bring beside its parameters' price",
        "the log of their number: dozens",
    )
    good_share: float = setting(0.02, "1", "of the variance left over in some channel, that it must remove")
    beyond_doubt: float = setting(10.0, "nats", "of gain that are beyond doubt for a slight share")
    structured: float = setting(
        0.01, "1", "p-value below which a residual is not white", "usual significance"
    )


@dataclass(frozen=True)
class SearchSettings:
    """The beam search: singles first, then pairs and triples as long as the data pay for them."""

    beam: int = setting(
        3,
        "1",
        "hypotheses that each depth grows on",
        "a trial on 100 concealed worlds, 46 of 50 blind ones right with it; others were not tried",
        least=1,
    )
    depth: int = setting(
        3,
        "1",
        "terms that it adds one after the other; the stepwise search goes on from there",
        "as `beam`",
        least=1,
    )
    fitted_per_depth: tuple[int, ...] = setting(
        (18, 9, 7),
        "1",
        "terms that are fitted of those screened, depth by depth; deeper, as many as at the last",
    )
    budget: float = setting(
        2.5e8, "simulated rows", "effort after which it grows no deeper; improving goes on from there", EFFORT
    )

    def __post_init__(self) -> None:
        if not self.fitted_per_depth:
            raise ValueError(
                "fitted_per_depth is empty: expected a number of terms for each depth, as [18, 9, 7]"
            )


@dataclass(frozen=True)
class StepwiseSettings:
    """The stepwise search on all training windows: one more term, another one in the place of each, finer edges."""

    most_terms: int = setting(7, "1", "terms of a hypothesis to which no further one is added")
    budget: float = setting(2e8, "simulated rows", "effort after which no further round begins", EFFORT)
    substitution_budget: float = setting(
        2e8,
        "simulated rows",
        "effort beyond that after which no term is replaced, and no rival rid of what it does not need",
        EFFORT,
    )
    total_budget: float = setting(
        6e8,
        "simulated rows",
        "effort of the whole diagnosis, the search included, after which both end",
        EFFORT,
    )
    least_budget: float = setting(
        1.5e8, "simulated rows", "effort that it may spend in any case, whatever the search has spent", EFFORT
    )


@dataclass(frozen=True)
class LackOfFitSettings:
    """The score test of smooth laws of state and command: whether one explains what is left over."""

    significance: float = setting(
        1e-6, "1", "p-value, corrected for the number of groups, below which chance has not done it"
    )
    windows: int = setting(240, "1", "windows, of the usual length, that are looked at", least=1)
    paired_inputs: int = setting(
        7,
        "1",
        "inputs, those that explain most alone, of which every two are looked at",
        "by hand: pairs of many would take longer than all the rest of a diagnosis",
    )


@dataclass(frozen=True)
class GateSettings:
    """Gates, a bin at a time: the region or the moment that promises most for a term."""

    bins: int = setting(
        24, "1", "bins of a channel, or of time, in one of which a term is switched on at a time", least=1
    )


@dataclass(frozen=True)
class GateEdgeSettings:
    """Edges of gates: scans of the likelihood that narrow, and joint fits of edges and law.

    Reaches and spacings are shares of the range of the gate's channel, or of the time.
    """

    budget: float = setting(
        4.5e7,
        "simulated rows",
        "effort for the edges of one gate after which no scan begins",
        "by hand: 1e7 rows take about a second of one core, and gates are many",
    )


@dataclass(frozen=True)
class DifferenceSettings:
    """What differs between recordings, asked when what they share has been searched to its end."""

    most: int = setting(
        6, "1", "values of a recording's own that are taken, before what they share is asked again"
    )
    budget: float = setting(
        1e8,
        "simulated rows",
        "effort of each round after which nothing more is asked",
        "as `stepwise.budget`",
    )
