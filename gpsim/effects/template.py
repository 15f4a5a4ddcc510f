"""What `gpsim effects new NAME` writes: a class with a law that can be asked at once, and its test."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from gpsim.effects.brought import INPUTS, RETURNS
from gpsim.errors import UsageError

EFFECT = '''"""An effect of your own: gpsim diagnose RECORDING --effects {file}.py"""

import numpy as np


class {name}:
    """{law}"""

    site = "{site}"
    parameters = {{"{parameter}": ({unit!r}, {low}, {high}, {start})}}  # unit, low, high, where a fit starts

    def law(self, {inputs}, {parameter}):
        # {returns}; all are arrays with one entry per row of the batch: use no loop, and do not change them
        return {formula}
'''
TEST = '''"""Run it with pytest, beside {file}.py."""

import gpsim.effects
import numpy as np
from {file} import {name}


def test_the_law():
    one = np.array([-1.0, 0.0, 2.0])
    said = {name}().law({ones}, np.full(3, {start}))
    np.testing.assert_allclose(said, {expected})


def test_gpsim_takes_it():
    assert [check for check in gpsim.effects.check({name}) if check.wrong] == []
'''


@dataclass(frozen=True)
class Example:
    """What stands in the template of a site: a law that is right, to be replaced."""

    law: str
    parameter: str
    unit: str
    numbers: tuple[str, str, str]
    formula: str
    expected: str


EXAMPLES: Mapping[str, Example] = {
    "force": Example(
        "It pulls back in proportion to its extension, and never pushes: -k max(q, 0).",
        "weight", "N/m", ("0.0", "50.0", "1.0"), "-weight * np.maximum(q, 0.0)", "[0.0, 0.0, -2.0]",
    ),
    "friction": Example(
        "Dry friction of one size.", "force", "N", ("0.0", "50.0", "1.0"), "force + 0.0 * speed", "[1.0, 1.0, 1.0]",
    ),
    "actuator": Example(
        "Positive commands lose a part, negative commands do not: u - w max(u, 0).",
        "loss", "1", ("0.0", "0.9", "0.5"), "u - loss * np.maximum(u, 0.0)", "[-1.0, 0.0, 1.0]",
    ),
    "drive": Example(
        "A drive that weakens with speed: u / (1 + a abs(speed)).",
        "fall", "s/m", ("0.0", "10.0", "0.5"), "u / (1.0 + fall * np.abs(speed))", "one / (1.0 + 0.5 * np.abs(one))",
    ),
    "parameter": Example(
        "A parameter that is larger than in the simulator.",
        "more", "1", ("-0.5", "5.0", "0.5"), "believed * (1.0 + more)", "1.5 * one",
    ),
    "vehicle": Example(
        "It turns less at higher speed: w (1 - a abs(v)).",
        "loss", "s/m", ("0.0", "2.0", "0.1"), "v, lateral, w * (1.0 - loss * np.abs(v))",
        "(one, one, one * (1.0 - 0.1 * np.abs(one)))",
    ),
    "sensor": Example(
        "A sensor that reads large values too low: y - a y^3.",
        "cubic", "1", ("0.0", "2.0", "0.1"), "y - cubic * y**3", "one - 0.1 * one**3",
    ),
}  # fmt: skip


def template(name: str, site: str) -> dict[str, str]:
    """File name -> its text, of the effect and of its test; raises UsageError for a name that is none."""
    if site not in EXAMPLES:
        raise UsageError(f"--site {site}: there are {', '.join(EXAMPLES)}")
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise UsageError(f"{name}: use lower-case letters, digits and underscores, as rubber_band")
    example, inputs = EXAMPLES[site], INPUTS[site]
    low, high, start = example.numbers
    words = {
        "file": name,
        "name": "".join(part.capitalize() for part in name.split("_")),
        "site": site,
        "law": example.law,
        "parameter": example.parameter,
        "unit": example.unit,
        "low": low,
        "high": high,
        "start": start,
        "inputs": ", ".join(inputs),
        "ones": ", ".join("one" for _ in inputs),
        "returns": RETURNS[site],
        "formula": example.formula,
        "expected": example.expected,
    }
    return {f"{name}.py": EFFECT.format(**words), f"test_{name}.py": TEST.format(**words)}
