"""Settings of the selection: which of the candidates are taken."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import setting

EFFORT = "by hand, for a minute of one core at most; 2e8 rows take about twenty seconds"
"""Origin of what bounds effort."""


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
    least_part: float = setting(
        1e-4,
        "1",
        "of what the base simulator leaves over there, that it must remove",
        "a hundredth of the amplitude: with clean sensors the last digits of a law are mended by another one",
    )
    slight_share: float = setting(
        0.002,
        "1",
        "of the variance left over, that is enough where the gain is beyond doubt and what is left is white",
    )
    beyond_doubt: float = setting(10.0, "nats", "of gain that are beyond doubt for a slight share")
    better_law: float = setting(
        5.0,
        "nats",
        "of gain that are beyond doubt for a richer law in a simpler one's place",
        "it is not one of dozens, so less than `beyond_doubt` will do",
    )
    seldom_part: float = setting(
        1e-5,
        "1",
        "of the mismatch, that a richer law which acts seldom must remove beside a good share of the rest",
    )
    beyond_all_doubt: float = setting(50.0, "nats", "of gain for so small a part of the mismatch")
    most_of_it: float = setting(
        0.5,
        "1",
        "of the variance left over, that a richer law may remove instead: any part of the mismatch will do",
    )
    no_last_digits: float = setting(200.0, "nats", "of gain for that: the last digits of a law gain less")
    least_held: float = setting(0.03, "1", "of the samples, that a region or an onset must hold")
    most_held: float = setting(0.9, "1", "of the samples, that it may hold: what holds more acts everywhere")
    ordinary: float = setting(
        1.5,
        "1",
        "times the median of all windows' costs: below, nothing unusual is left of a window",
    )
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
    least_gain: float = setting(1.0, "nats", "linear gain that a term must promise, for it to be fitted")
    least_promise: float = setting(
        0.01, "1", "share of the most promising term's linear gain that another must promise, to be fitted"
    )
    same_scheme: float = setting(
        1.0, "nats", "difference within which rk4 steps are as good as fine ones, and are left out"
    )
    fine_preference: float = setting(
        5.0, "nats", "benefit of the doubt for the fine scheme over the base simulator's own step"
    )
    fine_twins: int = setting(3, "1", "hypotheses, the best in coarse steps, that are tried finely, too")
    friction_scans: int = setting(
        3,
        "1",
        "scans of the force of dry friction that chatters in coarse steps, each from where the last ended",
    )
    exact: float = setting(
        2.0,
        "1",
        "times the noise floor: what leaves less in coarse steps is not searched for finely once more",
    )
    outdone: float = setting(
        20.0,
        "nats",
        "by which the usual machine must lead for the beam to grow no deeper",
        "odds of 5e8 to 1",
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
    again_budget: float = setting(
        4e7,
        "simulated rows",
        "effort of searching on without a term that support took out, each time",
        EFFORT,
    )
    screening_windows: int = setting(
        120,
        "1",
        "windows, of the usual length, on which terms to add or to put in another's place are screened",
        least=1,
    )
    gate_windows: int = setting(
        40, "1", "windows, of the usual length, on which every term is looked at behind gates", least=1
    )
    added: int = setting(3, "1", "terms that are fitted on all windows to be added")
    gated: int = setting(3, "1", "terms behind a gate that are fitted on all windows to be added")
    simplified: int = setting(3, "1", "rivals of a round of which what they do not need is taken out")
    least_gain: float = setting(
        3.0, "nats", "linear gain, on all windows, that a term must promise, for it to be fitted"
    )
    gated_below: float = setting(
        1e-3,
        "1",
        "p-value of whiteness below which every term is looked at behind gates, not only the leader's own",
    )
    local_ratio: float = setting(
        3.0,
        "1",
        "times the gain of the best term that acts everywhere: a smooth law that promises more asks for gates",
    )
    least_advance: float = setting(0.1, "nats", "gain by which another leader must be better")
    fine_preference: float = setting(
        15.0, "nats", "loss at which a leader is still integrated finely rather than in coarse steps"
    )
    on_trial: int = setting(
        2, "1", "terms in a row that are taken though they do not pay until the next one does"
    )


@dataclass(frozen=True)
class SubstitutionSettings:
    """Replacing one term by another law, by a special case, or by what may have jumped."""

    fitted: int = setting(3, "1", "terms that are fitted in the place of one, beside its special cases")
    least_share: float = setting(
        0.5, "1", "share of the linear gain of the best in a term's place that another must promise"
    )
    twin_share: float = setting(
        0.9, "1", "share of it that one must promise which can hardly be told from the best"
    )
    as_well: float = setting(5.0, "nats", "loss against the leader within which a hypothesis does as well")
    jumps: int = setting(
        3, "1", "terms that are fitted as what jumped, in the place of a drift or of a slight term"
    )
    slight: float = setting(
        200.0, "nats", "gain of a term so slight that it may stand for one that began late"
    )


@dataclass(frozen=True)
class EliminationSettings:
    """Leaving out what is not needed. A look at some windows, or a few iterations, settles what is beyond doubt."""

    windows: int = setting(
        80, "1", "windows, of the usual length, on which a first look shows what may not be needed", least=1
    )
    many_windows: float = setting(
        1.5, "1", "times `windows`: where there are no more than that, there is no first look"
    )
    clear: float = setting(30.0, "nats", "loss on those windows that settles that something is needed")
    clear_share: float = setting(
        0.2, "1", "share of the variance left over without it that it must remove besides"
    )
    small: int = setting(5, "1", "terms of an account of which each is left out by a fit of its own")
    surely: float = setting(
        60.0,
        "nats",
        "that leaving a smooth term out of a larger account costs at least where it is needed for sure",
    )
    surely_share: float = setting(
        0.05, "1", "of all that is left over, that it must explain besides", "more than twice `good_share`"
    )
    hopeless: float = setting(600.0, "nats", "loss after a few iterations that no further ones make good")
    hopeless_share: float = setting(
        0.5, "1", "share of the variance left over that what was taken out must have removed besides"
    )
    edge_worth: float = setting(100.0, "nats", "loss that edges which are a little off may make good, moved")
    edge_budget: float = setting(
        2e7, "simulated rows", "effort for the edges of one gate where a term is taken out", EFFORT
    )


@dataclass(frozen=True)
class LackOfFitSettings:
    """The score test of smooth laws of state and command: whether one explains what is left over."""

    significance: float = setting(
        1e-6, "1", "p-value, corrected for the number of groups, below which chance has not done it"
    )
    windows: int = setting(240, "1", "windows, of the usual length, that are looked at", least=1)
    knots_of_one: int = setting(7, "1", "knots of a function of one input, at quantiles of it", least=2)
    knots_of_two: int = setting(4, "1", "knots along each input of a function of two", least=2)
    paired_inputs: int = setting(
        7,
        "1",
        "inputs, those that explain most alone, of which every two are looked at",
        "by hand: pairs of many would take longer than all the rest of a diagnosis",
    )
    memories: tuple[float, ...] = setting(
        (2.0, 8.0), "samples", "time constants of the averages over what was commanded before", least=0.1
    )
    probe: float = setting(
        1e-3, "1", "share of a rate's typical size that is added to see how the residual changes", least=1e-9
    )
    functions_at_once: int = setting(
        24,
        "1",
        "functions that are simulated in one batch",
        "by hand, for the memory that a process takes",
        least=1,
    )


@dataclass(frozen=True)
class GridCheckSettings:
    """Whether a finer grid makes a simpler hypothesis as good as the best."""

    tried: int = setting(3, "1", "hypotheses, simpler than the best, that are tried on the finest grid")
