"""Drawing: repeatable, even over the families, and never what would explain itself away."""

from collections import Counter

import pytest

from gpsim.trials import catalogue, drawing, outside


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


def test_ranks_count_up_within_a_stratum():
    seen = {}
    for number in range(1, 121):
        stratum, _, rank = drawing.stratum_of(number)
        assert rank == seen.get(stratum, -1) + 1
        seen[stratum] = rank


def test_every_family_comes_once_a_cycle():
    asked = [family for family, word in catalogue.WORDS.items() if word.asked]
    for stratum, families in (("single", catalogue.DECK), ("words", asked)):
        names = [drawing.first_family(4, stratum, rank) for rank in range(2 * len(families))]
        assert sorted(names[: len(families)]) == sorted(families)
        assert sorted(names[len(families) :]) == sorted(families)


def test_the_same_trial_is_the_same_world():
    assert drawing.draw(7, 3) == drawing.draw(7, 3)
    assert drawing.draw(7, 3) != drawing.draw(8, 3)


FOR_EVERY_SEED = {name for name, kind in outside.KINDS.items() if kind.since is None}


@pytest.mark.parametrize("seed", [1, 50, 99])
def test_tuning_never_sees_the_kinds_kept_for_measurements(seed):
    assert set(outside.drawn(seed)) == FOR_EVERY_SEED
    assert len(FOR_EVERY_SEED) == 10


@pytest.mark.parametrize(
    ("seed", "since"),
    [
        (0, 0),
        (100, 0),
        (2026, 0),
        (2027, 0),
        (2028, 2028),
        (2029, 2029),
        (2030, 2030),
        (2031, 2031),
        (2039, 2031),
        (2040, 2040),
        (3000, 2040),
    ],
)
def test_half_of_the_kinds_of_a_measurement_are_new_and_no_earlier_seed_draws_them(seed, since):
    new = {name for name, kind in outside.KINDS.items() if kind.since == since}
    assert len(new) == 10
    assert set(outside.drawn(seed)) == FOR_EVERY_SEED | new
    assert {drawing.first_family(seed, "unknown", rank) for rank in range(20)} == FOR_EVERY_SEED | new


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


def test_a_quarter_of_the_worlds_is_mujocos(worlds):
    assert sum(w.engine == "mujoco" for w in worlds) >= len(worlds) / 4
