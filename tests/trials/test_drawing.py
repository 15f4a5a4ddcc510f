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


FINAL = {name for name, kind in outside.KINDS.items() if kind.final}
NEWER = {name for name, kind in outside.KINDS.items() if kind.since_seed is not None}


def drawn(seed):
    return {kind for system in drawing.SYSTEMS for kind in outside.allowed(seed, system)}


def test_tuning_never_sees_the_kinds_kept_for_the_end():
    assert len(FINAL) == len(NEWER) == 10
    for seed in (1, 50, outside.LAST_TUNING_SEED):
        assert not (FINAL | NEWER) & drawn(seed)
        assert len(drawn(seed)) == 10


def test_half_of_the_kinds_are_new_in_2028_and_no_earlier_seed_draws_them():
    for seed in (0, 100, 2026, 2027):
        assert len(drawn(seed)) == 20
        assert drawn(seed) >= FINAL
        assert not NEWER & drawn(seed)
    for seed in (2028, 3000):
        assert len(drawn(seed)) == 20
        assert drawn(seed) >= NEWER
        assert not FINAL & drawn(seed)
    assert {drawing._family(3001, "unknown", rank) for rank in range(20)} == drawn(3001)


def test_newer_kinds_leave_the_draws_of_earlier_seeds_as_they_were():
    before = [
        "bouc_wen", "flexible_coupling", "exponential_aero", "gusts", "eccentric_encoder", "carpet",
        "heading_slope", "fading_damping", "fan", "vibrating_pivot", "curve_slowdown", "quantised_actuator",
        "cogging", "hardening_spring", "speed_ripple", "soft_stop", "gyroscopic", "position_gain",
        "magnetic_detent", "ringing_actuator",
    ]  # fmt: skip
    assert [drawing._family(2027, "unknown", rank) for rank in range(20)] == before
    before = [
        "heading_slope", "curve_slowdown", "cogging", "bouc_wen", "hardening_spring", "quantised_actuator",
        "position_gain", "fan", "exponential_aero", "gusts",
    ]  # fmt: skip
    assert [drawing._family(7, "unknown", rank) for rank in range(10)] == before


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
