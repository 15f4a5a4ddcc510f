"""URDFs as people keep them: meshes in ROS packages, links without a mass, inertias that no body has."""

import importlib.metadata
import struct
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mjcf_models import written

from gpsim.effects import Term
from gpsim.errors import UsageError
from gpsim.mjcf import Correction, declared, export_model, files_digest, load_mjcf, notes_of
from gpsim.mjcf.urdf import nearest_inertia

INERTIAL = (
    '<inertial><mass value="1"/><origin xyz="0 0 -.2"/>'
    '<inertia ixx=".02" iyy=".02" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial>'
)
MESH = '<collision><geometry><mesh filename="{}"/></geometry></collision>'
BOX = '<collision><geometry><box size=".1 .1 .1"/></geometry></collision>'
CORNERS = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]], dtype=np.float32)
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))


def robot(*links):
    """A chain of links on hinges, each hung 0.4 m below the last: what is inside each <link>."""
    text = '<robot name="r"><link name="base"/>'
    for i, inside in enumerate(links):
        above = "base" if i == 0 else f"link{i - 1}"
        text += (
            f'<link name="link{i}">{inside}</link><joint name="j{i}" type="continuous"><parent link="{above}"/>'
            f'<child link="link{i}"/><axis xyz="0 1 0"/><origin xyz="0 0 {-0.4 if i else 0}"/></joint>'
        )
    return text + "</robot>"


def stl(path, corners=CORNERS):
    """A tetrahedron as binary STL."""
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *corners[list(face)].ravel(), 0) for face in FACES)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"\0" * 80 + struct.pack("<I", len(FACES)) + body)


def package(folder, name="my_robot", manifest=True):
    """A ROS package with a URDF and a mesh; the URDF's reference."""
    (folder / "urdf").mkdir(parents=True)
    stl(folder / "meshes" / "link.stl")
    if manifest:
        (folder / "package.xml").write_text(f"<package><name>{name}</name></package>")
    return written(
        folder / "urdf", robot(INERTIAL + MESH.format(f"package://{name}/meshes/link.stl")), "r.urdf"
    )


@pytest.mark.parametrize("called", ["my_robot", "a_clone_of_it"])
def test_meshes_of_the_package_that_the_file_lies_in(called, tmp_path):
    reference = package(tmp_path / called)
    assert load_mjcf(reference).body.base.nmesh == 1
    assert notes_of(reference) == ()
    before = files_digest(reference)
    assert sorted(before) == ["../meshes/link.stl", "r.urdf"]
    stl(tmp_path / called / "meshes" / "link.stl", 2 * CORNERS)
    assert files_digest(reference) != before


@pytest.mark.parametrize(
    ("variable", "below"), [("ROS_PACKAGE_PATH", "my_robot"), ("AMENT_PREFIX_PATH", "share/my_robot")]
)
def test_meshes_of_packages_where_ros_looks_for_them(variable, below, tmp_path, monkeypatch):
    stl(tmp_path / "ws" / below / "meshes" / "link.stl")
    text = robot(INERTIAL + MESH.format("package://my_robot/meshes/link.stl"))
    (tmp_path / "here").mkdir()
    reference = written(tmp_path / "here", text, "r.urdf")
    monkeypatch.setenv(variable, f"/nowhere:{tmp_path / 'ws'}")
    assert load_mjcf(reference).body.base.nmesh == 1


def test_meshes_that_cannot_be_had_are_left_out_and_move_the_same(tmp_path):
    (tmp_path / "text.stl").write_text("solid s\nendsolid s\n" + " " * 80)
    (tmp_path / "shape.dae").write_text("<COLLADA/>")
    links = [
        INERTIAL + MESH.format(f"package://gone/{name}") for name in ("lost.stl", "shape.dae", "text.stl")
    ]
    reference = written(tmp_path, robot(*links), "r.urdf")
    without = written(tmp_path, robot(INERTIAL, INERTIAL, INERTIAL), "bare.urdf")
    assert load_mjcf(reference).body.base.ngeom == 0
    lines = " ".join(notes_of(reference))
    assert "(not found): lost.stl" in lines
    assert "(.dae, not .stl, .obj, .msh): shape.dae" in lines
    assert "(STL as text, or cut short): text.stl" in lines
    state, command = np.full((1, 6), 0.3), np.full((1, 3), 0.1)
    one, other = load_mjcf(reference), load_mjcf(without)
    assert np.array_equal(
        one.rates(state, command, one.defaults()), other.rates(state, command, other.defaults())
    )
    assert declared(one).notes == notes_of(reference)


def test_a_link_without_a_mass_weighs_next_to_nothing_and_is_nothing_to_correct(tmp_path):
    reference = written(tmp_path, robot("", INERTIAL), "r.urdf")
    simulator = load_mjcf(reference)
    (line,) = notes_of(reference)
    assert "without mass" in line
    assert line.endswith("link0")
    assert "link1.mass" in simulator.parameters
    assert not any(name.startswith("link0.") for name in simulator.parameters)


def test_a_link_without_inertial_weighs_what_its_shape_does(tmp_path):
    reference = written(tmp_path, robot(BOX), "r.urdf")
    assert load_mjcf(reference).parameters["link0.mass"].default == pytest.approx(1.0)
    assert "weigh what their shapes do at 1000 kg/m^3: link0" in notes_of(reference)[0]


@pytest.mark.parametrize("inertia", [(0.02, 0.02, 0.05, 0.0), (0.02, 0.02, 0.02, 0.02), (0.0,) * 4])
def test_inertias_that_no_body_has_become_possible(inertia, tmp_path):
    xx, yy, zz, off = inertia
    bad = (
        f'<inertial><mass value="1"/><inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="{off}" ixz="{off}" '
        f'iyz="{off}"/></inertial>'
    )
    reference = written(tmp_path, robot(bad), "r.urdf")
    a, b, c = sorted(load_mjcf(reference).body.base.body_inertia[1])
    assert a > 0.0
    assert c <= (a + b) * (1 + 1e-9)
    assert notes_of(reference) == ("impossible inertias, replaced by the nearest possible ones: link0",)


@given(st.lists(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3), min_size=4, max_size=8))
def test_an_inertia_of_point_masses_stays_itself(points):
    at = np.array(points) - np.mean(points, axis=0)
    if np.linalg.svd(at, compute_uv=False)[-1] < 1e-3:  # flat: on the border, where rounding decides
        return
    moments = at.T @ at
    full = np.trace(moments) * np.eye(3) - moments
    six = full[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    assert np.array_equal(nearest_inertia(six, 1.0), six)


@given(st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6))
def test_what_becomes_of_any_six_numbers_is_possible_and_stays(numbers):
    made = nearest_inertia(np.array(numbers), 1.0)
    xx, yy, zz, xy, xz, yz = made
    a, b, c = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    assert a > 0.0
    assert c <= (a + b) * (1 + 1e-9)
    assert nearest_inertia(made, 1.0) == pytest.approx(made, rel=1e-9, abs=1e-15)


def test_links_inside_each_other_at_rest_never_touch(tmp_path):
    large = '<collision><geometry><sphere radius=".5"/></geometry></collision>'
    reference = written(tmp_path, robot(INERTIAL + large, INERTIAL + BOX, INERTIAL + large), "r.urdf")
    simulator = load_mjcf(reference)
    assert notes_of(reference) == ("links that overlap at rest, whose contacts are off: link0 and link2",)
    deepest, _ = simulator.penetration(np.zeros((1, 6)))
    assert deepest[0] == 0.0


def test_it_is_exported_with_its_meshes_where_they_are(tmp_path):
    simulator = load_mjcf(package(tmp_path / "my_robot"))
    out = tmp_path / "out"
    out.mkdir()
    terms, steps = (Term("coulomb_friction", "j0", {"force": 0.05}),), simulator.steps_of(0.01)
    correction = Correction(simulator, simulator.defaults(), terms, 0.01, steps, 0.0)
    made = export_model(correction, {}, {}, out / "r_corrected.xml")
    again = mujoco.MjModel.from_xml_path(str(made.files["model"]))
    assert again.nmesh == 1
    assert again.dof_frictionloss[0] == pytest.approx(0.05)
    assert str(tmp_path) not in made.files["model"].read_text()


def test_what_is_no_urdf_is_refused_in_one_line(tmp_path):
    with pytest.raises(UsageError, match=r"r.urdf.*: does not compile") as caught:
        load_mjcf(written(tmp_path, robot(INERTIAL).replace("</link>", ""), "r.urdf"))
    assert "\n" not in str(caught.value)


def of_other_people():
    """Every URDF of the wheel example-robot-data, if it is installed."""
    try:
        found = importlib.metadata.distribution("example-robot-data")
    except importlib.metadata.PackageNotFoundError:
        return []
    return sorted(
        Path(str(found.locate_file("cmeel.prefix/share/example-robot-data/robots"))).rglob("*.urdf")
    )


@pytest.mark.slow
@pytest.mark.parametrize("path", of_other_people(), ids=lambda path: path.stem)
def test_robots_of_other_people_open(path):
    try:
        simulator = load_mjcf(str(path))
    except UsageError as error:
        assert "it has no joint" in str(error)
        return
    state, command = simulator.rest_state[None], np.zeros((1, len(simulator.action)))
    assert np.isfinite(simulator.rates(state, command, simulator.defaults())).all()
