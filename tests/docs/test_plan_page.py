"""The worked example of how-to/plan.md, run as it stands: what was ambiguous is named after the plan was played."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "plan.md"


@pytest.mark.slow
def test_the_worked_example_ends_in_a_name():
    (code,) = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), flags=re.M | re.S)
    names = {}
    exec(compile(code, str(PAGE), "exec"), names)
    before, after = names["before"], names["after"]
    assert before.verdict == "ambiguous"
    assert after.verdict == "named"
    assert {e.family for e in after.effects} == {"viscous_friction", "spring", "actuator_lag"}
    (lag,) = (e.parameters["time_constant"] for e in after.effects if e.family == "actuator_lag")
    assert 0.04 < lag.value < 0.06
