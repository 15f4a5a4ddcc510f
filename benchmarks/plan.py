"""Which second recording decides what a first one left open, without the search of a diagnosis: for tuning plans.

    python benchmarks/plan.py [--worlds 8] [--seed 1] [--first 1] [plan.KEY=VALUE ...]

The worlds are those of `gpsim prove --plan`. Instead of a diagnosis, every hidden effect is fitted in the place of the
true one; those within odds of ten of the best are what is left open. Where the truth is among them and another one,
the plan and what is usually played are compared as there: seconds until the right explanation leads by odds above ten.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.assessment import covariance
from gpsim.diagnosis.fitting import Hypothesis, Problem, fit, mean_squares
from gpsim.diagnosis.setup import PreparedProblem, candidates, prepare
from gpsim.errors import UsageError
from gpsim.posterior import Explanation, LeftOpen, visited_of
from gpsim.simulators import make_simulator
from gpsim.stages.plan import Asked, planned
from gpsim.trials.concealing import MINUTES, conceal
from gpsim.trials.drawing import HIDDEN, box_of
from gpsim.trials.figures import plan_figures
from gpsim.trials.plan_rivals import compared
from gpsim.trials.scoring_parts import score_plan_kinds
from gpsim.trials.worlds import FROM, World

TIE = np.log(10.0)


def explanations(world: World, question: PreparedProblem) -> list[Hypothesis]:
    """The true effects, and every other hidden one in the last one's place, to be fitted."""
    problem, simulator = question.everything, question.whole
    offers = {
        c.identity: c for c in candidates(question.recording, simulator, problem.parameters) if not c.variant
    }
    common = Hypothesis(scheme="fine")
    for effect in world.effects[:-1]:
        candidate = offers[effect.family, effect.on]
        common = common.plus(
            candidate.term([effect.values[p.name] for p in candidate.declared]), candidate.declared
        )
    found = []
    for (family, _), candidate in offers.items():
        if family in HIDDEN:
            starts = [p.starts[0] for p in candidate.declared]
            found.append(common.plus(candidate.term(starts), candidate.declared))
    return found


def left_open(world: World, question: PreparedProblem) -> LeftOpen:
    """What the first recording cannot tell apart."""
    problem: Problem = question.everything
    starts = problem.windows.measured[:, 0]
    fits = [fit(problem, hypothesis, starts, 20) for hypothesis in explanations(world, question)]
    noise = min((found.noise for found in fits), key=lambda noise: float(np.log(noise.white).sum()))
    fits = [fit(problem, found.hypothesis, found.starts, 20, noise) for found in fits]
    nats = np.array([-found.cost for found in fits])
    order = [int(i) for i in np.argsort(-nats) if nats[i] > nats.max() - TIE]
    weights = np.exp(nats[order] - nats.max())
    found = []
    for i, weight in zip(order, weights / weights.sum(), strict=True):
        matrix = covariance(problem, fits[i])
        half = 1.645 * np.sqrt(np.diag(matrix))
        ends = fits[i].hypothesis.theta[:, None] + np.outer(half, [-1.0, 1.0])
        found.append(Explanation(fits[i].hypothesis, float(weight), matrix, ends))
    best = fits[order[0]]
    tau = best.noise.times
    left = np.sqrt(mean_squares(problem, best.residuals))
    names = problem.simulator.state.names
    noise = dict(zip(names, (left * np.sqrt(tau)).tolist(), strict=True))
    kept = dict(zip(names, left.tolist(), strict=True))
    return LeftOpen(tuple(found), 0.9, noise, kept, visited_of(question))


def tried(seed: int, number: int, words: Sequence[str]) -> dict[str, object]:
    """The score of one world."""
    concealed = conceal(seed, number)
    world, recording = concealed.world, concealed.recordings[0]
    simulator = make_simulator(recording.system)
    question = prepare(replace(recording, held_out=None), simulator, simulator.defaults(recording.parameters))
    open_still = left_open(world, question)
    names = [
        " + ".join(f"{f} on {on}" for f, on in sorted(e.hypothesis.claims)) for e in open_still.explanations
    ]
    hidden = f"{world.effects[-1].family} {dict(world.effects[-1].values)}"
    print(
        f"world {number}: {world.system}, {world.noise_level} noise, {hidden}; open: {len(names)}", flush=True
    )
    second = None
    if len(names) > 1:
        plant = EffectsPlant(
            simulator,
            recording.parameters,
            open_still.explanations[0].hypothesis.terms,
            "fine",
            2,
            recording.dt,
        )
        section = {"box": box_of(world), **{k: float(v) for k, v in (word.split("=") for word in words)}}
        commands = None
        try:
            plan, _ = planned(open_still, plant, section, Asked(MINUTES, seed=number))
            commands = plan.commands
            print(
                "  "
                + "; ".join(
                    f"{p.nats:.1f} nats, fixed {[round(v * plan.minutes, 1) for v in p.fixed.values()]}"
                    for p in plan.pairs[:4]
                )
            )
        except UsageError as refused:
            print(f"  no plan: {refused}")
        second = compared(world, concealed.limits, recording, open_still, commands)
    kinds = score_plan_kinds(second)
    for kind, found in kinds.items():
        where = "never" if found["seconds"] is None else f"{found['seconds']:.2f} s"
        print(
            f"  {kind}: {where}, {found['nats']:.1f} nats{', left the box' if found['left'] else ''}",
            flush=True,
        )
    counts = any(k["seconds"] is not None for k in kinds.values())
    return {
        "trial": number, "verdict": "", "open": len(names) > 1, "listed": bool(kinds), "counts": counts,
        "kinds": kinds, "right": not counts or kinds["plan"]["seconds"] is not None,
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--worlds", type=int, default=8)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=1, help="number of the first world")
    parser.add_argument("words", nargs="*", help="settings of the plan, as piece=4")
    given = parser.parse_args()
    numbers = range(FROM["plans"] + given.first, FROM["plans"] + given.first + given.worlds)
    found = plan_figures([tried(given.seed, number, given.words) for number in numbers])
    print(f"{found['drawn']} worlds, {found['open']} left open, {found['n']} that something resolves")
    for kind, each in found["kinds"].items():
        print(
            f"{kind}: {each['resolved']} of {each['n']}, {each['median_seconds']:.3g} s, left the box {each['left']}"
        )


if __name__ == "__main__":
    main()
