"""Bodies that float: drag along their own axes, wind, speeds from poses, and what is said of a drone that lacks them."""

import numpy as np
import pytest
from mjcf_models import FLOATING, logged, written
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import gpsim
from gpsim.effects import Gate, Term
from gpsim.mjcf import load_mjcf

INERTIA = np.array([0.011, 0.012, 0.02])
MASS, G, ARM, SPIN = 1.2, 9.81, 0.16, 0.02
ROTORS = [(1, 1, -1), (-1, 1, 1), (-1, -1, -1), (1, -1, 1)]
SITES = "".join(f'<site name="r{i}" pos="{ARM * x} {ARM * y} 0"/>' for i, (x, y, _) in enumerate(ROTORS))
MOTORS = "".join(
    f'<motor name="t{i}" site="r{i}" gear="0 0 1 0 0 {SPIN * s}" ctrlrange="0 9" ctrllimited="true"/>'
    for i, (_, _, s) in enumerate(ROTORS)
)
DRONE = f"""<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>
<body name="frame" pos="0 0 1"><freejoint name="base"/>
<inertial pos="0 0 0" mass="{MASS}" diaginertia="{" ".join(map(str, INERTIA))}"/>{SITES}</body></worldbody>
<actuator>{MOTORS}</actuator></mujoco>"""
POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")
UNITS = (*("m",) * 3, *("1",) * 4, *("m/s",) * 3, *("rad/s",) * 3)
MIX = np.array(
    [[1, 1, 1, 1], *(ARM * np.array(ROTORS).T[[1, 0]] * [[1], [-1]]), SPIN * np.array(ROTORS).T[2]]
)
"""(4, 4): thrust and torques of the rotors' forces."""


def newton(state, thrust, lin, quad, wind, mass=MASS):
    """d/dt of (position, quaternion, velocity in the world, rates in the body), by Newton's and Euler's equations."""
    q, v, w = state[3:7], state[7:10], state[10:13]
    turn = Rotation.from_quat(q / np.linalg.norm(q), scalar_first=True)
    lift, *torque = MIX @ thrust
    moves = np.concatenate([turn.inv().apply(v), w])
    drag = -(lin + quad * np.abs(moves)) * moves
    force = turn.apply(drag[:3] + np.array([0.0, 0.0, lift])) + wind
    spin = (torque + drag[3:] - np.cross(w, INERTIA * w)) / INERTIA
    a, b, c, d = q
    turned = [-b * w[0] - c * w[1] - d * w[2], a * w[0] + c * w[2] - d * w[1],
              a * w[1] + d * w[0] - b * w[2], a * w[2] + b * w[1] - c * w[0]]  # fmt: skip
    return np.concatenate([v, np.multiply(0.5, turned), force / mass - [0.0, 0.0, G], spin])


def flown(state, thrusts, dt, *of, **more):
    """(K + 1, 13) states, each thrust (K, 4) held for dt."""
    out = [state]
    for thrust in thrusts:
        done = solve_ivp(
            lambda _, s, u=thrust: newton(s, u, *of, **more), (0, dt), out[-1], rtol=1e-9, atol=1e-10
        )
        out.append(done.y[:, -1])
    return np.array(out)


LIN, QUAD = np.array([0.3, 0.5, 0.1, 0.004, 0.0, 0.003]), np.array([0.1, 0.05, 0.2, 0.0, 0.002, 0.0])
WIND = np.array([0.4, -0.2, 0.1])
AXES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
LAWS = [
    *(Term("viscous_friction", f"base.{a}", {"damping": b}) for a, b in zip(AXES, LIN, strict=True) if b),
    *(Term("quadratic_drag", f"base.{a}", {"drag": c}) for a, c in zip(AXES, QUAD, strict=True) if c),
    *(Term("constant_force", f"base.{a}", {"force": f}) for a, f in zip("xyz", WIND, strict=True)),
]
START = np.array([0.0, 0.0, 1.0, *Rotation.from_euler("zyx", [0.9, 0.4, -0.5]).as_quat(scalar_first=True),
                  1.5, -0.8, 0.5, 0.6, -1.0, 2.0])  # fmt: skip


def test_drag_and_wind_are_those_of_newtons_equations(tmp_path):
    drone = load_mjcf(written(tmp_path, DRONE))
    rng = np.random.default_rng(3)
    thrusts = rng.uniform(2.0, 4.0, (20, 4))
    values = [{k: np.array([v]) for k, v in term.values.items()} for term in LAWS]
    held = np.repeat(thrusts, 10, axis=0)[None]
    said = drone.rolled(LAWS, {}, values, START[None], held, np.array([1e-3]), np.zeros(1))[0, 9::10]
    true = flown(START, thrusts, 0.01, LIN, QUAD, WIND)[1:]
    still = flown(START, thrusts, 0.01, 0.0 * LIN, 0.0 * QUAD, 0.0 * WIND)[1:]
    assert np.abs(said - true).max() < 0.003 < 0.05 < np.abs(still - true).max()


def test_drag_turns_with_the_body_and_wind_does_not(tmp_path):
    drone = load_mjcf(
        written(tmp_path, DRONE.replace('timestep="0.001"', 'timestep="0.001" gravity="0 0 0"'))
    )
    turned = np.array(START)
    turn = Rotation.from_euler("zyx", [1.1, -0.3, 0.7])
    turned[3:7] = (turn * Rotation.from_quat(START[3:7], scalar_first=True)).as_quat(scalar_first=True)
    turned[7:10], turned[:3] = turn.apply(START[7:10]), turn.apply(START[:3])
    drag, nothing = LAWS[:-3], np.zeros((1, 200, 4))
    for laws, same in ((drag, True), (LAWS[-3:], False)):
        values = [{k: np.array([v]) for k, v in term.values.items()} for term in laws]
        one, other = (
            drone.rolled(laws, {}, values, s[None], nothing, np.array([1e-3]), np.zeros(1))[0, -1]
            for s in (START, turned)
        )
        assert np.allclose(turn.apply(one[7:10]), other[7:10], atol=1e-6) == same


def test_a_gate_lets_drag_act_where_it_is_open(tmp_path):
    drone = load_mjcf(written(tmp_path, DRONE))
    laws = [Term("viscous_friction", "base.surge", {"damping": 2.0}, Gate(region={"base.z": (5.0, 9.0)}))]
    how = START[None], np.full((1, 50, 4), 3.0), np.array([1e-3]), np.zeros(1)
    without, within = (drone.rolled(t, {}, [{"damping": np.array([2.0])}] * len(t), *how) for t in ((), laws))
    assert np.array_equal(without, within)


def recorded(folder, poses_only=False, seed=0, **world):
    """A drone that is tracked by its pose, flown about by a controller that sees what the recording shows."""
    rng, dt = np.random.default_rng(seed), 0.01
    truth = {"lin": 0.0 * LIN, "quad": 0.0 * QUAD, "wind": np.zeros(3), "mass": MASS} | world
    names = [f"base.{p}" for p in (POSE if poses_only else (*POSE, *TWIST))]
    rows = []
    for episode in range(3):
        state = np.array([0.0, 0.0, 1.0, 1.0, *np.zeros(9)])
        rates, phases = rng.uniform(0.2, 0.5, 4), rng.uniform(0.0, 6.0, 4)
        for k in range(400):
            read = state + rng.normal(size=13) * np.repeat([5e-4, 1e-3, 1e-2, 1e-2], [3, 4, 3, 3])
            wanted = np.sin(2 * np.pi * rates * k * dt + phases) * [0.8, 0.8, 0.3, 0.6]
            turn = Rotation.from_quat(read[3:7], scalar_first=True)
            push = 4.0 * (wanted[:3] + np.array([0, 0, 1]) - read[:3]) - 2.5 * read[7:10] + [0.0, 0.0, G]
            up = push / np.linalg.norm(push)
            side = np.cross(up, [np.cos(wanted[3]), np.sin(wanted[3]), 0.0])
            side /= np.linalg.norm(side)
            aim = Rotation.from_matrix(np.stack([np.cross(side, up), side, up], axis=1))
            torque = INERTIA * (-80.0 * (aim.inv() * turn).as_rotvec() - 14.0 * read[10:13])
            lift = MASS * push @ turn.as_matrix()[:, 2]
            thrust = np.clip(np.linalg.solve(MIX, [lift, *torque]), 0.0, 9.0)
            rows.append((episode, k * dt, *read[: len(names)], *thrust))
            for _ in range(4):  # Runge and Kutta's steps
                h, args = dt / 4, (thrust, truth["lin"], truth["quad"], truth["wind"], truth["mass"])
                k1 = newton(state, *args)
                k2 = newton(state + h / 2 * k1, *args)
                k3 = newton(state + h / 2 * k2, *args)
                k4 = newton(state + h * k3, *args)
                state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    folder.mkdir(exist_ok=True)
    units = dict(zip((f"base.{p}" for p in (*POSE, *TWIST)), UNITS, strict=True))
    text, thrusts = DRONE.replace('timestep="0.001"', 'timestep="0.005"'), {f"t{i}": "1" for i in range(4)}
    return logged(folder, text, rows, dt, {n: units[n] for n in names}, thrusts)


@pytest.mark.parametrize("poses_only", [pytest.param(False, marks=pytest.mark.slow), True])
def test_of_a_drone_mass_drag_and_wind_are_told(poses_only, tmp_path):
    lin, wind = np.array([0.25, 0.35, 0.0, 0.0, 0.0, 0.0]), np.array([0.4, -0.2, 0.0])
    folder = recorded(tmp_path / "log", poses_only, lin=lin, wind=wind, mass=1.12 * MASS)
    found = gpsim.diagnose(str(folder))
    assert found.verdict == "named"
    said = {
        (e.family, e.on): next(iter(e.parameters.values())) for e in found.effects if e.role == "headline"
    }
    true = {
        ("parameter_offset", "frame.mass"): 1.12,
        ("viscous_friction", "base.surge"): 0.25, ("viscous_friction", "base.sway"): 0.35,
        ("constant_force", "base.x"): 0.4, ("constant_force", "base.y"): -0.2,
    }  # fmt: skip
    assert set(said) == set(true)
    for claim, value in true.items():
        size = said[claim]
        assert size.low <= value <= size.high or size.value == pytest.approx(value, rel=0.1), claim


@pytest.mark.slow
def test_of_a_drone_that_lacks_nothing_nothing_is_told(tmp_path):
    assert gpsim.diagnose(str(recorded(tmp_path / "log"))).verdict == "none"


def test_speeds_follow_from_poses(tmp_path):
    floating = load_mjcf(written(tmp_path, FLOATING))
    t = np.linspace(0.0, 1.0, 2001)
    turn = Rotation.from_rotvec(t[:, None] * [0.0, 1.0, 0.0]) * Rotation.from_rotvec(
        2.0 * t[:, None] * [0, 0, 1]
    )
    columns = {f"root.q{c}": q for c, q in zip("wxyz", turn.as_quat(scalar_first=True).T, strict=True)}
    columns["root.x"] = np.sin(t)
    said = [
        floating.followed(f"root.{n}", columns, lambda path: np.gradient(path, t))
        for n in ("vx", "wx", "wy", "wz")
    ]
    true = [np.cos(t), np.sin(2 * t), np.cos(2 * t), np.full(len(t), 2.0)]
    for one, other in zip(said, true, strict=True):
        assert one[1:-1] == pytest.approx(other[1:-1], abs=1e-3)
    assert floating.followed("root.vy", columns, np.gradient) is None
    assert floating.followed("hip_dot", columns, np.gradient) is None


def test_states_and_accelerations_along_a_path_are_its_derivatives(tmp_path):
    floating = load_mjcf(written(tmp_path, FLOATING))
    t, h = np.array([0.3, 0.9]), 1e-4

    def turn(t):
        about = np.multiply.outer(t, [0.0, 0.0, 1.0])
        return Rotation.from_rotvec(np.multiply.outer(np.sin(t), [0.5, 1.0, -0.4])) * Rotation.from_rotvec(
            about
        )

    def path(t):
        """Positions in the order of the state's columns."""
        quat = turn(t).as_quat(scalar_first=True)
        of = dict(zip(POSE, [np.sin(t), t**2, np.cos(t), *quat.T], strict=True)) | {"hip": np.sin(3 * t)}
        return np.stack([of[floating.state.names[c].rpartition(".")[2]] for c in floating.positions], axis=1)

    slopes = np.stack(
        [path(t), (path(t + h) - path(t - h)) / (2 * h), (path(t + h) - 2 * path(t) + path(t - h)) / h**2]
    )
    state, rates = floating.motion(slopes)

    def spin(t):
        return (turn(t - h).inv() * turn(t + h)).as_rotvec() / (2 * h)

    where = floating.state.index
    assert state[:, [where(f"root.{w}") for w in TWIST[3:]]] == pytest.approx(spin(t), abs=1e-5)
    assert state[:, where("root.vy")] == pytest.approx(2 * t, abs=1e-6)
    rate = floating.rate.names.index
    assert rates[:, [rate(f"root.{w}_rate") for w in TWIST[3:]]] == pytest.approx(
        (spin(t + 1e-3) - spin(t - 1e-3)) / 2e-3, abs=1e-3
    )
    assert rates[:, rate("root.ay")] == pytest.approx(2.0, abs=1e-4)
    assert rates[:, rate("hip_acc")] == pytest.approx(-9 * np.sin(3 * t), abs=1e-4)


STANDING = """<mujoco><option timestep="0.002"/><worldbody><geom name="floor" type="plane" size="9 9 1"/>
<body name="trunk" pos="0 0 .3"><freejoint name="root"/><geom type="box" size=".1 .1 .02" mass="2"/>
<body name="one" pos=".1 0 0"><joint name="left" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02"/></body>
<body name="two" pos="-.1 0 0"><joint name="right" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02"/>
</body></body></worldbody>
<actuator><motor name="m1" joint="left"/><motor name="m2" joint="right"/></actuator></mujoco>"""


def test_what_touches_pushes_the_joints_that_carry_it(tmp_path):
    robot = load_mjcf(written(tmp_path, STANDING))
    state = np.tile(robot.rest_state, (4, 1))
    up, left, right = (robot.state.index(n) for n in ("root.z", "left", "right"))
    state[:, up], state[1, left], state[2, right] = 0.21, -1.2, 1.2
    state[3, up] = 1.0
    assert robot.hindered(state).tolist() == [[True, True], [False, True], [True, False], [False, False]]
    assert robot.stands(state[:3])
    assert not robot.stands(state[3:])
