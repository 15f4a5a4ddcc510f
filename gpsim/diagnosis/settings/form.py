"""Settings of the free curves that laws are held against."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import check, setting


@dataclass(frozen=True)
class FormSettings:
    """Whether a law holds: a free curve of its own inputs is fitted beside it and judged on held-out rollouts."""

    approximate: float = setting(
        0.1,
        "1",
        "of what a group of laws explains, that the low end of what a free curve explains more must exceed",
        "a roboticist's tenth: below it the law is right to the accuracy at which sizes are read",
    )
    departs: float = setting(
        0.2,
        "1",
        "of what a group of laws does, in root mean square, that the low end of the curve's difference from it must "
        "exceed, where the curve noticeably explains more",
        "friction without its Stribeck part is off by 0.44 and explains 94 %; laws that are right: less than 0.01",
    )
    noticed: float = setting(
        0.003,
        "1",
        "of the mismatch, that the low end of what such a curve explains more must exceed",
        "as much as makes an effect needed; cogging beside a positioning axis's constant force gains 0.0002",
    )
    over_nameless: float = setting(
        5.0,
        "1",
        "times what surely has no name, where that is much, that a law must explain to be taken for more than the "
        "nearest to it",
        "laws outside the catalogue (seed 2040 after it was opened): twelve were called by laws that explained at most "
        "4.1 times what was left",
    )
    windows: int = setting(
        240, "1", "windows, of the usual length, that a curve is fitted to", "as many as lack of fit", least=1
    )
    knots: int = setting(
        16,
        "1",
        "knots of a curve of one input",
        "of 10, 14, 16 and 18 the fewest with which cubic springs and root-shaped friction come out within 2 %",
        least=2,
    )
    knots_of_measured: int = setting(
        24,
        "1",
        "knots of a measured curve of one input, which stands for a law",
        "with 16 the last knots of -3 sin(4 v) were off by a tenth of its range",
        least=2,
    )
    knots_of_two: int = setting(
        5, "1", "knots along each input of a law that has two, as a vehicle's", least=2
    )
    knots_of_product: int = setting(
        9, "1", "knots of a curve of one input that a further one multiplies", least=2
    )
    further_knots: int = setting(4, "1", "knots along the one further input that lack of fit names", least=2)
    least_side: float = setting(
        0.02,
        "1",
        "of all samples, that must move in a direction for friction to have a curve of its own there",
    )
    rounds: int = setting(
        5,
        "1",
        "times that a curve is fitted, each around the last",
        "by hand: smooth laws need one or two, friction that sticks is no line and needs more",
        least=1,
    )
    blocks: int = setting(
        8, "1", "blocks of neighbouring windows, each left out once to choose how smooth a curve is", least=2
    )
    smoothness: tuple[float, ...] = setting(
        (-8.0, -6.0, -4.5, -3.0, -1.5, 0.0, 2.0),
        "1",
        "logarithms to base 10 of the weights of a curve's bends, in parts of what the data say",
        least=-12.0,
    )
    shrinkage: tuple[float, ...] = setting(
        (-6.0, -4.0, -2.0, 0.0, 3.0),
        "1",
        "logarithms to base 10 of the weights of a curve's distance from the law, in parts of what the data say",
        least=-12.0,
    )
    curves: int = setting(
        3,
        "1",
        "measured curves, at most, that stand in the place of laws that do not hold, or of what has none",
        least=0,
    )
    stands: float = setting(
        0.05,
        "1",
        "of what a group of laws does, in root mean square, that the low end of a measured curve's difference from it "
        "must exceed to stand in its place",
        "laws that are right: less than 0.02, with what a simulator's own step leaves; tanh under a viscous name 0.18",
    )
    follows: float = setting(
        0.02,
        "1",
        "of what a measured curve does, on squares, that laws of the catalogue may miss to be tried in its place",
        "laws that stand for a curve and miss more have lost to it by what made it stand",
    )
    points: int = setting(41, "1", "places at which a curve is drawn", least=2)

    def __post_init__(self) -> None:
        check(self, lists=("smoothness", "shrinkage"), shares=("least_side",))
