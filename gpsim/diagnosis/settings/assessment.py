"""Settings of the assessment: what an answer is worth on held-out data, where the mismatch lies, what is left."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import check, setting

BY_PROOF = "usual; the blind tests count how many of the intervals hold"  # origin of the intervals' level


@dataclass(frozen=True)
class ComparisonSettings:
    """Single steps on which models are compared, and the base simulator tuned as an identification tool would."""

    steps: int = setting(3000, "transitions", "to learn from, and as many held out, at most", least=2)
    looked_at: int = setting(20_000, "transitions", "evenly spread, from which these are taken", least=2)
    tuned_iterations: int = setting(15, "1", "of the fit of the base simulator's own parameters")
    tuned_tolerance: float = setting(0.5, "nats", "a step that gains less ends that fit")
    base_iterations: int = setting(8, "1", "of the fit of start states that it has to beat")


@dataclass(frozen=True)
class RolloutSettings:
    """Rollouts on held-out data."""

    horizon: float = setting(1.0, "s", "of a rollout; a usual window at least")
    longest: int = setting(200, "transitions", "of a rollout at most", least=2)
    most: int = setting(400, "rollouts", "that are compared, at most", least=1)
    looked_at: int = setting(4000, "windows", "evenly spread, from which these are taken", least=1)


@dataclass(frozen=True)
class BootstrapSettings:
    """Intervals of an error over the base simulator's, from a paired bootstrap over blocks (Kuensch 1989)."""

    block: int = setting(25, "samples", "in a row that are drawn together", "a usual window", least=1)
    fewest_blocks: int = setting(
        8, "blocks", "shorter ones are drawn, or no interval is told, where there are fewer", least=1
    )
    draws: int = setting(400, "1", "of all blocks", least=1)
    low: float = setting(0.05, "1", "quantile of the draws that is the interval's lower end", "usual: 90 %")
    high: float = setting(0.95, "1", "quantile of the draws that is its upper end", "usual: 90 %")

    def __post_init__(self) -> None:
        check(self, shares=("low", "high"))


@dataclass(frozen=True)
class RemainderGPSettings:
    """The Gaussian process on what is left, and when simulations are better with it."""

    rows: int = setting(250, "transitions", "that it learns from, at most", least=2)
    most_share: float = setting(
        0.8, "1", "of those there are, that it learns from: it is judged on the others"
    )
    restarts: int = setting(2, "1", "of the fit of its hyperparameters", least=1)
    screening_iterations: int = setting(5, "1", "after which the best start is chosen")
    iterations: int = setting(60, "1", "of the fit from there, at most", least=1)
    helps: float = setting(0.99, "1", "times the error without it, that it must reach in some channel")
    harms: float = setting(1.05, "1", "times the error without it, that it may make in no channel")
    much_better: float = setting(
        0.9, "1", "times the errors of the one beside the effects, below which one on the base alone is taken"
    )


@dataclass(frozen=True)
class LocationSettings:
    """On which inputs a residual depends."""

    bins: int = setting(8, "1", "of equal numbers of samples, in which a residual is averaged", least=1)
    least_share: float = setting(0.05, "1", "of its variance, that an input must explain to be named")
    glitch: float = setting(
        8.0, "1", "times the typical residual: more is clipped, as a leap of the sensor is"
    )


@dataclass(frozen=True)
class ConcentrationSettings:
    """In which part of state, action or time nearly all of a mismatch lies."""

    bins: int = setting(40, "1", "of equal numbers of samples, into which an input is cut", least=2)
    fewest_samples: int = setting(400, "samples", "with fewer, chance may put a mismatch anywhere", least=1)
    least_mismatch: float = setting(0.25, "1", "of the noise's mean square, that the mismatch's must be")
    held: float = setting(0.9, "1", "of the mismatch, that a part must hold")
    few: float = setting(0.35, "1", "of the samples, that such a part may hold at most")
    many: float = setting(
        0.8, "1", "of the samples, that it may hold where its edges are sharp, as an onset's are"
    )
    sharp: float = setting(0.5, "1", "of the density within, that the mismatch must have at such edges")
    outside: float = setting(0.1, "1", "of the density within, that it may have outside")
    edge: int = setting(2, "bins", "that make an edge", least=1)


@dataclass(frozen=True)
class ExperimentDesignSettings:
    """Which excitations are tried to tell rivals apart."""

    seconds: float = setting(3.0, "s", "of an excitation")
    fewest: int = setting(20, "transitions", "of one at least", least=2)
    most: int = setting(150, "transitions", "of one at most", least=2)
    levels: tuple[float, ...] = setting(
        (0.25, 1.0, 1.5), "1", "of an action's large commands, that are tried"
    )
    large: float = setting(0.95, "1", "quantile of an action's sizes that is a large command")
    rests: float = setting(
        0.01, "1", "of an action's largest command: where the large one is less, those at rest do not count"
    )
    fast_period: int = setting(10, "control steps", "of the fast wave", least=2)
    held: int = setting(5, "control steps", "for which a random level is held", least=1)
    visible: float = setting(
        1.0, "standard deviations", "of the noise: a smaller difference nobody could see"
    )

    def __post_init__(self) -> None:
        check(self, lists=("levels",), shares=("large",))


@dataclass(frozen=True)
class TraceSettings:
    """What the pictures of rollouts show."""

    stretches: int = setting(
        40, "1", "held out, among which the worst and the median are looked for", least=1
    )
    most: int = setting(12, "rollouts", "of a stretch; a longer one is shown in parts", least=1)
    most_alone: int = setting(4, "rollouts", "of a part where that would be the only stretch", least=1)
    channels: int = setting(3, "1", "that are shown: those in which the base is furthest off", least=1)


@dataclass(frozen=True)
class CombinationSettings:
    """Parameters that only act together: when a direction is open, and which of them take part in it."""

    wide: float = setting(
        0.2,
        "1",
        "standard deviation of a parameter's logarithm that leaves it open: its interval is a third to either side",
        "a cart-pole rig: a mass of 7.8 to 18.9 times, and a gain of 3 to its bound of 5, that only act together",
    )
    sharper: float = setting(
        5.0, "1", "times better than its loosest parameter, that the data must know a product"
    )
    follows: float = setting(
        10.0,
        "1",
        "times what a value at its bound would vary with all others held, from which these follow it",
    )
    takes_part: float = setting(0.05, "1", "of the largest component, below which a parameter takes no part")
    simple: float = setting(0.08, "1", "within which an exponent is the nearest whole number, half or third")

    def __post_init__(self) -> None:
        check(self, shares=("takes_part",))


@dataclass(frozen=True)
class IntervalSettings:
    """How well the data know each parameter."""

    level: float = setting(0.90, "1", "probability with which an interval holds its parameter", BY_PROOF)
    chance: float = setting(1.5, "samples", "up to which a residual's correlation time is white noise's")
    undetermined: float = setting(
        1e-13, "1", "of the largest eigenvalue: the windows know as much at least of any direction"
    )
    runs: int = setting(
        20, "1", "runs of neighbouring windows whose gradients scatter, too: what drifts shows there", least=2
    )
    first_pace: float = setting(
        0.0625, "1", "of a jumping parameter's own step: how far the profile's first place lies"
    )
    pace_grows: float = setting(1.5, "1", "multiplies the pace until a place is too far")
    falls_back: float = setting(0.25, "1", "of a first place that was too far, which is asked next")
    places: int = setting(14, "1", "that a profile asks at most", least=1)
    close: float = setting(0.1, "1", "of the half width, how exactly it is narrowed down")
    model_error: float = setting(
        0.45,
        "1",
        "of what a size does: its standard deviation by what has no name, if that were all of the mismatch",
        "rough worlds of seed 2040 after it was opened: intervals held 55 % of 184 sizes without it, 88 % with it",
    )
    profile_iterations: int = setting(3, "1", "of the fit of all else at each place")

    def __post_init__(self) -> None:
        check(self, shares=("level",))
