"""docs/tutorial/python.md: its blocks are run in their order, on a smoke budget here and in full in the slow suite."""

import re
from pathlib import Path

import pytest

import gpsim

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "tutorial" / "python.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL)
TRAINING = "learn(10_000)"


def played(budget):
    """What all the blocks leave behind, trained for less."""
    names = {}
    for block in BLOCKS:
        exec(block.replace(TRAINING, budget), names)
    return names


def test_from_a_frame_to_an_environment_in_twelve_lines():
    """Of the block below that heading, which begins with a table and ends with a policy."""
    block = BLOCKS[1]
    lines = [line for line in block.splitlines() if line.strip()]
    assert len(lines) <= 12
    assert max(map(len, lines)) <= 110
    assert [
        word in block for word in ("recording_from_frame(log", "gpsim.diagnose(", "make_env(", TRAINING)
    ] == [True] * 4


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_every_block_runs(capsys):
    left = played("learn(100)")
    said = capsys.readouterr().out
    assert left["diagnosis"].effects[0].family == "viscous_friction"
    assert left["agent"].num_timesteps >= 100
    assert "Verdict  named: viscous friction on q explains >99.9 % of the mismatch" in said
    quoted = re.search(r"viscous friction on q  .* yes", PAGE)[0]
    assert quoted in said
    assert "units: force is in kN, slider's in N: convert the column and its unit" in said
    assert left["own"].system == "cart()"
    assert left["path"].shape == (51, 2)
    assert Path("found/report.html").is_file()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_in_full_the_policy_learns_what_the_page_says(capsys):
    left = played(TRAINING)
    env = left["env"]
    for seed in range(5):
        observation, _ = env.reset(seed=seed)
        for _ in range(100):
            action, _ = left["agent"].predict(observation, deterministic=True)
            observation, *_ = env.step(action)
        assert abs(observation[1] - 0.5) < 0.1
    assert gpsim.Diagnosis.load("found").verdict == "named"
