"""The built wheel works in an empty environment, from any folder, configs included."""

import ast
import subprocess
import sys
import sysconfig
import venv
import zipfile
from email.parser import Parser
from importlib.metadata import packages_distributions, version
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parent.parent
STANDARD = {*sys.stdlib_module_names, "compression"}  # the last one from Python 3.14 on


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    out = tmp_path_factory.mktemp("wheel")
    copy = tmp_path_factory.mktemp("source")
    files = subprocess.run(
        ["git", "-C", str(ROOT), "ls-files", "--cached", "--others", "--exclude-standard"],
        capture_output=True, text=True, check=True,
    ).stdout.splitlines()  # fmt: skip
    for name in files:
        if not name.startswith("runs/") and (ROOT / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            (copy / name).write_bytes((ROOT / name).read_bytes())
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(out), str(copy)]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    return next(out.glob("*.whl"))


def test_every_config_and_template_travels(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    for path in (ROOT / "conf").rglob("*.yaml"):
        assert f"gpsim/conf/{path.relative_to(ROOT / 'conf').as_posix()}" in names
    for path in [
        *(ROOT / "gpsim").rglob("*.py"),
        *(ROOT / "gpsim").rglob("*.jinja"),
        *(ROOT / "gpsim").rglob("*.css"),
        *(ROOT / "gpsim").rglob("*.json"),
    ]:
        assert path.relative_to(ROOT).as_posix() in names
    assert not [name for name in names if name.startswith(("tests", "runs", "docs"))]


def test_the_wheels_requirements_hold_here_and_cover_what_it_imports(wheel):
    """Of the metadata that pip reads; what is imported for an extra is guarded and belongs to that extra."""
    archive = zipfile.ZipFile(wheel)
    metadata = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
    lines = Parser().parsestr(archive.read(metadata).decode()).get_all("Requires-Dist")
    everything = [Requirement(line) for line in lines]
    plain = [r for r in everything if "extra" not in str(r.marker)]
    for requirement in plain:
        if requirement.marker is None or requirement.marker.evaluate():
            assert version(requirement.name) in requirement.specifier, requirement
    extra = {canonicalize_name(r.name) for r in everything} - {canonicalize_name(r.name) for r in plain}
    provided = packages_distributions()
    for name in (n for n in archive.namelist() if n.endswith(".py")):
        for module in imports(archive.read(name).decode()) - STANDARD - {"gpsim"}:
            by = {canonicalize_name(d) for d in provided.get(module, [module])}  # an extra may be absent
            assert by & ({canonicalize_name(r.name) for r in plain} | extra), (name, module, by)


def imports(source):
    """The top-level modules that a file imports absolutely."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names.add(node.module.split(".")[0])
    return names


def test_installed_into_an_empty_environment_it_runs_from_any_folder(wheel, tmp_path):
    """gpsim itself comes from the wheel alone; its dependencies are lent by the environment of the tests."""
    home = tmp_path / "env"
    venv.create(home, with_pip=False)
    site = next(home.glob("lib/python*/site-packages"))
    (site / "lent.pth").write_text(
        sysconfig.get_paths()["purelib"] + "\n"
    )  # a .pth there is not followed further
    install = [sys.executable, "-m", "pip", "--python", str(home / "bin" / "python"), "install"]
    subprocess.run(
        [*install, "--quiet", "--no-deps", "--ignore-installed", str(wheel)], check=True, capture_output=True
    )
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    gpsim = str(home / "bin" / "gpsim")

    def run(*words):
        return subprocess.run([gpsim, *words], cwd=elsewhere, capture_output=True, text=True, check=False)

    where = subprocess.run(
        [str(home / "bin" / "python"), "-c", "import gpsim; print(gpsim.__file__)"],
        cwd=elsewhere, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert where.stdout.startswith(str(site))
    assert "n_train: 77" in run("fit-gp", "gp.n_train=77", "gp=raw", "--show-config").stdout
    made = run("collect", "budget=smoke", "collect.policy=random")
    assert made.stdout == "collect: runs/cartpole/collect/v0001\n", made.stderr
    assert (elsewhere / "runs/cartpole/collect/v0001/manifest.json").is_file()
