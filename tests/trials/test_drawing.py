"""Drawing: repeatable, even over the families, and never what would explain itself away."""

from collections import Counter

import pytest

from gpsim.trials import drawing, outside
from gpsim.trials.strengths import CATALOGUE


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
    names = [drawing._family(4, "single", rank) for rank in range(2 * len(CATALOGUE))]
    assert sorted(names[: len(CATALOGUE)]) == sorted(CATALOGUE)
    assert sorted(names[len(CATALOGUE) :]) == sorted(CATALOGUE)


def test_the_same_trial_is_the_same_world():
    assert drawing.draw(7, 3) == drawing.draw(7, 3)
    assert drawing.draw(7, 3) != drawing.draw(8, 3)


def test_tuning_never_sees_the_kinds_kept_for_the_end():
    final = {name for name, kind in outside.KINDS.items() if kind.final}
    assert len(outside.KINDS) >= 10
    assert len(final) == len(outside.KINDS) // 2
    for system in drawing.SYSTEMS:
        for seed in (1, 50, outside.LAST_TUNING_SEED):
            assert not final & set(outside.allowed(seed, system))
    assert final <= {k for system in drawing.SYSTEMS for k in outside.allowed(2026, system)}


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
