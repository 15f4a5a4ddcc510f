"""The trace in words: a line a decision, what is alike said once."""

from gpsim.diagnosis.run import Decision
from gpsim.reports.statistics_text import difference, trace_lines

DRAG, FRICTION, SPRING = "quadratic_drag on q", "coulomb_friction on q", "spring on q"


def decided(step, candidate, over, taken=True, rule="good share", **numbers):
    return Decision(step, candidate, over, taken, rule, **numbers)


def test_a_line_says_what_is_added_and_dropped_and_what_both_have():
    assert difference((FRICTION, DRAG), (FRICTION,)) == f"+ {DRAG} (beside {FRICTION})"
    assert difference((FRICTION, SPRING), (FRICTION, DRAG)) == f"+ {SPRING} - {DRAG} (beside {FRICTION})"
    assert difference((), (DRAG,)) == f"- {DRAG}"
    assert difference((DRAG,), (DRAG,)) == f"the same terms (beside {DRAG})"


def test_decisions_stand_below_their_step_and_are_told_once():
    won = decided("search", (DRAG,), (), gain=12.34, share=0.5)
    lost = decided("judge", (SPRING,), (), taken=False, rule="too few nats", gain=-1.0, share=0.0)
    lines = trace_lines([won, won, lost])
    assert lines[0] == "search"
    assert lines[2] == "judge"
    assert len(lines) == 4
    assert lines[1].split()[:8] == ["taken", "12.3", "nats", "50", "%", "good", "share", "+"]
    assert "refused" in lines[3]
    assert "too few nats" in lines[3]


def test_what_was_never_weighed_has_no_numbers():
    (_, line) = trace_lines([decided("search", (DRAG,), (), taken=False, rule="promises too little")])
    assert line.count("–") == 2
