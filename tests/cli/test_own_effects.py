"""`gpsim effects`, and `gpsim diagnose --effects`: what is said, what is refused in one line."""

import json

import pytest
from cli_calls import called

from gpsim import trust
from gpsim.effects import CATALOGUE, FAMILIES, brought


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setattr(trust, "allowed", set())
    monkeypatch.setattr(brought, "_standing", {})
    yield
    FAMILIES.clear()
    FAMILIES.update(CATALOGUE)


def test_from_new_to_a_recording_of_it_and_a_name(monkeypatch, capfd, tmp_path):
    assert called(monkeypatch, capfd, "effects", "new", "rubber_band")[0] == 0
    words = ("--quick", "--keep", "band", "--simulator", "slider")
    code, said, _ = called(monkeypatch, capfd, "effects", "check", "rubber_band.py", *words)
    assert code == 0
    assert said.count(" yes") == 5
    code, said, _ = called(monkeypatch, capfd, "effects", "show", "rubber_band.py", "--json")
    assert json.loads(said)["parameters"]["weight"]["unit"] == "N/m"
    few = ["diagnose.families.only=[viscous_friction]", "--cores", "1"]
    code, said, err = called(
        monkeypatch, capfd, "diagnose", "band", "--effects", "rubber_band.py", "--out", "found", *few
    )
    assert code == 0, err
    content = json.loads((tmp_path / "found" / "diagnosis.json").read_text())
    assert [e["family"] for e in content["effects"]] == ["rubber_band"]
    assert content["brought"]["rubber_band"]["reference"] == "rubber_band.py:RubberBand"
    assert content["effects"][0]["parameters"]["weight"]["value"] == pytest.approx(1.0, rel=0.05)


def test_list_says_what_is_asked(monkeypatch, capfd):
    code, said, _ = called(monkeypatch, capfd, "effects", "list", "--json")
    assert code == 0
    rows = {row["family"]: row["asked"] for row in json.loads(said)["effects"]}
    assert set(rows) == set(CATALOGUE)
    assert all((rows[f] == "asked") == e.asked for f, e in CATALOGUE.items())


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (("effects", "check", "none.py"), "none.py: no such file of effects"),
        (("effects", "new", "My Effect"), "use lower-case letters"),
        (("effects", "new", "cable", "--site", "wing"), "--site wing: there are force, friction"),
        (("effects", "show", "sprong"), "unknown effect family 'sprong'"),
        (("effects", "check", "bad.py"), "bad.py:Bad: it needs a method law(self, q, speed, weight)"),
        (("diagnose", "--effects", "bad.py"), "--effects goes with a RECORDING"),
    ],
)
def test_what_is_wrong_is_one_line(monkeypatch, capfd, tmp_path, words, fault):
    bad = 'class Bad:\n    site = "force"\n    parameters = {"weight": ("N", 0.0, 1.0, 0.5)}\n'
    (tmp_path / "bad.py").write_text(bad)
    code, _, err = called(monkeypatch, capfd, *words)
    assert code == 2
    assert fault in err
    assert "Traceback" not in err
