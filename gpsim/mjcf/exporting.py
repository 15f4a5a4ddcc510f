"""A corrected model written down: MJCF, a wrapper for what MJCF cannot say, and where each effect went."""

from __future__ import annotations

import ast
import difflib
import inspect
import pprint
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from gpsim.effects import bent, turned
from gpsim.errors import Terminated, UsageError
from gpsim.files import disk_errors, write_json
from gpsim.mjcf.attributes import Change, apply, changes_of, check_moved, moved_changes, named, written
from gpsim.mjcf.geometry import Place
from gpsim.mjcf.loading import asset_places, spec_of
from gpsim.mjcf.naming import called, names_of
from gpsim.mjcf.optional import mujoco, quiet
from gpsim.mjcf.patching import Correction, Patch, patch_of
from gpsim.mjcf.urdf import urdf_of

SCHEMA = "gpsim.patch/1"
YIELDING = (bent, turned)
"""Of modules whose laws the wrapper holds where it needs them, as they are."""
PATCH_FILE = "patch.json"
FIELDS = (
    "qpos0", "qpos_spring", "body_pos", "body_quat", "body_mass", "body_inertia", "body_ipos", "site_pos", "site_quat",
    "jnt_axis", "jnt_pos", "jnt_range", "jnt_stiffness", "dof_armature", "dof_damping", "dof_dampingpoly",
    "dof_frictionloss", "actuator_gainprm", "actuator_biasprm", "actuator_gear", "actuator_ctrlrange",
    "actuator_forcerange", "geom_size", "geom_pos", "geom_friction", "geom_solref",
    "tendon_frictionloss", "tendon_solref_fri", "tendon_damping", "tendon_armature",
)  # fmt: skip
Said = Mapping[tuple[str, str], str]
"""Of an effect, by family and place, its sentence with its intervals."""


@dataclass(frozen=True)
class Exported:
    """What was written. effects: where each went; difference: see `largest_difference`; lost: what no URDF holds."""

    files: Mapping[str, Path]
    effects: Sequence[Mapping[str, Any]]
    difference: float
    lost: Sequence[str] = ()

    @property
    def wrapped(self) -> bool:
        """Whether the wrapper has something to do."""
        return any("wrapper" in effect["where"] for effect in self.effects)


def export_model(
    correction: Correction,
    said: Said,
    source: Mapping[str, str],
    out: Path,
    moved: Mapping[Place, str] = MappingProxyType({}),
    urdf: bool = False,
) -> Exported:
    """Write OUT.xml, OUT.py, OUT.diff and patch.json, with `urdf` OUT.urdf, too; raises UsageError.

    Nothing is overwritten. source: what patch.json says of where it is from; moved: of each place of the geometry its
    sentence.
    """
    files, name = files_of(out, urdf), correction.simulator.name
    patch, body = patch_of(correction), correction.simulator.body
    spec = spec_of(name)
    assets = asset_places(spec, out.resolve().parent)
    named(spec, {s.geom: s.name for s in body.surfaces})
    before = written(spec.to_xml(), spec, (), assets)
    changes = changes_of(body, patch.fields, patch.motors, correction.step)
    effects = _account(patch, changes, said, correction)
    changes = [*moved_changes(correction.simulator, moved), *changes]
    apply(spec, body, changes)
    wanted = _made(spec.compile, f"{name}: does not compile with the effects that were found")
    text = written(spec.to_xml(), spec, changes, assets)
    check_moved(wanted, correction.simulator)
    temporary = out.with_name(f".{out.name}")
    try:  # as whoever opens the file gets it, meshes looked for from where it will lie
        with disk_errors(out, "--out"):
            temporary.write_text(text, encoding="utf-8")
        read = partial(mujoco().MjModel.from_xml_path, str(temporary))
        found = _made(read, f"{out}: MuJoCo cannot read its own output", 200)
    finally:
        temporary.unlink(missing_ok=True)
    if names_of(found, out.name).state.names != body.names.state.names:
        raise UsageError(f"{name}: its joints are read back in another order; name all of them in the model")
    difference = largest_difference(wanted, found)
    as_urdf, lost = urdf_of(found, out.stem) if urdf else ("", [])
    told = {"model": out.name, **patch.told}
    about = {
        "schema": SCHEMA, **source, "model": out.name, "wrapper": files["wrapper"].name,
        "control_step": correction.dt, "largest_difference": difference, "effects": effects,
        "geometry": [
            {**asdict(m.place), "value": m.value, "said": moved.get(m.place, "")}
            for m in correction.simulator.geometry
        ],
        **({"not_in_urdf": lost} if urdf else {}),
    }  # fmt: skip
    with disk_errors(out, "--out"):
        files["model"].write_text(text, encoding="utf-8")
        files["wrapper"].write_text(wrapper(told), encoding="utf-8")
        # From the model as MjSpec writes it, which keeps neither comments nor includes.
        lines = difflib.unified_diff(before.splitlines(), text.splitlines(), name, out.name, lineterm="", n=1)
        files["diff"].write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
        if urdf:
            files["urdf"].write_text(as_urdf, encoding="utf-8")
        write_json(files["patch"], about)
    return Exported(files, effects, difference, lost)


def planned(correction: Correction, said: Said) -> list[dict[str, Any]]:
    """Where each effect would go, as in patch.json; nothing is written or compiled. Raises UsageError."""
    patch, body = patch_of(correction), correction.simulator.body
    return _account(patch, changes_of(body, patch.fields, patch.motors, correction.step), said, correction)


def files_of(out: Path, urdf: bool = False) -> dict[str, Path]:
    """The files that are made beside each other; raises UsageError where one is there already."""
    if out.suffix.lower() not in (".xml", ".mjcf"):
        raise UsageError(f"--out {out}: a corrected model is MJCF; name it robot_corrected.xml")
    if not out.stem.isidentifier():
        raise UsageError(f"--out {out}: its wrapper is imported by its name; use only letters, digits and _")
    files = {
        "model": out,
        "wrapper": out.with_suffix(".py"),
        "diff": out.with_suffix(".diff"),
        "patch": out.with_name(PATCH_FILE),
        **({"urdf": out.with_suffix(".urdf")} if urdf else {}),
    }
    for path in files.values():
        if path.exists():
            raise UsageError(f"{path}: exists already; choose another --out, each in its own folder")
    if not out.resolve().parent.is_dir():
        raise UsageError(f"{out.parent}: no such folder; make it first")
    return files


def wrapper(told: Mapping[str, Any]) -> str:
    """The wrapper's text: the same for every robot, but for what it is told."""
    text = Path(__file__).with_name("robot_template.py").read_text(encoding="utf-8")
    patch = pprint.pformat(dict(told), width=110, sort_dicts=False)
    empty = "PATCH: dict[str, Any] = {}"
    assert text.count(empty) == 1
    if told["yields"]:
        for function in YIELDING:  # the functions and numbers of its module, without its head
            source = Path(inspect.getfile(function)).read_text(encoding="utf-8")
            own = [n for n in ast.parse(source).body if isinstance(n, (ast.Assign, ast.FunctionDef))]
            text += "".join(f"\n\n{ast.get_source_segment(source, node)}\n" for node in own)
        text += "\n\nLAWS.update(globals())\n"
    return text.replace(empty, f"PATCH: dict[str, Any] = {patch}").replace("MODEL", str(told["model"]), 1)


def largest_difference(wanted: Any, found: Any) -> float:
    """The largest difference of a field between two models, over the field's largest entry."""
    worst = 0.0
    for name in FIELDS:
        one, other = (np.asarray(getattr(m, name), dtype=np.float64) for m in (wanted, found))
        if one.shape != other.shape:
            return float("inf")
        if one.size:
            worst = max(worst, float(np.abs(one - other).max() / max(float(np.abs(one).max()), 1e-12)))
    return worst


def _account(
    patch: Patch, changes: Sequence[Change], said: Said, correction: Correction
) -> list[dict[str, Any]]:
    """Where each effect went, in the order of the diagnosis; its sentence goes into the comments of what it changes."""
    body, effects = correction.simulator.body, []
    geoms = {s.geom: s.name for s in body.surfaces}
    order = {(t.family, t.on): i for i, t in enumerate(correction.terms)}
    for went in sorted(patch.went, key=lambda w: order[w.term.identity]):
        sentence = said.get(went.term.identity, f"{went.term.family} on {went.term.on}")
        attributes = []
        for change in changes:
            if (change.kind, change.index) not in went.elements:
                continue
            change.comments.append(sentence)
            own = geoms.get(change.index) if change.kind == "geom" else None
            name = change.name or own
            if not name and change.kind != "option":
                name = called(body.base, change.kind, change.index)
            moved = [name for name in change.attributes if name not in change.kept]
            attributes.append(f"{change.kind} {name}".strip() + f": {', '.join(moved)}")
        made = {"family": went.term.family, "on": went.term.on, "said": sentence, "where": went.where}
        effects.append({**made, "attributes": attributes, "why": went.why})
    return effects


@quiet()
def _made(by: Callable[[], Any], fault: str, most: int | None = None) -> Any:
    """What MuJoCo makes; its faults are said in the user's words, and in its own up to so many characters."""
    try:
        return by()
    except Terminated:
        raise
    except Exception as error:
        raise UsageError(f"{fault}: {' '.join(str(error).split())[:most]}") from error
