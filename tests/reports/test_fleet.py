"""Which robots of a fleet differ, in what, and since when."""

from made_diagnoses import made_diagnosis, made_effect

from gpsim.findings import Alternative, Estimate
from gpsim.reports.fleet import ODD, Robot, deviations, fleet_page, fleet_picture, headline


def spring(value, half=0.1, **changes):
    size = {"stiffness": Estimate(value, value - half, value + half, "N/m")}
    return made_effect(parameters=size, **changes)


def robot(name, *effects, verdict="named", alternatives=()):
    return Robot(name, made_diagnosis(verdict=verdict, effects=effects, alternatives=alternatives))


def fleet(*last):
    return [*(robot(f"r{i}", spring(2.0 + 0.01 * i)) for i in range(4)), *last]


def test_robots_alike_do_not_differ():
    robots = fleet(robot("r4", spring(2.05)))
    assert deviations(robots) == []
    assert headline(robots, []) == "no difference among 5 robots"


def test_a_size_apart_differs_and_the_others_do_not():
    robots = fleet(robot("odd", spring(3.0)))
    (found,) = deviations(robots)
    assert (found.robot, found.effect) == ("odd", "spring on q")
    assert found.here.startswith("3.0")
    assert found.others.startswith("2.0")
    assert headline(robots, [found]) == "1 of 5 robots differs: odd"


def test_another_effect_and_a_missing_one_and_since_when():
    late = made_effect(family="constant_force", since=40.0)
    robots = fleet(robot("bent", spring(2.0), late), robot("bare", verdict="none"))
    found = {d.robot: d for d in deviations(robots)}
    assert set(found) == {"bent", "bare"}
    assert found["bent"].since == "since t = 40 s"
    assert found["bent"].others == "none"
    assert (found["bare"].effect, found["bare"].here) == ("spring on q", "none")


def test_of_explanations_that_cannot_be_told_apart_the_fleets_counts():
    mass = made_effect(family="parameter_offset", on="mass")
    unsure = robot("unsure", mass, verdict="ambiguous", alternatives=(Alternative((spring(2.0),), 0.5),))
    assert deviations(fleet(unsure)) == []
    apart = robot("apart", mass, verdict="ambiguous", alternatives=(Alternative((spring(4.0),), 0.5),))
    (found,) = deviations(fleet(apart))
    assert (found.effect, found.here[:3]) == ("spring on q", "4.0")


def test_who_says_nothing_is_not_compared_and_is_counted():
    robots = fleet(robot("lost", verdict="unknown"), Robot("broken", None, "no such file"))
    assert deviations(robots) == []
    assert "1 could not be diagnosed; no account was possible for 1" in headline(robots, [])


def test_the_page_holds_every_account_and_lets_nothing_in():
    robots = fleet(robot("<b>odd</b>", spring(3.0)), Robot("broken", None, "no <such> file"))
    page = fleet_page(robots, [""] * len(robots))
    assert page == fleet_page(robots, [""] * len(robots))
    assert "<b>odd" not in page
    assert "no &lt;such&gt; file" in page
    assert page.count("<details>") == 6
    assert "1 of 5 robots differs" in page


def test_the_picture_shows_what_most_have_and_marks_who_is_apart():
    lone = made_effect(family="constant_force", on="q")
    robots = fleet(robot("odd", spring(3.0)), robot("bare", lone), Robot("broken", None, "no such file"))
    figure = fleet_picture(robots, deviations(robots))
    (axis,) = figure.axes
    assert axis.get_title(loc="left") == "spring on q"
    dots = {line.get_xdata()[0]: line for line in axis.lines if line.get_marker() == "o"}
    assert sorted(dots) == [0, 1, 2, 3, 4]  # of those that have it
    assert [i for i, dot in dots.items() if dot.get_color() == ODD] == [4]
    assert dots[4].get_ydata()[0] == 3.0
    assert "<img" in fleet_page(robots, [""] * len(robots))
    assert fleet_picture([robot("bare", verdict="none")], []) is None
