"""The built wheel works in an empty environment, from any folder, configs included, on each Python that is there."""

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
from pythons import other_pythons

ROOT = Path(__file__).resolve().parent.parent
OTHERS = other_pythons(sys.version_info.minor)
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
    provided = {"rerun": ["rerun-sdk"], **packages_distributions()}
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


def lent_folders():
    """What the .pth files of this environment add: in another one they are not followed further."""
    lines = [
        line
        for path in Path(sysconfig.get_paths()["purelib"]).glob("*.pth")
        for line in path.read_text().splitlines()
    ]
    return [line for line in lines if Path(line).is_absolute()]


def install(home, wheel, *options):
    """Install the wheel into an environment without pip of its own."""
    python = [sys.executable, "-m", "pip", "--python", str(home / "bin" / "python")]
    command = [*python, "install", "--quiet", *options, str(wheel)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def commands(home, tmp_path):
    """An empty folder, and how the environment's gpsim is called there."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()

    def run(*words):
        command = [str(home / "bin" / "gpsim"), *words]
        return subprocess.run(command, cwd=elsewhere, capture_output=True, text=True, check=False)

    return elsewhere, run


def test_installed_into_an_empty_environment_it_runs_from_any_folder(wheel, tmp_path):
    """gpsim itself comes from the wheel alone; its dependencies are lent by the environment of the tests."""
    home = tmp_path / "env"
    venv.create(home, with_pip=False)
    site = next(home.glob("lib/python*/site-packages"))
    lent = [sysconfig.get_paths()["purelib"], *lent_folders()]
    (site / "lent.pth").write_text("".join(f"{folder}\n" for folder in lent))
    assert install(home, wheel, "--no-deps", "--ignore-installed").returncode == 0
    elsewhere, run = commands(home, tmp_path)
    where = subprocess.run(
        [str(home / "bin" / "python"), "-c", "import gpsim; print(gpsim.__file__)"],
        cwd=elsewhere, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert where.stdout.startswith(str(site))
    assert run("--version").stdout == f"gpsim {version('gpsim')}\n"
    assert "full-loop" in run("run", "--help").stdout
    assert "n_train: 77" in run("fit-gp", "gp.n_train=77", "gp=raw", "--show-config").stdout
    made = run("collect", "budget=smoke", "collect.policy=random")
    assert made.stdout == "collect: runs/cartpole/collect/v0001\n", made.stderr
    assert (elsewhere / "runs/cartpole/collect/v0001/manifest.json").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("python", OTHERS)
def test_every_other_python_takes_its_code(wheel, tmp_path, python):
    """Installed without dependencies, which are others for it: all files compile, without a warning."""
    home = tmp_path / "env"
    subprocess.run([OTHERS[python], "-m", "venv", "--without-pip", str(home)], check=True)
    done = install(home, wheel, "--no-deps", "--no-compile")
    assert done.returncode == 0, done.stderr
    site = next(home.glob("lib/python*/site-packages"))
    assert (site / "gpsim" / "conf" / "config.yaml").is_file()
    compiled = subprocess.run(
        [str(home / "bin" / "python"), "-W", "error", "-m", "compileall", "-q", str(site / "gpsim")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert compiled.returncode == 0, compiled.stdout + compiled.stderr


@pytest.mark.slow
@pytest.mark.parametrize("python", OTHERS)
def test_with_its_own_dependencies_the_loop_runs_from_an_empty_folder(wheel, tmp_path, python):
    home = tmp_path / "env"
    subprocess.run([OTHERS[python], "-m", "venv", "--without-pip", str(home)], check=True)
    small = [
        sys.executable,
        "-m",
        "pip",
        "download",
        "--quiet",
        "--no-deps",
        "--dest",
        str(tmp_path),
        "typer",
    ]
    if subprocess.run(small, capture_output=True, check=False).returncode:
        pytest.skip("no package registry can be reached from here")
    done = install(home, f"{wheel}[foxglove]", "--constraint", str(ROOT / "constraints.txt"))
    assert done.returncode == 0, done.stderr
    elsewhere, run = commands(home, tmp_path)
    assert run("--version").stdout == f"gpsim {version('gpsim')}\n"
    assert run("--help").returncode == 0
    made = run("run", "full-loop", "budget=smoke", "--jobs", "2")
    assert made.returncode == 0, made.stderr
    assert (elsewhere / made.stdout.splitlines()[-1]).is_file()
    exported = run("export", "diagnosis", "runs/cartpole/diagnose/v0001", "--mcap")
    assert exported.returncode == 0, exported.stderr
    assert [path.name for path in elsewhere.iterdir()] == ["runs"]
