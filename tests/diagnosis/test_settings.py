"""Settings: each with a word of reason, changed from outside, and written down as they are."""

import dataclasses
from pathlib import Path

import pytest
import yaml

from gpsim.diagnosis.settings import Settings, as_mapping, described, read_settings
from gpsim.errors import UsageError

ROOT = Path(__file__).resolve().parents[2]


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
    changed = read_settings({"laws": {"unusual": 6}})
    assert changed.laws.unusual == 6.0
    assert dataclasses.replace(changed.laws, unusual=Settings().laws.unusual) == Settings().laws


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"lawz": {}}, "diagnose: no step 'lawz' (did you mean 'laws'?)"),
        ({"laws": {"unusul": 3}}, "diagnose.laws: no setting 'unusul' (did you mean 'unusual'?)"),
        ({"laws": {"unusual": "many"}}, "diagnose.laws.unusual: expected a number, got 'many'"),
        ({"windows": {"length": 0}}, "diagnose.windows.length: expected at least 1, got 0"),
        ({"laws": {"share": 1.5}}, "diagnose.laws: share is a share of at most 1, got 1.5"),
        ({"laws": 3}, "diagnose.laws: expected settings"),
        ({"acceptance": {"per_term": 6}}, "diagnose.acceptance: was removed"),
    ],
)  # fmt: skip
def test_what_is_no_setting_is_refused_with_the_nearest(values, said):
    with pytest.raises(UsageError) as caught:
        read_settings(values)
    assert said in str(caught.value)
