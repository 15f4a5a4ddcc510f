"""Drawing: repeatable, even over the families, and never what would explain itself away."""

from collections import Counter

import pytest

from gpsim.errors import UsageError
from gpsim.stages.prove import numbers_of, robots_numbers
from gpsim.trials import catalogue, drawing, out_of_catalogue
from gpsim.trials.worlds import numbered


def test_a_deck_holds_every_stratum_in_its_share():
    found = Counter(drawing.stratum_of(n)[:2] for n in range(1, drawing.DECK_SIZE + 1))
    assert found == Counter({(s, False): c for s, c in drawing.COUNTS.items()}) + Counter(
        {(s, True): 1 for s in drawing.LONG}
    )
    twenty = Counter(drawing.stratum_of(n)[0] for n in range(1, 20 * drawing.DECK_SIZE + 1))
    assert twenty["single"] >= 200
    assert twenty["pair"] >= 100
    assert twenty["triple"] >= 60
    assert twenty["none"] >= 300
    assert twenty["unknown"] >= 100


def test_every_family_comes_once_a_cycle():
    asked = [family for family, word in catalogue.WORDS.items() if word.asked]
    for stratum, families in (("single", catalogue.DECK), ("words", asked)):
        names = [drawing.first_family(4, stratum, rank) for rank in range(2 * len(families))]
        assert sorted(names[: len(families)]) == sorted(families)
        assert sorted(names[len(families) :]) == sorted(families)


def test_the_same_trial_is_the_same_world():
    assert drawing.draw(7, 3) == drawing.draw(7, 3)
    assert drawing.draw(7, 3) != drawing.draw(8, 3)


def test_worlds_of_every_kind_have_numbers_of_their_own_and_each_comes_as_often():
    found = numbers_of(3, rough=2, curves=5, plan=8)
    kinds = [numbered(n) for n in found]
    assert kinds == [
        *(("plain", i + 1) for i in range(3)), *(("curves", i + 1) for i in range(5)),
        *(("rough", i + 1) for i in range(2)), *(("plans", i + 1) for i in range(8)),
    ]  # fmt: skip
    assert sorted(drawing.draw(91, n).effects[0].family for n in found[3:8]) == sorted(
        out_of_catalogue.CURVES
    )
    robots = robots_numbers(2, ["pair"], whole=1, floating=1)
    assert [numbered(n)[0] for n in robots] == ["robots", "robots", "whole", "afloat"]


@pytest.mark.parametrize(
    ("numbers", "asked", "told"),
    [
        (numbers_of, (3, ["rough"]), "--rough 20"), (numbers_of, (5, ["curves"]), "--curves 20"),
        (robots_numbers, (3, ["whole"]), "--robots 20"), (robots_numbers, (3, ["afloat"]), "--floating 20"),
        (numbers_of, (0,), "no worlds"), (robots_numbers, (0,), "no worlds"),
        (robots_numbers, (3, ["triple"]), "no stratum 'triple' of --system mjcf"),
    ],
)  # fmt: skip
def test_worlds_that_are_asked_for_otherwise_are_refused_in_one_line(numbers, asked, told):
    with pytest.raises(UsageError, match=told):
        numbers(*asked)


FOR_EVERY_SEED = {name for name, kind in out_of_catalogue.KINDS.items() if kind.since is None}


@pytest.mark.parametrize("seed", [1, 50, 99])
def test_tuning_never_sees_the_kinds_kept_for_measurements(seed):
    assert set(out_of_catalogue.drawn(seed)) == FOR_EVERY_SEED
    assert len(FOR_EVERY_SEED) == 10
    assert {kind.since for kind in out_of_catalogue.nuisances(seed).values()} == {
        None,
        0,
        2028,
        2029,
        2030,
        2031,
    }


SINCE = {
    0: 0,
    100: 0,
    2027: 0,
    2028: 2028,
    2029: 2029,
    2030: 2030,
    2031: 2031,
    2039: 2031,
    2040: 2040,
    3000: 2040,
}


@pytest.mark.parametrize("seed", SINCE)
def test_half_of_the_kinds_of_a_measurement_are_new_and_no_earlier_seed_draws_them(seed):
    new = {name for name, kind in out_of_catalogue.KINDS.items() if kind.since == SINCE[seed]}
    assert len(new) == 10
    assert {drawing.first_family(seed, "unknown", rank) for rank in range(20)} == FOR_EVERY_SEED | new
    assert out_of_catalogue.nuisances(seed) == out_of_catalogue.drawn(seed)


@pytest.mark.parametrize(
    ("seed", "system", "episodes", "steps", "effect"),
    [
        (7, "unicycle", 35, 191, ("heading_slope", "vehicle", {"amplitude": 0.1138, "phase": 5.159})),
        (2027, "slider", 27, 173, ("bouc_wen", "q", {"amplitude": 0.9112, "width": 0.03284})),
        (2028, "slider", 28, 390, ("eddy_brake", "q", {"amplitude": 1.001, "speed": 0.4529})),
        (2029, "pendulum", 10, 239, ("gusts", "theta", {"amplitude": 0.2985, "phase": 5.442})),
        (2030, "unicycle", 47, 169, ("curve_slowdown", "vehicle", {"loss": 0.07735})),
        (2031, "cartpole", 47, 233, ("hardening_spring", "theta", {"cubic": 0.7324})),
    ],
)
def test_worlds_of_earlier_seeds_are_what_they_were(seed, system, episodes, steps, effect):
    world = drawing.draw(seed, 5)
    (found,) = world.effects
    assert (world.system, world.episodes, world.steps) == (system, episodes, steps)
    assert (found.family, found.on, dict(found.values)) == effect


@pytest.fixture(scope="module")
def worlds():
    return [drawing.draw(12, number) for number in range(1, 29)]


def test_no_two_effects_of_a_world_are_alike(worlds):
    for world in worlds:
        assert len(world.effects) == drawing.SIZE[world.stratum]
        for group in drawing.ALIKE:
            assert sum(e.family in group for e in world.effects) <= 1
        assert sum(e.gated and e.family != "local_friction_patch" for e in world.effects) <= 1
