"""Names in a model that are markup, code, paths or control characters: refused, or letter by letter in every export."""

import ast
import json
import re
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import pytest
from attacking import gpsim as gpsim  # a fixture
from mjcf_models import DOUBLE, written

mujoco = pytest.importorskip("mujoco")
from gpsim.effects import Term  # noqa: E402
from gpsim.mjcf import Correction, export_model, load_mjcf  # noqa: E402

PRINTABLE = {
    "dashes": "a--->",
    "comment": "--><motor name='x'/><!--",
    "shell": '"; rm -rf ~; "',
    "path": "../../etc/passwd",
    "html": "<script>alert(1)</script>&amp;",
    "markdown": "**b** [x](http://y) `c` | d",
    "markup": "[/bold] [red]",
    "formula": "$\\frac{x$",
    "format": "{0} %s {PATCH}",
    "python": '"""\nimport os'.replace("\n", "\\n"),
}
STRANGE = {
    "newline": "a\nb", "escape": "a\x1b[31mb", "direction": "a\u202eb", "long": "x" * 5000, "column": "t",
}  # fmt: skip


def named(joint, motor):
    text = DOUBLE.replace('name="elbow"', f"name={quoteattr(joint)}").replace(
        'joint="elbow"', f"joint={quoteattr(joint)}"
    )
    return text.replace('name="m2"', f"name={quoteattr(motor)}")


@pytest.mark.parametrize("kind", STRANGE)
def test_a_name_that_breaks_a_line_is_refused(tmp_path, gpsim, kind):
    name = quoteattr(STRANGE[kind]).replace("\n", "&#10;").replace("\x1b", "&#27;")
    text = DOUBLE.replace('name="elbow"', f"name={name}").replace('joint="elbow"', f"joint={name}")
    said = gpsim("simulators", "show", written(tmp_path, text))
    assert said.code == 2
    assert "joint" in said.err


def test_a_name_that_is_no_text_is_refused(tmp_path, gpsim):
    robot = tmp_path / "robot.xml"
    robot.write_bytes(DOUBLE.encode().replace(b'"elbow"', b'"elb\x93w"'))
    assert "a name in it is not valid UTF-8" in gpsim("simulators", "show", robot).err
    robot.write_bytes(DOUBLE.encode().replace(b"<worldbody>", b"<!-- Andr\xe9 --><worldbody>", 1))
    assert gpsim("simulators", "show", robot).code == 0


@pytest.mark.parametrize("kind", PRINTABLE)
def test_a_printable_name_is_itself_in_every_file_of_an_export(tmp_path, gpsim, kind):
    joint, motor = PRINTABLE[kind], f"m {PRINTABLE[kind]}"
    robot = written(tmp_path, named(joint, motor))
    assert joint in gpsim("simulators", "show", robot).out
    simulator = load_mjcf(robot)
    terms = (
        Term("coulomb_friction", joint, {"force": 0.05}),
        Term("actuator_dead_zone", motor, {"width": 0.3}),
    )
    made = export_model(
        Correction(simulator, simulator.defaults(), terms, 0.01, 5),
        {term.identity: f"{term.family} on {term.on}" for term in terms},
        {},
        tmp_path / "fixed.xml",
    )
    model = mujoco.MjModel.from_xml_path(str(made.files["model"]))
    assert joint in [model.joint(j).name for j in range(model.njnt)]
    root = ElementTree.parse(made.files["model"]).getroot()
    assert len(root.find("actuator")) == 2
    text = made.files["model"].read_text(encoding="utf-8")
    assert all("--" not in comment for comment in re.findall("<!--(.*?)-->", text, re.DOTALL))
    tree = ast.parse(made.files["wrapper"].read_text(encoding="utf-8"))
    [patch] = [n.value for n in tree.body if isinstance(n, ast.AnnAssign) and n.target.id == "PATCH"]
    assert list(ast.literal_eval(patch)["commands"]) == [motor]
    patched = json.loads(made.files["patch"].read_text())["effects"]
    assert {effect["on"] for effect in patched} == {joint, motor}
    assert made.files["diff"].is_file()
