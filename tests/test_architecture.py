"""The house rules: imports point one way, packages are all listed, nothing is pickled."""

import ast
import re
import tomllib
from itertools import chain
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
LEVELS = [
    {"cli"},
    {"stages"},
    {"diagnosis", "evaluation", "policies", "expert_iteration", "trials", "reports"},
    {
        "corrected",
        "corrected_effects",
        "envs",
        "beam",
        "expert",
        "residuals",
        "collecting",
        "driving",
        "policy",
        "policy_export",
        "learning",
    },
    {"recording_checks"},
    {
        "gp",
        "effects",
        "tasks",
        "simulators",
        "targets",
        "recordings",
        "features",
        "settings",
        "command_filter",
    },
    {"evenly", "gaps", "store"},
    {"channels", "artifacts", "provenance", "workers"},
    {"files"},
    {"errors", "printable"},
]
LEVEL = {name: level for level, names in enumerate(LEVELS) for name in names}
FILES = sorted([*ROOT.glob("gpsim/**/*.py"), *ROOT.glob("cli/**/*.py")])


def room(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return "cli" if parts[0] == "cli" else parts[1]


def imported(path: Path) -> set[str]:
    """Absolute names of the modules that a file imports, at any depth of its code."""
    names: set[str] = set()
    package = list(path.relative_to(ROOT).parent.parts)
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, node.module]) if node.module else ".".join(base)
            names |= {module} | {f"{module}.{alias.name}" for alias in node.names}
    return names


def rooms_of(names: set[str]) -> set[str]:
    found = {name.split(".")[1] for name in names if name.startswith("gpsim.")}
    return {name for name in found if name in LEVEL}


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_imports_point_one_way(path):
    if path.parent == ROOT / "gpsim" and path.stem in {"__init__", "__main__"}:
        return
    here = room(path)
    assert here in LEVEL, f"{here} has no place in LEVELS: give it one"
    for other in rooms_of(imported(path)) - {here}:
        sideways = LEVEL[other] == LEVEL[here]
        assert LEVEL[other] > LEVEL[here] or (sideways and (here, other) in SIDEWAYS), (
            f"{here} imports {other}"
        )


SIDEWAYS = {
    ("collecting", "envs"),  # drives episodes
    ("collecting", "policy"),
    ("command_filter", "simulators"),  # has a memory, as a plant has
    ("corrected", "residuals"),  # applies to what was recorded, too
    ("policy_export", "policy"),
    ("driving", "collecting"),  # a policy at the wheel
    ("expert", "beam"),  # looks ahead by it
    ("corrected_effects", "corrected"),  # both kinds of correction meet there
    ("effects", "simulators"),  # an effect asks a simulator for its coordinates
    ("reports", "evaluation"),  # and what an evaluation did
    ("reports", "diagnosis"),  # shows what a diagnosis found
    ("reports", "trials"),  # and what a proof has to reach
    ("targets", "simulators"),  # a target is a plant
    (
        "trials",
        "diagnosis",
    ),  # the rule for equivalents fits rivals with its engine; never the other way round
}


def test_diagnosis_cannot_know_the_answers():
    for path in FILES:
        if room(path) in {"diagnosis", "effects", "residuals", "simulators"}:
            assert not rooms_of(imported(path)) & {"trials", "targets"}, path


MODULES = {".".join(("gpsim", *path.relative_to(ROOT / "gpsim").with_suffix("").parts)): path for path in FILES if path.is_relative_to(ROOT / "gpsim")}  # fmt: skip


def closure(ahead: list[str]) -> set[str]:
    """Modules that these modules of gpsim need, themselves among them, at any depth of the code."""
    reached: set[str] = set()
    while ahead:
        name = ahead.pop()
        if name not in reached:
            reached.add(name)
            ahead += [m for m in imported(MODULES[name]) if m in MODULES]
    return reached


def test_nothing_that_a_diagnosis_needs_leads_to_the_answers():
    """`trials` is not in the closure of its imports, `diagnosis` of course is."""
    reached = closure(
        [name for name in MODULES if name.startswith(("gpsim.diagnosis.", "gpsim.stages.diagnose"))]
    )
    assert "gpsim.diagnosis.search" in reached
    assert not [name for name in reached if name.startswith("gpsim.trials")]


def test_nothing_that_makes_the_truth_knows_the_laws_that_explain_it():
    reached = closure(["gpsim.trials.running", "gpsim.trials.drawing"])
    assert "gpsim.trials.laws" in reached
    explaining = {
        "effects",
        "simulators",
        "diagnosis",
        "corrected",
        "corrected_effects",
        "residuals",
        "targets",
    }
    assert not rooms_of(reached) & explaining


def test_only_stages_and_cli_know_configs_and_only_policies_know_stable_baselines3():
    for path in FILES:
        roots = {name.split(".")[0] for name in imported(path)}
        if room(path) not in {"cli", "stages"}:
            assert not roots & {"hydra", "typer", "omegaconf"}, path
        if room(path) != "policies":
            assert "stable_baselines3" not in roots, path
        assert not roots & {"pickle", "cPickle", "dill", "joblib", "cloudpickle"}, path


def test_every_package_is_listed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    listed = set(project["tool"]["setuptools"]["packages"])
    folders = {path.parent for path in ROOT.glob("gpsim/**/__init__.py")}
    tree = {".".join(folder.relative_to(ROOT).parts) for folder in folders}
    assert listed == tree | {"gpsim.cli", "gpsim.conf"}


def test_nothing_loads_pickles_and_no_local_path_is_written_down():
    for path in [*FILES, *ROOT.glob("conf/**/*.yaml"), *ROOT.glob("docs/**/*.md"), ROOT / "README.md"]:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"allow_pickle=True|torch\.load\(|read_pickle", text), path
        assert not re.search(r"(^|[\s\"'(])/(work|home|root)/", text), path


def test_dependencies_are_explained():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    explained = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
    every = [*project["dependencies"], *chain.from_iterable(project["optional-dependencies"].values())]
    for requirement in every:
        name = re.split(r"[<>=!\[ ]", requirement)[0]
        assert f"**{name}**" in explained, f"docs/dependencies.md does not say why {name} is there"
