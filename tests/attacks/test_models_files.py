"""MuJoCo models that are made to hang gpsim or to fill memory: refused before MuJoCo opens or makes anything."""

import os
import struct

import pytest
from attacking import gpsim as gpsim  # a fixture
from mjcf_models import PENDULUM, written

pytest.importorskip("mujoco")
GEOM = '<geom size=".1" contype="0" conaffinity="0"/>'
MANY = '<body pos="{} 0 0"><joint axis="0 1 0"/>' + GEOM + "</body>"


def world(inside):
    return PENDULUM.replace("</worldbody>", f"{inside}</worldbody>")


def before(part):
    return PENDULUM.replace("<worldbody>", f"{part}<worldbody>")


def texture(file):
    return before(f'<asset><texture name="a" type="2d" file="{file}"/></asset>')


@pytest.mark.parametrize("step", ["0", "nan", "-0.01", "1e-12", "inf", "1e9"])
def test_a_step_that_no_simulation_takes(tmp_path, gpsim, step):
    robot = written(tmp_path, PENDULUM.replace('timestep="0.001"', f'timestep="{step}"'))
    for command in ("show", "check"):
        said = gpsim("simulators", command, robot)
        assert said.code == 2
        assert "gpsim takes steps of 1e-06 to 1 s; mend timestep in <option>" in said.err


def test_mujoco_leaves_no_log_in_the_users_folder(tmp_path, gpsim):
    robot = written(tmp_path, PENDULUM.replace('mass="1.3"', 'mass="1.3" pos="nan 0 0"', 1))
    assert gpsim("simulators", "show", robot).code == 2
    assert not list(tmp_path.glob("MUJOCO_LOG*"))


@pytest.mark.parametrize(
    "text",
    [
        world(f'<replicate count="100000000" offset="1 0 0">{GEOM}</replicate>'),
        world(f'<replicate count="&#49;00000000" offset="1 0 0">{GEOM}</replicate>'),
        world('<replicate count="300" offset="1 0 0">' * 3 + GEOM + "</replicate>" * 3),
        world("".join(MANY.format(i) for i in range(10_000))),
        world('<flexcomp name="f" type="grid" count="1000 1000 1000" spacing=".1 .1 .1"/>'),
        before('<include file="part.xml"/>').replace("robot", "part"),
    ],
    ids=["replicate", "in characters", "nested", "10 000 joints", "flex", "in another file"],
)
def test_more_elements_than_any_robot_has(tmp_path, gpsim, text):
    written(
        tmp_path,
        f'<mujoco><worldbody><replicate count="20000">{GEOM}</replicate></worldbody></mujoco>',
        "part.xml",
    )
    said = gpsim("simulators", "show", written(tmp_path, text))
    assert said.code == 2
    assert "make more than 10000 elements; if it is valid, allow more: GPSIM_LIMITS=" in said.err


def test_what_a_user_grants_beside_the_limits(tmp_path, gpsim, monkeypatch):
    robot = written(tmp_path, world(f'<replicate count="11000" offset="1 0 0">{GEOM}</replicate>'))
    assert gpsim("simulators", "show", robot).code == 2
    robot = written(tmp_path, world("".join(MANY.format(i) for i in range(210))))
    assert (
        "211 degrees of freedom, the limit is 200; if it is valid" in gpsim("simulators", "show", robot).err
    )
    monkeypatch.setenv("GPSIM_LIMITS", "2")
    assert gpsim("simulators", "show", robot).code == 0
    monkeypatch.setenv("GPSIM_LIMITS", "a lot")
    assert "GPSIM_LIMITS='a lot': give a number from 1" in gpsim("simulators", "show", robot).err


@pytest.mark.parametrize(
    "text",
    [
        texture("no.png").replace('file="no.png"', 'builtin="flat" width="100000" height="100000"'),
        before('<asset><hfield name="a" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>'),
        before('<size nuserdata="2000000000"/>'),
        PENDULUM.replace('<motor name="torque"', '<motor nsample="2000000000" delay="1" name="torque"'),
        PENDULUM.replace("</mujoco>", '<sensor><user name="u" dim="2000000000"/></sensor></mujoco>'),
    ],
    ids=["texture", "height field", "user data", "history", "sensor"],
)
def test_room_for_more_numbers_than_any_robot_needs(tmp_path, gpsim, text):
    said = gpsim("simulators", "show", written(tmp_path, text))
    assert said.code == 2
    assert "the limit is 16777216; if it is valid, allow more: GPSIM_LIMITS=" in said.err


@pytest.mark.parametrize("kind", ["pipe", "device", "link to a pipe"])
@pytest.mark.parametrize("part", ["include", "mesh", "texture", "cube", "model"])
def test_what_is_no_ordinary_file_is_not_opened(tmp_path, gpsim, kind, part):
    name = {"pipe": "part.stl", "device": "/dev/zero", "link to a pipe": "link.stl"}[kind]
    os.mkfifo(tmp_path / "part.stl")
    (tmp_path / "link.stl").symlink_to(tmp_path / "part.stl")
    text = {
        "include": before(f'<include file="{name}"/>'),
        "mesh": before(f'<asset><mesh name="a" file="{name}"/></asset>'),
        "texture": texture(name),
        "cube": before(f'<asset><texture name="a" type="cube" fileleft="{name}"/></asset>'),
        "model": before(f'<asset><model name="a" file="{name}"/></asset>'),
    }[part]
    said = gpsim("simulators", "show", written(tmp_path, text))
    assert said.code == 2
    assert "which is not a regular file; name a file of the model" in said.err


def test_a_urdf_with_a_pipe_for_a_package(tmp_path, gpsim):
    os.mkfifo(tmp_path / "package.xml")
    os.mkfifo(tmp_path / "part.stl")
    text = '<robot name="r"><link name="a"><visual><geometry><mesh filename="{}"/></geometry></visual></link></robot>'
    for name in ("package://arm/part.stl", "part.stl", "file://part.stl"):
        said = gpsim("simulators", "show", written(tmp_path, text.format(name), "robot.urdf"))
        assert said.code == 2
        assert "which is not a regular file" in said.err


def test_pictures_that_swell(tmp_path, gpsim):
    head = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sIIBBBBB", 13, b"IHDR", 100_000, 100_000, 8, 6, 0, 0, 0)
    (tmp_path / "sky.png").write_bytes(head + bytes(40))
    assert (
        "its meshes and pictures take 40000000000 bytes"
        in gpsim("simulators", "show", written(tmp_path, texture("sky.png"))).err
    )


@pytest.mark.parametrize("first", ["asset", "worldbody"])
def test_files_that_attach_each_other_twice_over(tmp_path, gpsim, first):
    """2^30 copies of one geom, in 31 files."""
    twice = '<attach model="m" body="b" prefix="p"/><attach model="m" body="b" prefix="q"/>'
    for i in range(30):
        parts = [
            f'<asset><model name="m" file="part{i + 1}.xml"/></asset>',
            f'<worldbody><body name="b">{twice}</body></worldbody>',
        ]
        text = "".join(parts if first == "asset" else reversed(parts))
        written(tmp_path, f"<mujoco>{text}</mujoco>", f"part{i}.xml")
    written(tmp_path, f'<mujoco><worldbody><body name="b">{GEOM}</body></worldbody></mujoco>', "part30.xml")
    said = gpsim("simulators", "show", str(tmp_path / "part0.xml"))
    assert said.code == 2
    assert "elements; if it is valid" in said.err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('<!DOCTYPE l [<!ENTITY a "ha">]>' + PENDULUM, "it declares XML entities"),
        ("<mujoco><worldbody>" + "<body>" * 100_000, "nested more than 500 deep"),
        (before("<") + "x", "a < that begins no tag"),
        ("<mujoco>" + "<!--" * 100_000, "a < that begins no tag"),
        ("", "does not compile"),
    ],
    ids=["entities", "deep", "no tag", "comments", "empty"],
)
def test_xml_that_is_a_bomb_or_none(tmp_path, gpsim, text, said):
    told = gpsim("simulators", "show", written(tmp_path, text))
    assert told.code == 2
    assert said in told.err


def test_an_xml_larger_than_any_model(tmp_path, gpsim):
    with (tmp_path / "robot.xml").open("wb") as file:
        file.truncate(40 << 20)
    assert (
        "the XML of a model has at most 33554432 bytes"
        in gpsim("simulators", "show", tmp_path / "robot.xml").err
    )


def test_comments_as_people_write_them_are_read(tmp_path, gpsim):
    """MuJoCo takes two dashes inside a comment, and so does what looks at the file before."""
    assert gpsim("simulators", "show", written(tmp_path, before("<!-- ---- the arm ---- -->"))).code == 0
