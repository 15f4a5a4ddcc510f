"""Whole machines: what is drawn, what truly moves against equations written down by hand, and what is written."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gpsim.recordings import read_recording
from gpsim.stages import prove
from gpsim.trials import blinding
from gpsim.trials.blinding import ANSWER, PRIVATE, PUBLIC, recording_folders, write_trial
from gpsim.trials.driving import FREE
from gpsim.trials.machines import (
    ARM,
    FEWEST,
    KINDS,
    MOST,
    PARTS,
    Sizes,
    kind_of,
    parts_of,
)
from gpsim.trials.truth import run
from gpsim.trials.worlds import FROM, SYSTEMS, Machine, TrueEffect

from .outside_worlds import BOB, CART, world_of

SEED, CAR = 77, FROM["machines"] + 4
NOMINAL = {"slider": {"mass": 2.0}, "cartpole": CART, "pendulum": BOB, "unicycle": {}}

# What is drawn


@pytest.mark.parametrize("kind", PARTS)
def test_a_machine_has_four_to_eight_effects_that_do_not_exclude_each_other(kind):
    system, parts = PARTS[kind]
    groups = {(p.family, p.on): p.group for p in parts}
    known = {*SYSTEMS[system].names, *SYSTEMS[system].action, *SYSTEMS[system].parameters, "vehicle", "pose"}
    for seed in range(30):
        made = parts_of(kind, Sizes(np.random.default_rng(seed), NOMINAL[system], 0.01))
        assert FEWEST <= len(made) <= MOST
        taken = [groups[e.family, e.on] for e in made if groups[e.family, e.on]]
        assert len(taken) == len(set(taken))
        assert {e.on for e in made} <= known
        assert all(np.isfinite(list(e.values.values())).all() for e in made)


@pytest.mark.parametrize(
    ("found", "kinds"),
    [
        (("mujoco", "example-robot-data"), ["axis", "rig", "servo", "car", "arm", "axis"]),
        (("mujoco",), ["axis", "rig", "servo", "car", "axis", "rig"]),
        ((), ["axis", "rig", "servo", "car", "axis", "rig"]),
    ],
)
def test_numbers_of_machines_follow_the_others_and_have_arms_where_their_models_are(
    found, kinds, monkeypatch
):
    there = [SimpleNamespace(metadata={"Name": name}) for name in found]
    monkeypatch.setattr(prove.importlib.metadata, "distributions", lambda: there)
    numbers = prove.numbers_of(2, rough=1, machines=6)
    assert numbers[:3] == [1, 2, 100_001]
    assert [kind_of(n) for n in numbers[3:]] == kinds
    assert (KINDS[-1], FROM["machines"] + 1) == (ARM, numbers[3])


# How it is driven


# What truly moves


def test_a_servo_moves_as_its_equation_says():
    """m' l^2 a = g u - b v + F - m' G l sin(q), with a lag before it; m' = 1.3 m, the command held for a sample."""
    k = {"gain": 0.8, "ratio": 1.3, "damping": 0.15, "force": 0.2, "lag": 0.02}
    effects = (
        TrueEffect("actuator_gain", "torque", {"gain": k["gain"]}),
        TrueEffect("parameter_offset", "mass", {"ratio": k["ratio"]}),
        TrueEffect("viscous_friction", "theta", {"damping": k["damping"]}),
        TrueEffect("constant_force", "theta", {"force": k["force"]}),
        TrueEffect("actuator_lag", "torque", {"time_constant": k["lag"]}),
    )
    world = world_of(
        "pendulum", effects, excitation="multisine", dt=0.01, steps=200, episodes=1, parameters=BOB,
        machine=Machine("servo", False, ()),
    )  # fmt: skip
    ran = run(world, effects)
    mass, length = k["ratio"] * BOB["mass"], BOB["length"]

    def rates(_, y, u):
        q, v, acting = y
        torque = acting - k["damping"] * v + k["force"] - mass * BOB["gravity"] * length * np.sin(q)
        return [v, torque / (mass * length**2), (k["gain"] * u - acting) / k["lag"]]

    y, seen = np.array([*ran.fine[0, 0], 0.0]), []
    for u in ran.commands[:, 0, 0]:
        y = solve_ivp(rates, (0, world.dt), y, args=(u,), rtol=1e-9, atol=1e-11).y[:, -1]
        seen.append(y[:2])
    seen = np.array(seen)
    assert np.abs(ran.sampled[1:, 0] - seen).max() < 1e-5 * np.abs(seen).max()


def test_a_rig_that_swings_freely_loses_what_its_frictions_take():
    cart, viscous, pivot = 0.4, 0.8, 0.01
    effects = (
        TrueEffect("coulomb_friction", "x", {"force": cart}),
        TrueEffect("viscous_friction", "x", {"damping": viscous}),
        TrueEffect("viscous_friction", "theta", {"damping": pivot}),
    )
    world = world_of(
        "cartpole", effects, excitation=FREE, posture="hanging", dt=0.01, steps=300, parameters=CART
    )
    ran = run(world, effects)
    _, v, q, w = np.moveaxis(ran.fine, 2, 0)
    m, half, total = CART["pole_mass"], CART["pole_half_length"], CART["cart_mass"] + CART["pole_mass"]
    energy = 0.5 * total * v**2 + m * half * v * w * np.cos(q) + 2 / 3 * m * half**2 * w**2
    energy = energy + m * CART["gravity"] * half * np.cos(q)
    taken = cart * np.abs(v) + viscous * v**2 + pivot * w**2
    lost = np.trapezoid(taken, dx=ran.h, axis=0)
    assert lost.max() > 0.2
    np.testing.assert_allclose(energy[0] - energy[-1], lost, rtol=2e-3, atol=1e-5)
    assert np.diff(energy, axis=0).max() < 1e-9


# What is written


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    out = tmp_path_factory.mktemp("proof")
    name = write_trial(out, SEED, CAR) and str(CAR)
    return out / PUBLIC / name, json.loads((out / PRIVATE / name / ANSWER).read_text())


def test_a_machine_is_published_in_folders_of_recordings(written):
    public, answer = written
    sessions = answer["world"]["machine"]["sessions"]
    folders = recording_folders(public)
    assert [f.name for f in folders] == [str(i) for i in range(1, len(sessions) + 1)]
    assert {p.name for p in public.iterdir()} == {f.name for f in folders}
    recordings = [read_recording(f) for f in folders]
    assert sum(r.transition_count for r in recordings) == answer["transitions"]
    assert all(r.system == "unicycle" for r in recordings)


def test_the_answer_has_effects_that_count_and_small_nuisances(written):
    _, answer = written
    own = [e for e in answer["effects"] if not e["outside"]]
    assert FEWEST <= len(own) <= MOST
    assert sum(e["share"] >= 0.05 for e in own) >= 2
    assert sum(e["share"] >= 0.01 or e["beyond"] >= 1.0 for e in own) >= 4
    assert all(0.005 <= e["share"] <= 0.08 for e in answer["effects"] if e["outside"])
    assert answer["machine"]["explained"] > 0.8
    assert answer["stratum"] == "machines"


def test_a_diagnosis_gets_all_recordings_of_a_machine(tmp_path, monkeypatch):
    for name in "12":
        folder = tmp_path / PUBLIC / "300001" / name
        folder.mkdir(parents=True)
        (folder / "recording.yaml").touch()
    blinding.publish_hashes(tmp_path, {"300001": "0" * 64})
    monkeypatch.setattr(blinding, "COMMAND", "import sys; sys.exit(' '.join(sys.argv[1:]))")
    said = blinding.diagnose_blind(tmp_path, "300001")["error"]
    assert said.startswith("diagnose recording/1 recording/2 --out")


# Arms
