"""Exit codes: 0 done, 2 bad input, 3 a valid recording that allows no diagnosis, 130 interrupted."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

ROOT = Path(__file__).resolve().parents[2]


def pendulum(folder, count=400, moving=True):
    """A pendulum's table, or of one that hangs still."""
    t = np.arange(count) * 0.01
    swing = 0.3 if moving else 0.0
    columns = {
        "t": t,
        "theta": swing * np.cos(4 * t),
        "theta_dot": -4 * swing * np.sin(4 * t),
        "torque": 0.0 * t,
    }
    pd.DataFrame(columns).to_csv(folder / "p.csv", index=False)
    return folder / "p.csv"


@pytest.mark.parametrize(
    ("count", "moving", "said"),
    [
        (5, True, "too short to judge: 4 transitions"),
        (40, True, "too short to judge"),
        (400, False, "nothing moves"),
    ],
)
def test_a_sound_recording_that_says_nothing_ends_with_3(count, moving, said, gpsim, tmp_path):
    words = ["diagnose", pendulum(tmp_path, count, moving), "--simulator", "pendulum", "--cores", "1"]
    code, out, err = gpsim(*words)
    assert (code, out) == (3, "")
    assert err.startswith(f"error: {said}")
    code, out, err = gpsim(*words, "--json")
    assert code == 3
    content = json.loads(out)
    assert (content["exit_code"], content["error"]["kind"]) == (3, "no_diagnosis")
    assert content["error"]["message"].startswith(said)
    assert not Path("runs").exists() or not list(Path("runs").rglob("diagnosis.json"))


@pytest.mark.parametrize("spoil", ["theta_dot", "episode"])
def test_a_dead_sensor_and_a_misread_table_are_bad_input(spoil, gpsim, tmp_path):
    path = pendulum(tmp_path)
    table = pd.read_csv(path)
    table[spoil] = 0.0 if spoil == "theta_dot" else np.minimum(np.arange(len(table)), len(table) - 2)
    table.to_csv(path, index=False)
    code, _, err = gpsim("diagnose", path, "--simulator", "pendulum", "--cores", "1")
    assert code == 2
    assert ("check the sensor" if spoil == "theta_dot" else "must name episodes") in err


def test_the_page_lists_the_codes_that_help_does(gpsim):
    code, shown, _ = gpsim("--help")
    assert code == 0
    listed = re.findall(r"\| `(\d+)` \|", (ROOT / "docs/reference/exit_codes.md").read_text())
    assert listed == ["0", "1", "2", "3", "4", "130", "143"]
    said = re.search(r"Exit codes: (.*?)\.", " ".join(shown.split()))[1]
    assert re.findall(r"(?:^|, )(\d+) \w", said) == listed
