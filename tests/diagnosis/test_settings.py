"""Settings: each with a word of reason, changed from outside, and written down as they are."""

import dataclasses
from pathlib import Path

import pytest
import yaml

from gpsim.diagnosis.settings import Settings, as_mapping, as_page, as_yaml, described, read_settings
from gpsim.errors import UsageError

ROOT = Path(__file__).resolve().parents[2]


def test_what_is_generated_is_current():
    assert (ROOT / "docs/reference/settings.md").read_text(encoding="utf-8") == as_page(Settings())
    assert (ROOT / "conf/diagnose/default.yaml").read_text(encoding="utf-8") == as_yaml(Settings())


def test_the_configuration_holds_the_defaults():
    given = yaml.safe_load((ROOT / "conf/diagnose/default.yaml").read_text(encoding="utf-8"))
    for beside in ("episodes", "known", "families"):  # what a user says, which is no threshold
        given.pop(beside)
    assert given == as_mapping(Settings())
    assert read_settings(given) == Settings()


def test_every_setting_has_a_unit_a_meaning_and_an_origin():
    for f in dataclasses.fields(Settings):
        for name, _, unit, meaning, origin in described(f.default_factory()):
            assert unit, name
            assert len(meaning) > 10, name
            assert origin, name


def test_settings_are_changed_one_by_one():
    changed = read_settings({"acceptance": {"per_term": 6}})
    assert changed.acceptance.per_term == 6.0
    assert dataclasses.replace(changed.acceptance, per_term=4.0) == Settings().acceptance


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"acceptence": {}}, "diagnose: no step 'acceptence' (did you mean 'acceptance'?)"),
        ({"acceptance": {"per_trem": 3}}, "diagnose.acceptance: no setting 'per_trem' (did you mean 'per_term'?)"),
        ({"acceptance": {"per_term": "many"}}, "diagnose.acceptance.per_term: expected a number, got 'many'"),
        ({"search": {"depth": 0}}, "diagnose.search.depth: expected at least 1, got 0"),
        ({"search": {"fitted_per_depth": [9, -1]}}, "diagnose.search.fitted_per_depth: expected at least 0, got -1"),
        ({"search": {"fitted_per_depth": []}}, "diagnose.search: fitted_per_depth is empty"),
        ({"gate_edges": {"narrowing": 5.0}}, "diagnose.gate_edges: no setting 'narrowing'"),
        ({"acceptance": 3}, "diagnose.acceptance: expected settings"),
    ],
)  # fmt: skip
def test_what_is_no_setting_is_refused_with_the_nearest(values, said):
    with pytest.raises(UsageError) as caught:
        read_settings(values)
    assert said in str(caught.value)
