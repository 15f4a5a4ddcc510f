"""The house rules: imports point one way, packages are all listed, nothing is pickled."""

import ast
import re
import tomllib
from collections import Counter
from functools import cache
from itertools import chain
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LEVELS = [
    {"cli"},
    {"api"},
    {"stages"},
    {"reports"},
    {"planning"},
    {"trials"},
    {"kinematics", "posterior", "traces"},
    {"diagnosis"},
    {"diagnosis.assessment"},
    {"diagnosis.ladder"},
    {"diagnosis.judging"},
    {"diagnosis.setup"},
    {"diagnosis.fitting"},
    {"diagnosis.data", "diagnosis.run"},
    {"diagnosis.settings"},
    {"evaluation", "policies.training"},
    {"environments"},
    {"corrected", "policies", "targets"},
    {"residuals", "kernels", "mjcf", "findings"},
    {"gp", "effects", "tasks", "recordings", "runs"},
    {"launchers"},
    {"simulators", "artifacts"},
    {"channels", "settings", "workers"},
    {"trust"},
    {"files", "limits", "private"},
    {"doors", "errors", "supervision"},
]
LEVEL = {name: level for level, names in enumerate(LEVELS) for name in names}
FILES = sorted([*ROOT.glob("gpsim/**/*.py"), *ROOT.glob("cli/**/*.py")])


def module_of(path: Path) -> str:
    """The dotted name of a file; cli/ is the package gpsim.cli."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = ("gpsim", *parts) if parts[0] == "cli" else parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(path): path for path in FILES}


def room_of(name: str) -> str | None:
    """The room in which a module of gpsim lies, the innermost; None of what is none of its own."""
    parts = name.split(".")[1:]
    ways = [".".join(parts[:n]) for n in range(len(parts), 0, -1)]
    return next((way for way in ways if way in LEVEL), None)


@cache
def imported(path: Path) -> dict[str, set[str]]:
    """Absolute names of the modules that a file imports, at any depth of its code -> the names it takes of each."""
    found: dict[str, set[str]] = {}
    package = module_of(path).split(".") if path.stem == "__init__" else module_of(path).split(".")[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                found.setdefault(alias.name, set())
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, node.module] if node.module else base)
            for alias in node.names:
                whole = f"{module}.{alias.name}"
                if whole in MODULES and not _offers_name(module, alias.name):
                    found.setdefault(whole, set())
                else:
                    found.setdefault(module, set()).add(alias.name)
    return found


@cache
def _offers_name(package: str, name: str) -> bool:
    """Whether a package's face imports a name that one of its files bears, too: a function, then."""
    face = MODULES.get(package)
    if face is None or face.stem != "__init__":
        return False
    tree = ast.parse(face.read_text(encoding="utf-8"))
    return any(isinstance(n, ast.ImportFrom) and any(a.name == name for a in n.names) for n in tree.body)


@cache
def offered(package: str) -> set[str]:
    """What a room's `__init__` imports or defines, and lists in `__all__`: files of which everything is for all."""
    found: set[str] = set()
    for node in ast.parse(MODULES[package].read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gpsim"):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.FunctionDef):
            found.add(node.name)
        elif isinstance(node, ast.AnnAssign):
            found.add(ast.unparse(node.target))
        elif isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            found |= set(ast.literal_eval(node.value))
    return found


def test_imports_point_one_way():
    wrong = []
    for path in FILES:
        here = room_of(module_of(path))
        if path.parent == ROOT / "gpsim" and path.stem in {"__init__", "__main__"}:
            continue
        assert here, f"{path.name} has no room in LEVELS: give it one"
        rooms = {room_of(name) for name in imported(path)} - {None, here}
        wrong += [f"{path}: {here} imports {there}" for there in rooms if LEVEL[there] <= LEVEL[here]]
    assert not wrong


def test_rooms_take_of_each_other_what_is_offered():
    """Through the other room's `__init__`, or of a file that it lists whole."""
    wrong = []
    for path in FILES:
        here = room_of(module_of(path))
        if path.stem == "__main__":  # it stands for the command line
            continue
        for name, taken in imported(path).items():
            there = room_of(name)
            door = f"gpsim.{there}"
            if there in (None, here) or MODULES[door].stem != "__init__":
                continue
            missing = (
                taken - offered(door) if name == door else {name.removeprefix(f"{door}.")} - offered(door)
            )
            wrong += [f"{path}: {door} does not offer {missing}"] if missing else []
    assert not wrong


def test_a_file_takes_what_it_needs_of_its_own_room_from_the_file_that_has_it():
    doors = {path: f"gpsim.{room_of(module_of(path))}" for path in FILES if path.stem != "__init__"}
    wrong = [p for p, door in doors.items() if door in imported(p) and MODULES[door].stem == "__init__"]
    assert not wrong


def test_nothing_is_imported_in_a_circle():
    ahead = {
        name: {other for other in imported(path) if other in MODULES and other != name}
        for name, path in MODULES.items()
        if path.stem != "__init__"
    }
    while True:
        ends = {name for name, needs in ahead.items() if not needs & ahead.keys()}
        if not ends:
            break
        ahead = {name: needs for name, needs in ahead.items() if name not in ends}
    assert not ahead, f"each of these leads back to itself or to one that does: {sorted(ahead)}"


def closure(ahead: list[str]) -> set[str]:
    """Modules that these modules of gpsim need, themselves among them, at any depth of the code."""
    reached: set[str] = set()
    while ahead:
        name = ahead.pop()
        if name not in reached:
            reached.add(name)
            room_of_it = name.rpartition(".")[0]  # its `__init__` runs, too
            needed = {*imported(MODULES[name]), room_of_it} - {"gpsim"}
            ahead += [m for m in needed if m in MODULES]
    return reached


def test_nothing_that_a_diagnosis_needs_leads_to_the_answers():
    """`trials` is not in the closure of its imports, `diagnosis` of course is; nor is what is driven as a target."""
    explaining = [name for name in MODULES if name.startswith("gpsim.diagnosis.")]
    reached = closure([*explaining, "gpsim.effects", "gpsim.residuals", "gpsim.simulators"])
    assert "gpsim.diagnosis.ladder.search" in reached
    assert not [name for name in reached if name.startswith(("gpsim.trials", "gpsim.targets"))]
    reached = closure(
        [name for name in MODULES if name.startswith("gpsim.stages.diagnose")] + ["gpsim.cli.diagnose"]
    )
    assert not [name for name in reached if name.startswith("gpsim.trials")]


def test_nothing_that_makes_the_truth_knows_the_laws_that_explain_it():
    reached = closure(["gpsim.trials.truth", "gpsim.trials.drawing", "gpsim.trials.robots"])
    assert "gpsim.trials.catalogue" in reached
    explaining = {"effects", "simulators", "corrected", "residuals", "targets", "mjcf"}
    rooms = {room_of(name) or "" for name in reached}
    assert not {room for room in rooms if room in explaining or room.startswith("diagnosis")}


def test_only_stages_and_cli_know_configs_and_only_policies_know_stable_baselines3():
    for path in FILES:
        roots = {name.split(".")[0] for name in imported(path)}
        room = room_of(module_of(path))
        if room not in {"cli", "stages"}:
            assert not roots & {"hydra", "typer", "omegaconf"}, path
        if room != "policies.training":
            assert "stable_baselines3" not in roots, path
        assert not roots & {"pickle", "cPickle", "dill", "joblib", "cloudpickle"}, path


def test_nothing_inside_imports_the_api():
    """`import gpsim` is for those outside: inside, a name is taken from the room that has it."""
    for path in FILES:
        if path == ROOT / "gpsim" / "__init__.py" or room_of(module_of(path)) == "api":
            continue
        for name, taken in imported(path).items():
            assert room_of(name) != "api", path
            assert name != "gpsim" or taken <= {"__version__"}, path


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
    explained = (ROOT / "docs" / "reference" / "dependencies.md").read_text(encoding="utf-8")
    every = [*project["dependencies"], *chain.from_iterable(project["optional-dependencies"].values())]
    for requirement in every:
        name = re.split(r"[<>=!\[ ]", requirement)[0]
        assert f"**{name}**" in explained, f"docs/reference/dependencies.md does not say why {name} is there"


def test_modules_of_tests_in_plain_folders_have_names_of_their_own():
    """Pytest imports them by their bare names: a second one of the same name is refused, or taken for the first."""
    plain = [p for p in ROOT.glob("tests/**/*.py") if not (p.parent / "__init__.py").exists()]
    names = Counter(path.name for path in plain if path.name != "conftest.py")
    assert [name for name, count in names.items() if count > 1] == []
