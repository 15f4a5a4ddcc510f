"""robustness=posterior: trained in draws of a diagnosis, said beside the policy, and compared in `evaluate`."""

import json
from dataclasses import replace
from pathlib import Path

import asking
import numpy as np
import pytest
from made_diagnoses import made_diagnosis
from made_posteriors import made_explanation, made_posterior

from gpsim.artifacts import Recipe, Store
from gpsim.corrected import EffectsPlant, describe
from gpsim.effects import Term
from gpsim.errors import UsageError
from gpsim.files import write_json
from gpsim.posterior import left_open_data
from gpsim.simulators import make_simulator
from gpsim.stages import certify, train_gp_policy
from gpsim.stages.diagnose_loop import find_diagnosis
from gpsim.stages.diagnosis_files import POSTERIOR
from gpsim.stages.export import export_policy

TINY = (
    "policy.total_steps=128", "policy.n_envs=2", "policy.n_steps=32", "policy.n_epochs=1", "evaluate.episodes=6",
)  # fmt: skip
CARTPOLE = make_simulator("cartpole")


def rubbing(force):
    terms = (Term("coulomb_friction", "x", {"force": force}),)
    return EffectsPlant(CARTPOLE, CARTPOLE.defaults(), terms, "euler", 1, 0.02)


def diagnosed(folder, low=4.0, *, posterior=True):
    """A diagnosis of friction somewhere between `low` and 9 N, or, less probably, of none."""
    friction = made_explanation({("coulomb_friction", "x"): {"force": 6.0}}, 0.8)
    friction = replace(
        friction,
        hypothesis=replace(friction.hypothesis, scheme="euler"),
        intervals=np.array([[low, 9.0]]),
    )
    explanations = (friction, made_explanation({}, 0.2))
    content = left_open_data(replace(made_posterior({}), explanations=explanations))

    def write(out: Path):
        write_json(out / "corrected.json", describe(rubbing(6.0), gp=False))
        write_json(out / "diagnosis.json", made_diagnosis().to_dict())
        if posterior:
            write_json(out / POSTERIOR, content)
        return {}

    return Store(folder, "").publish(Recipe("diagnose", {}, {}, {}), write, out=folder / "found").path


def request(tmp_path, *words):
    return asking.asked(*TINY, f"runs_dir={tmp_path / 'runs'}", *words)


def test_a_policy_is_trained_in_draws_and_says_what_it_survives(tmp_path):
    asked = request(tmp_path, f"diagnosis={diagnosed(tmp_path)}", "robustness=posterior")
    made, existed = train_gp_policy.STAGE.make(asked)
    assert not existed
    assert made.manifest["config"]["correction"] == "effects"
    assert made.manifest["config"]["robustness"] == "posterior"
    survives = json.loads((made.path / "survives.json").read_text())["explanations"]
    assert [round(e["share_of_episodes"], 6) for e in survives] == [0.8, 0.2]
    said = train_gp_policy.STAGE.notes(made)
    assert said == [
        "survives, in 80 % of its episodes: force of coulomb_friction on x 4 to 9 (90 % intervals)",
        "survives, in 20 % of its episodes: the base simulator as it is",
    ]
    assert all(line in (made.path / "survives.md").read_text() for line in said)
    export_policy(made.path, tmp_path / "deploy")
    assert json.loads((tmp_path / "deploy" / "policy.json").read_text())["survives"] == said
    plain, _ = train_gp_policy.STAGE.make(asked.having(robustness="none", correction="effects"))
    assert "robustness" not in plain.manifest["config"]
    assert train_gp_policy.STAGE.notes(plain) == []


def test_what_is_drawn_to_be_driven_is_what_was_drawn_to_be_trained(tmp_path):
    asked = request(tmp_path, f"diagnosis={diagnosed(tmp_path)}")
    made, _ = train_gp_policy.STAGE.make(asked.having(robustness="posterior"))

    recipe = Recipe("evaluate", {}, {"diagnosis": find_diagnosis(asked), "Posterior": made}, {})
    found = certify.robustness(asked, recipe, {"Posterior": np.arange(20.0)})["robustness"]
    assert found["target"]["Posterior"]["worst_tenth"] == 0.5
    on_drawn = found["posterior"]["Posterior"]
    assert on_drawn["worst_tenth"] <= on_drawn["mean"]
    low, high = on_drawn["worst_tenth_interval"]
    assert low <= on_drawn["worst_tenth"] <= high


@pytest.mark.parametrize(
    ("words", "low", "posterior", "said"),
    [
        (("robustness=posterior", "correction=gp"), 4.0, True, "choose correction=effects"),
        (("robustness=maybe",), 4.0, True, "robustness: 'maybe' is not one of none, posterior"),
        (("robustness=posterior",), float("nan"), True, "does not determine"),
        (("robustness=posterior",), 4.0, False, "diagnose the recording again"),
    ],
)
def test_what_cannot_be_drawn_from_is_one_line(tmp_path, words, low, posterior, said):
    where = diagnosed(tmp_path, low, posterior=posterior)
    asked = request(tmp_path, f"diagnosis={where}", *words)
    with pytest.raises(UsageError, match=said) as refused:
        train_gp_policy.STAGE.make(asked)
    assert "\n" not in str(refused.value)
    assert not list((tmp_path / "runs").glob("*/train-gp-policy/v*"))
