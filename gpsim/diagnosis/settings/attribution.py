"""Settings of the attribution: how much of a mismatch is explained, and which effects are claims."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import check, setting

ISSUED = "the words of this project: DESIGN.md, headline"


@dataclass(frozen=True)
class AttributionSettings:
    """Rollouts that overlap, blocks that are drawn together, and when an effect is a headline."""

    stride: int = setting(3, "samples", "between the starts of two rollouts", least=1)
    most: int = setting(120, "rollouts", "that are judged on, evenly spread, at most", least=2)
    short_part: float = setting(
        0.25,
        "1",
        "of the time, that may lie in stretches too short for a rollout, before rollouts are cut shorter",
    )
    fewest_blocks: int = setting(
        8,
        "blocks",
        "of a rollout's length: with fewer held out the whole recording is judged on in turn, with fewer in it "
        "there are no intervals",
        least=2,
    )
    folds: int = setting(5, "1", "parts of the whole recording, each judged by what the others say", least=2)
    draws: int = setting(400, "1", "of all blocks", least=1)
    low: float = setting(0.05, "1", "quantile of the draws that is an interval's lower end", "usual: 90 %")
    high: float = setting(0.95, "1", "quantile of the draws that is its upper end", "usual: 90 %")
    lead: int = setting(
        12, "transitions", "before a rollout, from which each account says where that begins", least=1
    )
    begins: float = setting(
        0.05,
        "1",
        "of the base's squares in any channel, that noise may make of rollouts that begin in measured states",
    )
    worst: float = setting(
        20.0, "standard deviations", "of a channel: an error that is larger counts as large as that"
    )
    stands_out: float = setting(
        2.0,
        "1",
        "times the root mean square that noise alone makes: a channel's mismatch that is less does not count",
    )
    headline: float = setting(
        0.05, "1", "share of the mismatch that a headline effect accounts for at the least"
    )
    large: float = setting(
        0.2,
        "1",
        "share of the mismatch from which an effect is a headline if it is needed by what is left, if not by `needed`",
        "a machine of seed 77: Coulomb friction of 42 % was needed by 2.3 %, with 1 % left",
    )
    needed: float = setting(
        0.055,
        "1",
        "share that goes when it goes, at the least",
        "rough worlds of seed 2040 after it was opened: 12 of 39 stand-ins for nuisances were needed by less, and 4 of "
        "171 true effects",
    )
    needed_of_left: float = setting(
        5.0,
        "1",
        "or times what the account leaves, if that is less: with clean sensors little is left",
        "by hand, on 48 rough worlds of seeds 31 and 51, and EMPS, whose offset is needed by six times what is left",
    )
    seldom: int = setting(
        5,
        "blocks",
        "in which an effect decides that is a headline for that: a limit that is seldom reached, say",
        least=1,
    )
    decides: float = setting(
        4.0,
        "1",
        "times the squares with it, or those of noise: so large are they without it where it decides",
    )
    better: float = setting(
        1.2, "1", "times the base's error one step ahead: an account that surely makes more of it is not told"
    )

    def __post_init__(self) -> None:
        check(self, shares=("low", "high", "short_part", "headline", "needed"))


@dataclass(frozen=True)
class SupportSettings:
    """Whether a slight effect, or one behind a gate, holds in both halves of where it acts, and none does harm."""

    rounds: int = setting(3, "1", "of taking terms out and searching on without them, at most", least=1)
    harms: float = setting(
        0.003,
        "1",
        "of the mismatch, that more is explained without an effect that does harm",
        "as much as is needed",
    )
    spare: float = setting(
        0.5,
        "1",
        "times what the account leaves: an effect that is needed by less, and explains much, is one that others share",
        "by hand: the mass of the open cart-pole rig, without which rollouts end further off, is needed by two thirds "
        "of what is left; on rough worlds of seeds 31 and 51 what stood beside the true law, by less than half",
    )
    grows: float = setting(
        1.5,
        "1",
        "times the squared error of some channel: an effect without which it surely grows by that does no harm and is "
        "not spare",
        "a machine of seed 77: a cart and a pole that falls; dry friction without which the cart's error is 13 times "
        "as large was spare by its share of the whole, which the pole decides",
    )
    acts: float = setting(
        0.05, "1", "of the most that it changes in any window: it acts in windows where it changes more"
    )
    fewest: int = setting(4, "windows", "a half must have, else it cannot be asked", least=2)
    apart: float = setting(
        3.0, "standard errors", "of both halves together, by which their estimates may differ"
    )
