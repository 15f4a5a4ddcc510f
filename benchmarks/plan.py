"""Which second recording decides what a first one left open: a plan, or what is usually played, each as long.

    python benchmarks/plan.py [WORLDS] [SEED] [SECONDS]

Each world is a slider on a spring with viscous friction, of a size drawn anew, whose force comes late by a delay or by
a lag of 30 to 80 ms. It is recorded for 40 s under slow waves; worlds whose verdict is `ambiguous` then are kept. Of
those a second recording is made by a plan of one piece, a chirp, a binary sequence, a random walk and a repeat of the
first, each of so many seconds, over the same range of forces. Both are diagnosed together. Resolved: `named`, rightly.
"""

from __future__ import annotations

import sys

import numpy as np
import pandas as pd

import gpsim
from gpsim.channels import FloatArray
from gpsim.recordings import Recording

DT, SUBSTEPS = 0.02, 10
REST = 1.0  # s after the only piece of a plan
UNITS = {"q": "m", "q_dot": "m/s", "force": "N"}
ASKED = {"only": ["viscous_friction", "spring", "actuator_delay", "actuator_lag"]}
BOX = 1.2  # m


def driven(force: FloatArray, world: dict[str, float | str], rng: np.random.Generator) -> Recording:
    """A recording of the world under forces that are commanded one a step."""
    h, late, size = DT / SUBSTEPS, float(world["late"]), float(world["size"])
    waiting, q, q_dot, acts, rows = [0.0] * round(late / h), 0.0, 0.0, 0.0, []
    for k, command in enumerate(force):
        rows.append((DT * k, q + rng.normal(0, 0.002), q_dot + rng.normal(0, 0.01), command))
        for _ in range(SUBSTEPS):
            if world["law"] == "actuator_delay":
                waiting.append(command)
                acts = waiting.pop(0)
            else:
                acts += h / late * (command - acts)
            q_dot += h * (acts - 0.8 * size * q_dot - size * q)
            q += h * q_dot
    frame = pd.DataFrame(rows, columns=["t", *UNITS])
    return gpsim.recording_from_frame(frame, UNITS, "slider")


def second_commands(
    diagnosis: gpsim.Diagnosis, first: FloatArray, seed: int, seconds: float
) -> dict[str, FloatArray]:
    """What to play next, by its name; all but the repeat over the range that was driven at first."""
    rng, largest = np.random.default_rng(seed), float(np.abs(first).max())
    t = DT * np.arange(round(seconds / DT))
    fade = np.clip(np.minimum(t, seconds - t) / 1.0, 0.0, 1.0)
    growth = np.log(50.0)
    chirp = np.sin(2 * np.pi * 0.1 * seconds / growth * (np.exp(growth * t / seconds) - 1.0))
    levels = np.repeat(rng.choice((-1.0, 1.0), len(t) // 10 + 1), 10)[: len(t)]
    walk = np.cumsum(rng.standard_normal(len(t)))
    plan = gpsim.plan(
        diagnosis,
        seconds / 60,
        box={"q": [-BOX, BOX], "q_dot": [-2, 2]},
        settings={"piece": seconds - REST, "settle": REST},
        seed=seed,
    )
    return {
        "plan": plan.commands[:, 0],
        "chirp": largest * fade * chirp,
        "binary sequence": largest * fade * levels,
        "random walk": largest * fade * walk / np.abs(walk).max(),
        "repeat": first[: len(t)],
    }


def main() -> None:
    wanted = int(sys.argv[1]) if len(sys.argv) > 1 else 4
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    seconds = float(sys.argv[3]) if len(sys.argv) > 3 else 3.0
    resolved: dict[str, list[bool]] = {}
    left, kept, number = 0, 0, 0
    t = 2 * np.pi * DT * np.arange(2001)
    while kept < wanted:
        number += 1
        rng = np.random.default_rng([seed, number])
        law = str(rng.choice(["actuator_delay", "actuator_lag"]))
        world = {
            "law": law,
            "late": round(float(rng.uniform(0.03, 0.08)), 3),
            "size": float(rng.uniform(0.8, 1.25)),
        }
        force = np.sin(0.25 * t + rng.uniform(0, 6)) + 0.5 * np.sin(0.1 * t + rng.uniform(0, 6))
        first = driven(force, world, rng)
        found = gpsim.diagnose(first, families=ASKED)
        print(f"world {number}: {law} {world['late']} s: {found.verdict}", flush=True)
        if found.verdict != "ambiguous":
            continue
        kept += 1
        for name, commands in second_commands(found, force, number, seconds).items():
            second = driven(commands, world, rng)
            left += name == "plan" and bool(np.abs(second.episodes[0].states[:, 0]).max() > BOX)
            both = gpsim.diagnose({"first": first, "second": second}, families=ASKED)
            right = both.verdict == "named" and law in {e.family for e in both.effects}
            resolved.setdefault(name, []).append(right)
            print(f"  {name}: {both.verdict}, {'right' if right else 'not resolved'}", flush=True)
    print(f"of {number} worlds {kept} were ambiguous; a plan left the box in {left}")
    for name, each in resolved.items():
        print(f"{name}: {sum(each)} of {len(each)} resolved")


if __name__ == "__main__":
    main()
