"""The picture of a robot: every joint in the colour of the share of the mismatch that is told at it."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgb

from gpsim.channels import FloatArray
from gpsim.diagnosis import Diagnosis
from gpsim.mjcf import MjcfSimulator, mujoco, rendered
from gpsim.recordings import evenly
from gpsim.reports.account_effects import TRIFLE, effect_name, told_effects
from gpsim.reports.bodies import THICK, poses, shown_geoms, sticks
from gpsim.reports.canvas import FAINT, GRID, INK, legend_label, panels, png, style
from gpsim.reports.diagnosis_figures import Picture
from gpsim.reports.diagnosis_text import WHOLE, noun
from gpsim.reports.quantities import ELLIPSIS, LABEL, percent, shortened

ROBOT = "robot"
SCALE = LinearSegmentedColormap.from_list("share", ("#C9CFD6", "#F0B75A", "#D55E00", "#7F2704"))
POSTURES = 60  # of the recording, among which the one that shows most is looked for
AZIMUTHS, ELEVATIONS = range(0, 360, 15), (-10, -35, -80)  # degrees
LEAST = 0.1  # of the mismatch: what the scale reaches at least
ROWS, LAWS, SAID = 12, 2, 38  # joints that are listed at most, laws told of one, and their letters
WIDE, HIGH = 5.4, 1.9  # inches: the picture, the robot at least
BELOW, ROW = 0.45, 0.32  # inches: the scale, a joint's lines
BESIDE = 3.0  # inches: where the list begins
AMBIENT = 0.6  # of the light: colours can be told apart in the shade, too
DOTS = 200  # an inch of the rendered robot, and of the picture
CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
NOWHERE = ""  # stands for the joint of what acts at none


def robot_figure(diagnosis: Diagnosis, simulator: MjcfSimulator, states: FloatArray) -> Picture | None:
    """The robot in a posture of the recording, states (N, S); None where nothing is told of it."""
    told = told_at(diagnosis, simulator)
    if not told:
        return None
    shares = {joint: sum(laws.values()) for joint, laws in told.items()}
    most = max(LEAST, *shares.values())
    joints = [*_joints(simulator)]
    listed = sorted(joints, key=lambda joint: -shares.get(joint, -1.0))[:ROWS]
    rows = len(listed) + (NOWHERE in told)
    high = max(HIGH, ROW * rows + 0.2) + BELOW
    with style():
        figure, panel = panels(1, 1, (WIDE, high))
        figure.set_layout_engine("none")
        axis: Axes = panel[0, 0]
        axis.set_position((0.0, 0.0, 1.0, 1.0))
        axis.axis("off")
        at = _draw_robot(axis, simulator, states, {j: shares.get(j, 0.0) / most for j in joints}, high)
        for joint, (x, y) in at.items():
            tint = SCALE(shares.get(joint, 0.0) / most)
            axis.plot(x, y, "o", color=tint, markeredgecolor=INK, markeredgewidth=0.8, markersize=7, zorder=4)
        listed.sort(key=lambda joint: -at[joint][1])
        for k, joint in enumerate([*listed, *([NOWHERE] if NOWHERE in told else [])]):
            y = (high + BELOW + ROW * rows) / 2 - ROW * (k + 0.5)
            _write(axis, y, joint, told.get(joint, {}))
            if joint:
                ends = zip(at[joint], (BESIDE - 0.06, y), strict=True)
                axis.plot(*ends, color=FAINT, linewidth=0.6, zorder=3)
        bar = np.linspace(0.0, 1.0, 256)[None]
        axis.imshow(bar, SCALE, extent=(0.5, BESIDE - 0.7, 0.18, 0.28), aspect="auto")
        axis.text(0.45, 0.23, "0 %", fontsize=8, color=FAINT, va="center", ha="right")
        axis.text(BESIDE - 0.65, 0.23, f"{percent(most)} %", fontsize=8, color=FAINT, va="center")
        axis.set(xlim=(0.0, WIDE), ylim=(0.0, high))
        of = "the mismatch that is reported at a joint"
        if not any(told_effects(diagnosis)):
            of = "a joint's error is no noise"
        return Picture(
            "The robot, and the location of the mismatch",
            f"In a posture from the recording. Colours and numbers give the share of {of}.",
            png(figure, DOTS),
            joints,
        )


def _write(axis: Axes, y: float, joint: str, laws: Mapping[str, float]) -> None:
    """A joint's two lines in the list, y [inches]: its name with its share, and what is told there."""
    each, share = sorted(laws.items(), key=lambda law: -law[1]), sum(laws.values())
    name = legend_label(joint, LABEL) if joint else "at no single joint"
    weight = "bold" if share >= TRIFLE else "normal"
    text = f"{name}  {percent(share)} %" if each else name
    axis.text(BESIDE, y, text, fontsize=9, weight=weight, va="bottom")
    large = [law for law in each if law[1] >= TRIFLE] or each[:1]
    said = [f"{law} {percent(part)} %" if len(each) > 1 else law for law, part in large[:LAWS]]
    text = ", ".join(shortened(one, SAID // len(said)) for one in said)
    axis.text(BESIDE, y, text + ELLIPSIS * (len(large) > LAWS), fontsize=7.5, color=FAINT, va="top")


def told_at(diagnosis: Diagnosis, simulator: MjcfSimulator) -> dict[str, dict[str, float]]:
    """Joint -> what is told at it -> its share of the mismatch.

    A diagnosis that tells no effect says of rates how much of their error lies beyond the noise.
    """
    told: dict[str, dict[str, float]] = {}
    headline, slight = told_effects(diagnosis)
    for effect in (*headline, *slight):
        places = (effect.on,) if isinstance(effect.on, str) else effect.on
        share = 0.0 if effect.importance is None else effect.importance.share
        for place in places:
            joint, law = _joint(simulator, place), noun(effect.family)
            if place not in (joint, *simulator.drives):
                law = place if effect.family == WHOLE else effect_name(effect)
            laws = told.setdefault(joint, {})
            laws[law] = laws.get(law, 0.0) + max(float(np.nan_to_num(share)), 0.0) / len(places)
    if not told:
        for rate, share in diagnosis.location.channels.items():
            told[_joint(simulator, rate)] = {"beyond the noise": share}
    return told


def _joints(simulator: MjcfSimulator) -> dict[str, int]:
    """The model's joints, hinges and slides first, and their numbers in it."""
    names, model = simulator.body.names, simulator.body.base
    free = [j for j in range(model.njnt) if j not in names.joints]
    return dict(zip((*(c.name for c in names.coordinates), *names.free), (*names.joints, *free), strict=True))


def _joint(simulator: MjcfSimulator, place: str) -> str:
    """The joint of a channel, an actuator, a body, a geom or a number of one (`fore.mass`, `base.surge`)."""
    names, model = simulator.body.names, simulator.body.base
    joints = {n: c.name for c in names.coordinates for n in (c.name, c.velocity, c.rate)} | dict(names.drives)
    joints |= {name: name for name in names.free}
    bodies = {f"geom{g}": int(b) for g, b in enumerate(model.geom_bodyid)}
    bodies |= {model.geom(g).name: int(b) for g, b in enumerate(model.geom_bodyid)}
    bodies |= {name: b for b, name in enumerate(names.bodies)}
    moves = {int(model.jnt_bodyid[j]): name for name, j in _joints(simulator).items()}
    for word in (place, place.rpartition(".")[0]):
        if word in joints:
            return joints[word]
        if word and word in bodies:
            return moves.get(int(model.body_weldid[bodies[word]]), NOWHERE)
    return NOWHERE


def _seen(simulator: MjcfSimulator, states: FloatArray) -> tuple[Any, float, float, FloatArray]:
    """The posture and the view in which joints and bodies lie furthest apart, along the joints' axes if possible.

    Returns MuJoCo's data, azimuth and elevation [degrees], and the directions right, up and ahead (3, 3).
    """
    mj, model, joints = mujoco(), simulator.body.base, [*_joints(simulator).values()]
    qpos, _ = simulator.layout.full(np.nan_to_num(states[evenly(len(states), POSTURES)]))
    at, best = poses(model, qpos), (-1.0, 0, 0.0, 0.0, np.eye(3))
    points = np.concatenate([at.anchor[:, joints], at.centre[:, 1:]], axis=1)
    for azimuth in AZIMUTHS:
        for elevation in ELEVATIONS:
            sin, cos = np.sin(np.radians([azimuth, elevation])), np.cos(np.radians([azimuth, elevation]))
            right, ahead = (sin[0], -cos[0], 0.0), (cos[1] * cos[0], cos[1] * sin[0], sin[1])
            axes = np.array([right, np.cross(right, ahead), ahead])
            apart = (points @ axes[:2].T).var(axis=1).sum(axis=1)
            score = apart * (1.0 + np.abs(at.axis[:, joints] @ axes[2]).mean(axis=1))
            row = int(np.argmax(score))
            best = max(best, (float(score[row]), row, azimuth, elevation, axes), key=lambda one: one[0])
    data = mj.MjData(model)
    data.qpos[:] = qpos[best[1]]
    mj.mj_kinematics(model, data)
    return data, *best[2:]


def _draw_robot(
    axis: Axes, simulator: MjcfSimulator, states: FloatArray, levels: Mapping[str, float], high: float
) -> dict[str, tuple[float, float]]:
    """The robot by MuJoCo's renderer or, where there is none, as sticks; returns where its joints are [inches].

    levels: of every joint how far along the scale its colour is.
    """
    data, azimuth, elevation, axes = _seen(simulator, states)
    model, joints = copy.copy(simulator.body.base), _joints(simulator)
    geoms = shown_geoms(model)
    skeleton, bare = sticks(model, ()), sticks(model, set(model.geom_bodyid[geoms].tolist()))

    def ends(rods: Sequence[tuple[int, FloatArray, FloatArray]]) -> FloatArray:
        """(K, 2, 3) m in the world."""
        every = [[data.xpos[b] + data.xmat[b].reshape(3, 3) @ end for end in two] for b, *two in rods]
        return np.reshape(every, (-1, 2, 3))

    turns, boxes = data.geom_xmat[geoms].reshape(-1, 3, 3), model.geom_aabb[geoms][:, None]
    corners = np.einsum("gij,gkj->gki", turns, boxes[..., :3] + CORNERS * boxes[..., 3:])
    corners += data.geom_xpos[geoms][:, None]
    anchors = data.xanchor[[*joints.values()]]
    around = [ends(skeleton).reshape(-1, 3), corners.reshape(-1, 3), anchors]
    every = np.concatenate(around) @ axes.T
    low, up = every.min(axis=0), every.max(axis=0)
    room, middle = np.array([BESIDE - 0.75, high - BELOW]), (low + up) / 2
    scale = float((0.85 * room / np.maximum(up - low, 1e-6)[:2]).min())  # inches a metre

    def flat(points: FloatArray) -> FloatArray:
        """(..., 2) inches of points (..., 3) m."""
        return np.asarray((points @ axes.T - middle)[..., :2] * scale + room / 2 + (0.0, BELOW))

    level = np.zeros(model.nbody)
    for name, j in joints.items():
        level[model.jnt_bodyid[j]] += levels[name]
    tints = np.where((model.body_weldid == 0)[:, None], to_rgb(GRID), SCALE(level[model.body_weldid])[:, :3])
    model.geom_rgba[:], model.geom_matid[:] = 0.0, -1
    model.geom_rgba[geoms] = np.column_stack([tints[model.geom_bodyid[geoms]], np.ones(len(geoms))])
    model.light_active[:] = False
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = AMBIENT, 1.0 - AMBIENT
    model.stat.extent = float(np.linalg.norm(up - low))
    model.vis.global_.orthographic, model.vis.global_.fovy = 1, room[1] / scale
    camera = [*(middle @ axes), 2.0 * model.stat.extent, azimuth, elevation]
    thick = THICK / 2 * max((float(np.linalg.norm(b - a)) for a, b in ends(bare)), default=0.0)
    rods = [[*a, *b, thick, *tints[body]] for (body, *_), (a, b) in zip(bare, ends(bare), strict=True)]
    image = rendered(model, data.qpos, camera, rods, (int(room[0] * DOTS), int(room[1] * DOTS)))
    if image is not None:
        axis.imshow(image, extent=(0.0, room[0], BELOW, high), aspect="auto", zorder=0)
    else:
        for (body, *_), two in zip(skeleton, flat(ends(skeleton)), strict=True):
            axis.plot(*two.T, color=tints[body], linewidth=7, solid_capstyle="round", zorder=1)
    return dict(zip(joints, map(tuple, flat(anchors).tolist()), strict=True))
