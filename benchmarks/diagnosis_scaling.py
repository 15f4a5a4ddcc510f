"""What a diagnosis costs, from a thousand to a million transitions.

    python benchmarks/diagnosis_scaling.py [--most 1000000] [--cores 2] [--hidden]

A cart-pole with Coulomb friction that the simulator leaves out is driven by a noisy controller and measured with noise;
with --hidden a slider with viscous friction whose speed nobody measured, a system of the user's own. `gpsim diagnose`
runs as a process of its own. Printed: transitions, wall and processor seconds, peak memory of the
largest process, and what was said.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from gpsim.channels import Channels
from gpsim.diagnosis import Diagnosis
from gpsim.recordings import Episode, Recording, write_recording
from gpsim.simulators import make_simulator
from gpsim.targets import FrictionCartPole

STEPS, DT, FRICTION = 500, 0.02, 0.3
NOISE = {"x": 0.0005, "x_dot": 0.005, "theta": 0.001, "theta_dot": 0.01}
GAINS = np.array([1.0, 2.5, 32.0, 6.0])
GPSIM = Path(sys.executable).with_name("gpsim")


def record(transitions: int, rng: np.random.Generator) -> Recording:
    """Episodes of 500 transitions, all stepped at once; steps of 100 with fewer than 5 of them."""
    simulator = make_simulator("cartpole")
    steps = min(STEPS, transitions // 10)
    count = max(transitions // steps, 1)
    target = FrictionCartPole(simulator.defaults(), FRICTION, DT, "stick", substeps=400)
    state, states, actions = rng.normal(size=(count, 4)) * [0.3, 0.3, 0.05, 0.1], [], []
    level = np.zeros((count, 1))
    for k in range(steps + 1):
        states.append(state + rng.normal(size=state.shape) * list(NOISE.values()))
        if k % 10 == 0:
            level = rng.uniform(-9, 9, (count, 1))
        action = np.clip(level + state @ GAINS[:, None], -14, 14)
        if k < steps:
            actions.append(action)
            state = target.step(state, action, {}, rng)
    y, u, t = np.stack(states, axis=1), np.stack(actions, axis=1), DT * np.arange(steps + 1)
    episodes = tuple(Episode(str(i), t, y[i], u[i]) for i in range(count))
    channels = (simulator.state, simulator.action)
    return Recording(
        "cartpole", *channels, episodes, DT, simulator.defaults(), velocities="measured", noise=NOISE
    )


SLIDER = """
class Slider:
    state = {"q": "m", "q_dot": "m/s"}
    action = {"force": "N"}
    parameters = {"mass": ("kg", 2.0, 0.1, 10.0)}
    coordinates = {"q": "q_dot"}
    force_units = {"q": "N"}
    start = {"q_dot": 0.0}

    def rates(self, state, action, p, forces):
        return {"q_dot": (action["force"] + forces["q"]) / p["mass"]}
"""
MASS, DAMPING, FAR = 2.0, 1.5, 0.5  # FAR: m to either side, where the drive turns round


def hidden_speed(transitions: int, rng: np.random.Generator) -> Recording:
    """Positions of a slider that is driven to and fro; its motion between two samples is exact."""
    steps = min(STEPS, transitions // 10)
    count = max(transitions // steps, 1)
    q, v, seen, pushed = 0.1 * rng.normal(size=count), np.zeros(count), [], []
    rate, level = DAMPING / MASS, np.zeros(count)
    decay = np.exp(-rate * DT)
    for k in range(steps + 1):
        seen.append(q + 0.0005 * rng.normal(size=count))
        if k % 10 == 0:
            level = np.where(np.abs(q) > FAR, -np.sign(q) * np.abs(level), rng.uniform(-4, 4, count))
        if k < steps:
            pushed.append(level)
            end = level / DAMPING
            q, v = q + end * DT + (v - end) * (1 - decay) / rate, end + (v - end) * decay
    y, u, t = (
        np.stack(seen, axis=1)[..., None],
        np.stack(pushed, axis=1)[..., None],
        DT * np.arange(steps + 1),
    )
    episodes = tuple(Episode(str(i), t, y[i], u[i]) for i in range(count))
    channels = Channels.of({"q": "m"}), Channels.of({"force": "N"})
    return Recording("slider", *channels, episodes, DT, {"mass": MASS}, noise={"q": 0.0005})


def main() -> None:
    """Print the curve."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--most", type=int, default=1_000_000)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--hidden", action="store_true")
    arguments = parser.parse_args()
    make = hidden_speed if arguments.hidden else record
    print("| transitions | wall s | processor s | peak MB | said |\n|---|---|---|---|---|")
    for transitions in (n for n in (1_000, 10_000, 100_000, 1_000_000) if n <= arguments.most):
        with tempfile.TemporaryDirectory() as temporary:
            folder, out = Path(temporary) / "recording", Path(temporary) / "out"
            folder.mkdir()
            own = Path(temporary) / "own.py"
            own.write_text(SLIDER)
            write_recording(make(transitions, np.random.default_rng(transitions)), folder, "parquet")
            before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
            words = [str(GPSIM), "diagnose", str(folder), "--out", str(out), "--cores", str(arguments.cores)]
            words += ["--simulator", f"{own}:Slider"] if arguments.hidden else []
            subprocess.run(words, check=True, capture_output=True)
            wall, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
            found = Diagnosis.from_dict(json.loads((out / "diagnosis.json").read_text(encoding="utf-8")))
        spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        said = [
            f"{e.family} on {e.place} "
            + ", ".join(f"{k} {v.value:.4g} [{v.low:.4g}, {v.high:.4g}]" for k, v in e.parameters.items())
            for e in found.effects
        ]
        peak, told = after.ru_maxrss / 1024, f"{found.verdict}: {'; '.join(said)}"
        print(f"| {transitions} | {wall:.1f} | {spent:.1f} | {peak:.0f} | {told} |", flush=True)


if __name__ == "__main__":
    main()
