"""Settings of the fitting: simulated windows, the fits to them, and what their likelihoods are worth."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import check, setting

NEAR_BY = (
    1.5,
    1.0,
    0.7,
    0.5,
    0.35,
    0.25,
    0.15,
    0.1,
    0.06,
    0.04,
    0.02,
    0.01,
)  # the near places of both patterns
OF_STEPS = "of a parameter's own finite-difference steps"  # unit of the patterns


@dataclass(frozen=True)
class ShootingSettings:
    """Multiple shooting: how a hypothesis is fitted to windows by damped Gauss-Newton steps."""

    iterations: int = setting(25, "1", "most steps of a fit that is made to its end")
    tolerance: float = setting(0.02, "nats", "a step that gains less ends such a fit")
    patience: int = setting(
        4, "1", "rejected steps in a row, each more cautious, before a fit is taken to stand still", least=1
    )
    patience_of_starts: int = setting(2, "1", "the same where only start states are fitted", least=1)
    first_damping: float = setting(
        1e-3,
        "1",
        "damping that a fit begins with, of a normal matrix with a unit diagonal",
        "Marquardt (1963)",
    )
    damping_shrinks: float = setting(5.0, "1", "divides the damping after an accepted step", least=1)
    damping_grows: float = setting(8.0, "1", "multiplies the damping after a rejected step", least=1)
    most_damping: float = setting(1e6, "1", "damping at most")
    least_damping: float = setting(1e-9, "1", "damping at least, as long as steps are accepted")
    no_damping: float = setting(
        1e-14,
        "1",
        "damping at least where a step without any promises more: what a rejected step can still multiply",
    )
    state_step: float = setting(
        1e-5, "1", "finite difference of a start state, in parts of the channel's typical size", least=1e-12
    )
    parameter_step: float = setting(
        1e-4, "1", "finite difference of a smooth parameter, in parts of its typical size", least=1e-12
    )
    pattern_rounds: tuple[int, ...] = setting(
        (1, 3, 5, 8), "1", "steps before which places of a law that jumps are looked for far and near"
    )
    first_pattern: tuple[float, ...] = setting(
        (12.0, 11.5, 11.0, 10.5, 10.0, 9.5, 9.0, 8.5, 8.0, 7.5, 7.0, 6.5, 6.0, 5.5, 5.0, 4.5, 4.0, 3.5, 3.0, 2.5,
         2.0, *NEAR_BY),
        OF_STEPS,
        "distances to either side that are looked at the first time: a threshold's valley may be as narrow as a step",
    )  # fmt: skip
    pattern: tuple[float, ...] = setting(
        (12.0, 8.0, 6.0, 4.0, 3.0, 2.0, *NEAR_BY), OF_STEPS, "distances that are looked at later"
    )
    pattern_windows: int = setting(80, "windows", "on which the places of a pattern are judged", least=1)
    hopeless: float = setting(
        60.0,
        "nats",
        "behind the best of several fits after a few iterations, that no further ones make good",
    )

    def __post_init__(self) -> None:
        check(self, lists=("pattern_rounds", "first_pattern", "pattern"))


@dataclass(frozen=True)
class EvidenceSettings:
    """What a gain in likelihood is worth: correlated samples, the price of parameters, the test for whiteness."""

    longest_lag: int = setting(12, "samples", "up to which a residual's autocorrelation is summed", least=1)
    gate_parameters: int = setting(2, "1", "parameters that a gate is paid as", "it has two edges")
    whiteness_lags: int = setting(
        3, "samples", "lags at which a white residual must not be correlated", least=1
    )
    at_floor: float = setting(
        1.01, "1", "times the floor (known noise, numerical error): a residual that small is white"
    )
    projected_windows: int = setting(
        60,
        "windows",
        "over which the share is averaged that fitting start states takes off white noise",
        least=1,
    )
    doubled: float = setting(
        5.0,
        "nats",
        "that a size costs a factor of two outside of the usual range, four times that a factor of four",
        "by reason: odds of a hundred and fifty against a mass of eight times, none against one of four times",
    )
    most_unusual: float = setting(
        50.0, "nats", "that a size costs at most: physics that is sure enough may be unusual"
    )


@dataclass(frozen=True)
class DiscretisationSettings:
    """Substeps of the fine scheme, and the numerical error that they leave."""

    substeps: tuple[int, ...] = setting(
        (2, 3, 4, 6, 8, 12, 16, 24), "1", "of a transition, that the fine scheme may take", least=1
    )
    usual_substep: float = setting(
        0.0125,
        "s",
        "where friction may hold something at rest",
        "what friction at rest needs on robots",
        least=1e-6,
    )
    most_usual: int = setting(6, "1", "substeps that this may ask for", least=1)
    slow: float = setting(
        0.5, "s", "transitions longer than this belong to systems for which seconds are no guide"
    )
    tolerated: float = setting(3e-3, "1", "of a channel's spread: what halving the substep may change")
    tolerated_noise: float = setting(3.0, "1", "or this part of the known noise: one in three", least=1)
    margin: float = setting(
        2.0,
        "1",
        "on the change when the substep is halved",
        "a third-order scheme's error is 8/7 of that change, 4/3 where friction stops a body",
    )
    sampled_windows: int = setting(
        40, "windows", "on which the base simulator's numerical error and mismatch are measured", least=1
    )
    error_iterations: int = setting(4, "1", "of the fit around which the numerical error is measured")
    mismatch_iterations: int = setting(8, "1", "of the base simulator's fit that says how far it is off")
    finer_gain: float = setting(5.0, "nats", "that a grid twice as fine must gain")
    finer_iterations: int = setting(8, "1", "of a fit on a finer grid")
    most_finer: int = setting(4, "1", "times as many substeps as the base simulator needs, at most", least=1)
    uneven_finer: float = setting(
        4.0,
        "1",
        "times as many substeps as usual that an uneven clock may have where a delay is simulated",
        least=1,
    )

    def __post_init__(self) -> None:
        check(self, lists=("substeps",))


@dataclass(frozen=True)
class ScoreTestSettings:
    """Screening: what a term could gain at best, from one simulation of it."""

    small_start: float = setting(
        0.05,
        "1",
        "of what a starting value changes: so much of a law that grows with its only parameter is screened, too",
        "where motion is sensitive, what a large change does is no line",
    )
    scan_reaches: tuple[float, ...] = setting(
        (0.5, 0.05, 0.005),
        "1",
        "of a law's only parameter, to either side: scans that narrow",
        "dry friction in coarse steps has many local optima",
    )
    scan_places: int = setting(25, "1", "that each scan looks at", least=1)
    clipped_at: float = setting(
        1e4, "standard deviations", "of the residual, to which the change of a sample is clipped"
    )


@dataclass(frozen=True)
class PatchworkSettings:
    """When terms patch together a law that none of them is."""

    same_edge: float = setting(
        0.05,
        "1",
        "of a region's width: edges nearer to each other are one that was placed twice",
        "a region is a bin of 24 at least: edges are placed and known no better than that",
    )
    least_range: float = setting(
        0.15, "1", "of the largest command that is followed: a smaller range of commands is none"
    )


@dataclass(frozen=True)
class SensorInversionSettings:
    """From what a sensor says to the true state that makes it say so."""

    iterations: int = setting(20, "1", "Newton's steps at most")
    settled: float = setting(1e-9, "1", "of a channel's typical size: a step that small is the last")
    nudge: float = setting(
        1e-3,
        "1",
        "of a channel's typical size: how far a state is moved to see what its sensor makes of it",
        least=1e-12,
    )
    least_gain: float = setting(0.01, "1", "a sensor that answers less is taken for one that reads the truth")
    most_gain: float = setting(100.0, "1", "a sensor that answers more is, too")


@dataclass(frozen=True)
class ClosedStepSettings:
    """Simulators that own their integration (MuJoCo models): steps are dear, their length is a part of the model."""

    fitted: int = setting(
        100,
        "windows",
        "that the final fits use, and that are held out, at most",
        "a step costs ten times that of closed equations",
        least=1,
    )
    searched: int = setting(56, "windows", "that the search looks at, at most", least=1)
    judged: int = setting(40, "rollouts", "that an account is judged on, evenly spread, at most", least=2)
    screened: int = setting(
        48,
        "windows",
        "of the usual length, on which terms to add or to put in another's place are screened",
        least=1,
    )
    coarser: tuple[int, ...] = setting(
        (20, 10, 5, 4, 3, 2),
        "1",
        "times as long as its own the steps may be in which slopes are found, the first that will do",
    )
    tolerated: float = setting(
        0.003,
        "1",
        "of a channel's spread: what these longer steps may change in a window, root mean square",
        "by hand, on an arm whose joints all rub: fits by worse slopes creep, and end far from where they should",
    )
    tolerated_error: float = setting(
        3e-4, "1", "of a channel's spread: what halving the steps may change, if it is more than noise hides"
    )
    dry_finer: tuple[int, ...] = setting(
        (1, 3, 6),
        "1",
        "times as many steps where dry friction acts, the first that will do: it stops a body at the end of a step",
        "by hand, on concealed pendulums whose dry friction was given for Stribeck's, or a slight mass beside it",
    )
    dry_joints: int = setting(
        3,
        "joints",
        "of a model, at most, whose dry friction is stepped finely",
        "by hand: an arm of six spent what it may before it had named all that was missing",
    )
    dry_windows: int = setting(12, "windows", "on which that is asked, of every joint", least=1)
    unstable: float = setting(
        10.0,
        "1",
        "times as far apart that two simulations may be at a window's end that began slightly apart: longer are cut",
        "by hand: on poles that fall, windows of 25 transitions lead fits into local minima; robots that are held "
        "stay below 7",
        least=1.0,
    )
    shortest: int = setting(5, "transitions", "that such a window keeps", least=1)
    coarser_exact: tuple[int, ...] = setting(
        (8, 5, 4, 3, 2, 1), "1", "times as long as its own, steps of a method of higher order that are tried"
    )
    cost_of_exact: float = setting(
        4.0, "1", "steps of its own that such a step costs", "Runge and Kutta's four stages"
    )
    most_finer: int = setting(
        2,
        "1",
        "times as many steps as a transition takes, at most, that the best hypothesis may ask for",
        least=1,
    )
    slopes_serve: int = setting(
        5, "1", "steps of a fit that slopes by start states serve, as long as they are accepted", least=1
    )
    bins: int = setting(
        12, "1", "bins of a channel, or of time, in one of which a term is switched on at a time", least=1
    )
    pattern_windows: int = setting(24, "windows", "on which the places of a pattern are judged", least=1)
    shows: float = setting(
        0.002,
        "1",
        "of the mismatch, that a slight effect explains at least: less no rollout shows",
        "by hand, on concealed robots: beside dry friction, whose stops the model rounds to ends of its own steps, a "
        "mass that is not changed explains up to 0.0017; true slight effects 0.004 and more",
    )
    many: int = setting(
        12,
        "1",
        "parameters of which the slopes serve as long",
        "by hand: all of a robot's own at once, which are fitted for comparison",
        least=1,
    )

    beam: int = setting(
        2,
        "1",
        "hypotheses that each depth of the search grows on",
        "by hand: as many more are as dear",
        least=1,
    )
    completed: float = setting(
        0.05,
        "nats a window",
        "that a round must gain where only start states are fitted, to complete a recording",
    )

    def __post_init__(self) -> None:
        check(self, lists=("coarser", "coarser_exact", "dry_finer"))
