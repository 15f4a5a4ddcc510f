"""What a diagnosis of MuJoCo models finds and costs: names, errors, seconds, and how much of them is rollouts.

    python benchmarks/mjcf_diagnosis.py [--only arm_servo-10000-triple] [--out runs/mjcf_diagnosis] [--list]

Four models (a double pendulum on a cart, an arm of six joints with motors and with position servos, a hopper in free
fall), 5 000 and 10 000 samples, nothing missing, one, two and three effects; and of the arms and the pendulum `whole`:
dry and viscous friction and a rotor's inertia at every joint, and a body's mass, scored row by row. The truth is
MuJoCo's at a quarter of the model's step by its Runge-Kutta scheme; joints are read with 0.5 mrad of noise, velocities
are not recorded. Processor seconds are this process's and its workers'; a machine that others use makes wall seconds
longer.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import yaml

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.run import Run
from gpsim.mjcf import MjcfSimulator
from gpsim.stages.diagnose import Task, open_recording

NOISE = 5e-4
AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
LENGTHS, RADII = (0.3, 0.4, 0.35, 0.12, 0.1, 0.08), (0.06, 0.05, 0.045, 0.035, 0.03, 0.025)
MASSES, DAMPING = (4.0, 5.0, 3.0, 1.2, 0.8, 0.4), (0.6, 0.8, 0.5, 0.1, 0.08, 0.03)
ARMATURE, STIFF = (0.1, 0.1, 0.08, 0.02, 0.02, 0.01), (400, 600, 300, 60, 40, 15)
APART = '<default><geom contype="0" conaffinity="0"/></default>'


def arm(servo: bool) -> str:
    """Six hinges in a row."""
    bodies, ends, at = "", "", "0 0 0"
    for i in range(6):
        end = f"0 0 {LENGTHS[i]}" if i < 2 else f"{LENGTHS[i]} 0 0"
        bodies += (
            f'<body name="link{i + 1}" pos="{at}"><joint name="j{i + 1}" axis="{AXES[i]}" damping="{DAMPING[i]}" '
            f'armature="{ARMATURE[i]}"/><geom type="capsule" fromto="0 0 0 {end}" size="{RADII[i]}" '
            f'mass="{MASSES[i]}"/>'
        )
        ends, at = ends + "</body>", end
    drives = "".join(
        f'<position name="a{i + 1}" joint="j{i + 1}" kp="{STIFF[i]}" kv="{0.1 * STIFF[i]}"/>'
        if servo
        else f'<motor name="a{i + 1}" joint="j{i + 1}"/>'
        for i in range(6)
    )
    option = '<option timestep="0.002" integrator="implicitfast"/>'
    gravity = (
        option if servo else option.replace("/>", ' gravity="0 0 0"/>')
    )  # motors alone do not hold it up
    return (
        f"<mujoco>{gravity}{APART}<worldbody>{bodies}{ends}</worldbody><actuator>{drives}</actuator></mujoco>"
    )


def rod(length: float, mass: float, inner: str = "") -> str:
    return f'<geom type="capsule" fromto="0 0 0 0 0 -{length}" size=".03" mass="{mass}"/>{inner}'


POLES = f"""<mujoco><option timestep="0.01" integrator="RK4"/>{APART}<worldbody>
<body name="cart"><joint name="slider" type="slide" axis="1 0 0" damping="0.5"/><geom size=".1" mass="3"/>
<body name="pole"><joint name="hinge" axis="0 1 0" damping="0.05"/>{rod(0.6, 1.0)}
<body name="pole2" pos="0 0 -.6"><joint name="hinge2" axis="0 1 0" damping="0.05"/>{rod(0.6, 0.8)}</body></body></body>
</worldbody><actuator><motor name="slide" joint="slider"/></actuator></mujoco>"""
HOPPER = f"""<mujoco><option timestep="0.002" integrator="implicitfast"/>{APART}<worldbody>
<body name="torso"><joint name="rootx" type="slide" axis="1 0 0"/><joint name="rootz" type="slide" axis="0 0 1"/>
<joint name="rooty" axis="0 1 0"/><geom type="capsule" fromto="0 0 .2 0 0 -.2" size=".05" mass="3.5"/>
<body name="thigh" pos="0 0 -.2"><joint name="thigh_joint" axis="0 -1 0" damping="0.5" armature="0.05"/>{rod(0.45, 3.9)}
<body name="leg" pos="0 0 -.45"><joint name="leg_joint" axis="0 -1 0" damping="0.5" armature="0.05"/>{rod(0.5, 2.7)}
<body name="foot" pos="0 0 -.5"><joint name="foot_joint" axis="0 -1 0" damping="0.3" armature="0.02"/>{rod(0.2, 1.5)}
</body></body></body></body></worldbody><actuator><motor name="hip" joint="thigh_joint"/>
<motor name="knee" joint="leg_joint"/><motor name="ankle" joint="foot_joint"/></actuator></mujoco>"""


@dataclass(frozen=True)
class Effect:
    """What is concealed: the claim, its main parameter, and how the truth gets it."""

    family: str
    on: str
    parameter: str
    value: float
    change: Callable[[Any], None] = lambda model: None
    late: float = 0.0


def coulomb(joint: str, force: float) -> Effect:
    def change(model: Any) -> None:
        dof = int(model.joint(joint).dofadr[0])
        model.dof_frictionloss[dof] += force
        model.dof_solref[dof] = (-1.0, -2.0 / model.opt.timestep)
        model.dof_solimp[dof] = (0.9999, 0.9999, 0.001, 0.5, 2.0)

    return Effect("coulomb_friction", joint, "force", force, change)


def viscous(joint: str, damping: float) -> Effect:
    def change(model: Any) -> None:
        model.dof_damping[int(model.joint(joint).dofadr[0])] += damping

    return Effect("viscous_friction", joint, "damping", damping, change)


def mass(body: str, ratio: float) -> Effect:
    def change(model: Any) -> None:
        model.body_mass[model.body(body).id] *= ratio

    return Effect("parameter_offset", f"{body}.mass", "ratio", ratio, change)


def armature(joint: str, inertia: float) -> Effect:
    def change(model: Any) -> None:
        model.dof_armature[int(model.joint(joint).dofadr[0])] += inertia

    return Effect("armature", joint, "inertia", inertia, change)


def gain(action: str, ratio: float) -> Effect:
    def change(model: Any) -> None:
        model.actuator_gainprm[model.actuator(action).id, 0] *= ratio

    return Effect("actuator_gain", action, "gain", ratio, change)


@dataclass(frozen=True)
class Case:
    """A model, how it is driven, and what is missing in its triple: one and two of it otherwise."""

    xml: str
    dt: float
    size: tuple[float, ...]
    missing: tuple[Effect, ...]
    episode: int = 600


CASES = {
    "poles": Case(POLES, 0.02, (12.0,), (coulomb("hinge", 0.1), mass("pole2", 1.2), gain("slide", 0.85))),
    "arm_motor": Case(
        arm(servo=False), 0.02, (6.0, 5.0, 3.0, 0.5, 0.4, 0.1),
        (coulomb("j2", 1.0), mass("link3", 1.2), viscous("j5", 0.15)),
    ),
    "arm_servo": Case(
        arm(servo=True), 0.02, (0.5,) * 6, (coulomb("j2", 4.0), mass("link3", 1.2), viscous("j5", 0.3))
    ),
    "hopper": Case(
        HOPPER, 0.01, (8.0, 6.0, 2.0), (coulomb("leg_joint", 0.8), mass("foot", 1.25), gain("hip", 0.85)), 60
    ),
}  # fmt: skip
COUNTS = {"none": 0, "single": 1, "pair": 2, "triple": 3}
DRY = {
    "poles": (0.5, 0.1, 0.06),
    "arm_motor": (1.5, 1.25, 0.75, 0.125, 0.1, 0.025),
    "arm_servo": (4.0, 5.0, 3.0, 0.8, 0.5, 0.2),
}
ROW = 0.15  # of a row's size: how far off it may be, if its interval does not hold the truth


def whole(model: str) -> tuple[Effect, ...]:
    """All that every joint lacks, and a body that is a fifth too heavy."""
    xml = mujoco.MjModel.from_xml_string(CASES[model].xml)
    found = []
    for i, force in enumerate(DRY[model]):
        joint = xml.joint(i)
        damping, rotor = 0.5 * float(joint.damping[0]), 0.5 * float(joint.armature[0]) or 0.01
        found += [coulomb(joint.name, force), viscous(joint.name, damping), armature(joint.name, rotor)]
    heavy = next(e for e in CASES[model].missing if e.family == "parameter_offset")
    return (*found, heavy)


def missing(model: str, kind: str) -> tuple[Effect, ...]:
    """What is missing in a case."""
    return whole(model) if kind == "whole" else CASES[model].missing[: COUNTS[kind]]


def commands(rng: np.random.Generator, case: Case, count: int) -> np.ndarray:
    t, made = case.dt * np.arange(count), np.zeros((count, len(case.size)))
    for i, size in enumerate(case.size):
        tones = [
            (rng.normal(), np.exp(rng.uniform(np.log(0.15), np.log(2.5))), rng.uniform(0, 6.3))
            for _ in range(5)
        ]
        whole = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in tones)
        made[:, i] = size * whole / max(float(np.std(whole)), 1e-9)
    return made


def record(case: Case, effects: tuple[Effect, ...], samples: int, folder: Path) -> None:
    """The recording of the truth, beside the model as it is believed."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.xml").write_text(case.xml, encoding="utf-8")
    rng, model = np.random.default_rng(11), mujoco.MjModel.from_xml_string(case.xml)
    model.opt.timestep /= 4
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    for effect in effects:
        effect.change(model)
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    joints = [model.joint(i).name for i in range(model.njnt)]
    actions = [model.actuator(i).name for i in range(model.nu)]
    rows, steps = [",".join(["episode", "t", *joints, *actions])], round(case.dt / model.opt.timestep)
    for e in range(samples // case.episode):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = 0.3 * rng.normal(size=model.nq)
        for k, command in enumerate(commands(rng, case, case.episode)):
            q = data.qpos + NOISE * rng.normal(size=model.nq)
            rows.append(f"{e},{case.dt * k:.4f}," + ",".join(f"{v:.7f}" for v in (*q, *command)))
            data.ctrl[:] = command
            mujoco.mj_step(model, data, steps)
    (folder / "recording.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    units = MjcfUnits(folder)
    meta = {
        "system": "mjcf",
        "model": "robot.xml",
        "dt": case.dt,
        "state": units.state,
        "action": units.action,
    }
    meta["noise"] = dict.fromkeys(joints, NOISE)
    (folder / "recording.yaml").write_text(yaml.safe_dump(meta), encoding="utf-8")


class MjcfUnits:
    """The units of a model's positions and actions."""

    def __init__(self, folder: Path) -> None:
        from gpsim.mjcf import load_mjcf

        simulator = load_mjcf(str(folder / "robot.xml"))
        positions = [c.name for c in simulator.coordinates]
        self.state = {name: simulator.state.units[name] for name in positions}
        self.action = simulator.action.units


def spent() -> float:
    """Processor seconds of this process and of those it has ended."""
    kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(u.ru_utime + u.ru_stime for u in map(resource.getrusage, kinds))


class Watched:
    """Processor seconds of this process that go into rollouts; those of workers are not among them."""

    def __init__(self) -> None:
        self.seconds, self.inner = 0.0, MjcfSimulator.rolled

    def __enter__(self) -> Watched:
        def rolled(simulator: MjcfSimulator, *given: Any, **named: Any) -> Any:
            began = time.process_time()
            made = self.inner(simulator, *given, **named)
            self.seconds += time.process_time() - began
            return made

        MjcfSimulator.rolled = rolled  # type: ignore[method-assign]
        return self

    def __exit__(self, *_: object) -> None:
        MjcfSimulator.rolled = self.inner  # type: ignore[method-assign]


def run(name: str, out: Path, workers: int) -> dict[str, Any]:
    """One diagnosis; what it found and cost."""
    model, samples, kind = name.split("-")
    case = CASES[model]
    effects, folder = missing(model, kind), out / name
    record(case, effects, int(samples), folder)
    recording, simulator = open_recording(Task(folder, None))
    wall, begun, own = time.perf_counter(), spent(), time.process_time()
    with Watched() as rollouts:
        found = diagnose(
            recording, simulator, simulator.defaults(), np.random.default_rng(0), run=Run(threads=workers)
        )
    diagnosis, share = found.diagnosis, rollouts.seconds / max(time.process_time() - own, 1e-9)
    claims = {(e.family, str(e.on)): e for e in diagnosis.effects}
    errors = {
        f"{e.family} on {e.on}": abs(claims[e.family, e.on].parameters[e.parameter].value / e.value - 1.0)
        for e in effects
        if (e.family, e.on) in claims
    }
    told = {c for c, e in claims.items() if e.role == "headline"}
    truth = {(e.family, e.on) for e in effects}
    sizes = {
        (e.family, e.on): claims[e.family, e.on].parameters[e.parameter]
        for e in effects
        if (e.family, e.on) in claims
    }
    hits = [
        abs(s.value - e.value)
        <= max(ROW * abs(e.value), s.value - (s.low or s.value), (s.high or s.value) - s.value)
        for e in effects
        if (s := sizes.get((e.family, e.on))) is not None
    ]
    return {
        "case": name, "right": truth == told, "rows": f"{sum(hits)}/{len(effects)}",
        "spurious": [" on ".join(c) for c in told - truth], "verdict": diagnosis.verdict,
        "named": [" on ".join(c) for c in claims],
        "errors": errors, "wall_s": time.perf_counter() - wall, "processor_s": spent() - begun, "in_rollouts": share,
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", default=[], help="cases, or how they begin")
    parser.add_argument("--out", type=Path, default=Path("runs/mjcf_diagnosis"))
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--list", action="store_true")
    given = parser.parse_args()
    names = [
        f"{m}-{n}-{k}"
        for m in CASES
        for n in (5000, 10000)
        for k in (*COUNTS, *(["whole"] if m in DRY else []))
    ]
    chosen = [n for n in names if not given.only or n.startswith(tuple(given.only))]
    if given.list:
        print("\n".join(chosen))
        return
    for name in chosen:
        row = run(name, given.out, given.workers)
        print(json.dumps(row), flush=True)
        with (given.out / "results.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
