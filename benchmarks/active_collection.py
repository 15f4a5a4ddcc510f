"""One-step error and return against the number of transitions, driven actively, by policy or at random.

python benchmarks/active_collection.py [--experiment cartpole] [--transitions 250 500 1000 2000] [--seeds 1]
    [--strategies active source random] [--train STEPS] [--runs DIR] [KEY=VALUE ...]

Every row is a recording of that many transitions of the stand-in and the Gaussian processes that `fit-gp` conditions on
it, or on gp.n_train of it. NRMSE is the mean over the rates, over the range of the residual, on fresh episodes that
nothing was learnt from: driven at random, and by the source policy where one was trained. --train: steps of the source
policy and of one in the corrected simulator (prediction=mean), whose mean return on the target is printed; the strategy
`target` is a policy that was trained in the target itself for as long: how much of a difference is training's own.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import tempfile

import numpy as np
from gpsim.cli.configuration import resolve

from gpsim.artifacts import Artifact
from gpsim.corrected import GpCorrection
from gpsim.environments import collect_episodes, policy_actor, random_actor
from gpsim.evaluation import episode_returns, nrmse
from gpsim.residuals import Residuals
from gpsim.stages import build_residuals as residual_stage
from gpsim.stages import certify, collect, fit_gp, train_gp_policy, train_source
from gpsim.stages.building import base_plant, make_task, residuals_of, target_plant
from gpsim.stages.policy_files import read_policy
from gpsim.stages.stage import Request
from gpsim.stages.train_gp_policy import corrected_plant


def fresh(request: Request, by_policy: bool) -> Residuals:
    base, rng = base_plant(request.config), np.random.default_rng(12345)
    task = make_task(request.config).on_target()
    act = random_actor(task, rng)
    if by_policy:
        policy = train_source.STAGE.make(request.having(variant="source"))[0]
        act = policy_actor(read_policy(policy.path), rng)
    episodes = collect_episodes(target_plant(request.config), task, act, 40, rng)
    return residuals_of(base, episodes, rng)


def error(request: Request, data: Residuals) -> float:
    correction = corrected_plant(
        request.having(prediction="mean"), fit_gp.STAGE.need(request).path
    ).correction
    assert isinstance(correction, GpCorrection)
    predicted = correction.predictor.mean(correction.features(data.inputs))
    return float(np.mean([nrmse(predicted[:, i], data.values[:, i]) for i in range(predicted.shape[1])]))


def mean_return(request: Request, policy: Artifact) -> float:
    task, start = make_task(request.config).on_target(), certify.evaluation_starts(request)
    act = policy_actor(read_policy(policy.path))
    returns = episode_returns(target_plant(request.config), task, act, start, np.random.default_rng(0))
    return float(returns.mean())


def trained_return(request: Request) -> float:
    """What a policy earns that was trained in the corrected simulator."""
    policy, _ = train_gp_policy.STAGE.make(request.having(correction="gp", prediction="mean"))
    return mean_return(request, policy)


def row(request: Request, strategy: str, data: list[Residuals], train: bool) -> list[str]:
    """Errors on each of `data`, and what the policy earns."""
    if strategy == "target":
        return [
            "-",
            "-",
            f"{mean_return(request, train_source.STAGE.make(request.having(variant='target'))[0]):.0f}",
        ]
    if strategy == "source":
        train_source.STAGE.make(request.having(variant="source"))
    for stage in (collect.STAGE, residual_stage.STAGE, fit_gp.STAGE):
        stage.make(request)
    errors = [f"{100 * error(request, part):.2f} %" for part in data]
    if not train:
        return [*errors, "-"]
    return [*errors, f"{trained_return(request):.0f}"]


def words_of(strategy: str, count: int) -> list[str]:
    if strategy == "active":
        return ["strategy=active", f"active.transitions={count}"]
    # Episodes at random last some twenty steps on the cart-pole: so many that there are transitions enough.
    if strategy == "target":
        return []
    return [
        f"collect.policy={strategy}",
        f"collect.transitions={count}",
        f"collect.episodes={max(20, count // 8)}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--experiment", default="cartpole")
    parser.add_argument("--transitions", type=int, nargs="+", default=[250, 500, 1000, 2000])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--strategies", nargs="+", default=["active", "source", "random"])
    parser.add_argument("--train", type=int, default=0)
    parser.add_argument("--runs")
    parser.add_argument("words", nargs="*")
    given = parser.parse_args()
    runs = given.runs or tempfile.mkdtemp()
    by_policy = "source" in given.strategies
    print("| strategy | transitions | seed | NRMSE, random | NRMSE, policy | return |")
    print("|---|---|---|---|---|---|")
    for seed in range(given.seeds):
        common = [f"experiment={given.experiment}", f"runs_dir={runs}", f"seed={seed}", *given.words]
        data = None
        for strategy in given.strategies:
            for count in given.transitions:
                trained = [f"policy.total_steps={given.train}"] if given.train else []
                words = (*common, *words_of(strategy, count), "residuals.test_fraction=0", *trained)
                request = Request(resolve(list(words), None), words)
                data = data or [fresh(request, False), *([fresh(request, True)] if by_policy else [])]
                cells = row(request, strategy, data, bool(given.train))
                if len(data) == 1 and strategy != "target":
                    cells.insert(1, "-")
                print(f"| {strategy} | {count} | {seed} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
