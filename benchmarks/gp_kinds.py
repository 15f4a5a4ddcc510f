"""One-step error of gp=jump, gp=chained and gp=observations at several levels of sensor noise.

python benchmarks/gp_kinds.py [--experiment cartpole] [--kinds jump chained observations] [--noise 0 0.01 0.03 0.1]
    [--missing 0.1] [--transitions 1500] [--seeds 1] [--train STEPS] [--runs DIR] [KEY=VALUE ...]

Every recording is of the stand-in driven at random, with Gaussian noise of that share of each channel's spread and,
where there is noise, that share of the samples lost. NRMSE is that of the processes' mean, over the range of the
residual, on the true states of fresh episodes at random, rate by rate. --train: steps of a policy in the corrected
simulator (prediction=mean), whose mean return on the target is printed.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import tempfile

from active_collection import fresh, trained_return
from gpsim.cli.configuration import resolve

from gpsim.corrected import GpCorrection
from gpsim.errors import UsageError
from gpsim.evaluation import nrmse
from gpsim.residuals import Residuals
from gpsim.stages import build_residuals as residual_stage
from gpsim.stages import collect, fit_gp
from gpsim.stages.stage import Request
from gpsim.stages.train_gp_policy import corrected_plant


def errors(request: Request, data: Residuals) -> list[float]:
    correction = corrected_plant(
        request.having(prediction="mean"), fit_gp.STAGE.need(request).path
    ).correction
    assert isinstance(correction, GpCorrection)
    predicted = correction.predictor.mean(correction.features(data.inputs))
    return [nrmse(predicted[:, i], data.values[:, i]) for i in range(predicted.shape[1])]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--experiment", default="cartpole")
    parser.add_argument("--kinds", nargs="+", default=["jump", "chained", "observations"])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.01, 0.03, 0.1])
    parser.add_argument("--missing", type=float, default=0.1)
    parser.add_argument("--transitions", type=int, default=1500)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--train", type=int, default=0)
    parser.add_argument("--runs")
    parser.add_argument("words", nargs="*")
    given = parser.parse_args()
    runs, data = given.runs or tempfile.mkdtemp(), None
    print("| noise | gp | seed | NRMSE of each rate | return |")
    print("|---|---|---|---|---|")
    for seed in range(given.seeds):
        for noise in given.noise:
            for kind in given.kinds:
                words = (
                    f"experiment={given.experiment}", f"runs_dir={runs}", f"seed={seed}", f"gp={kind}",
                    "collect.policy=random", f"collect.episodes={max(20, given.transitions // 8)}",
                    f"collect.transitions={given.transitions}", f"collect.noise={noise}",
                    f"collect.missing={given.missing if noise else 0}", "residuals.test_fraction=0", *given.words,
                    *([f"policy.total_steps={given.train}"] if given.train else []),
                )  # fmt: skip
                request = Request(resolve(list(words), None), words)
                data = data or fresh(request, False)
                try:
                    for stage in (collect.STAGE, residual_stage.STAGE, fit_gp.STAGE):
                        stage.make(request)
                except UsageError as error:
                    print(f"| {noise:g} | {kind} | {seed} | {error} | - |", flush=True)
                    continue
                said = ", ".join(f"{100 * e:.2f} %" for e in errors(request, data))
                earned = f"{trained_return(request):.0f}" if given.train else "-"
                print(f"| {noise:g} | {kind} | {seed} | {said} | {earned} |", flush=True)


if __name__ == "__main__":
    main()
