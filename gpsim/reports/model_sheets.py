"""The sheets of the model: one-step errors, calibration, rollouts, fits; and what was run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gpsim.evaluation import coverage_warnings
from gpsim.reports.loop_report import LoopReport, OneStepFigure, printed_one_step
from gpsim.reports.sheets import (
    MISSING,
    Cell,
    Sheet,
    coefficient,
    known,
    percent,
    row,
    significant,
    unit,
    whole_percent,
    with_unit,
)

DATA = {"one_step": "policy's own data", "one_step_random": "random actions"}
"""The two drivers of the target on whose transitions one step is scored, by their key in summary.json."""


def data_of(report: LoopReport) -> dict[str, str]:
    """The data that one step was scored on, in words, by their key in summary.json."""
    recorded = report.summary.get("judged_on")
    return {"one_step": str(recorded).partition(":")[0]} if recorded else DATA


def rates(report: LoopReport) -> list[str]:
    """The rates that one step was scored for, in order."""
    found: dict[str, None] = {}
    for key in data_of(report):
        found |= {
            name: None
            for name, scores in (report.summary.get(key) or {}).items()
            if isinstance(scores, Mapping)
        }
    return list(found)


def scores(report: LoopReport, key: str, rate: str) -> Mapping[str, Any]:
    """The scores of a rate on one driver's data; empty where there are none."""
    found = (report.summary.get(key) or {}).get(rate)
    return found if isinstance(found, Mapping) else {}


def one_step_sheet(report: LoopReport) -> Sheet:
    """NRMSE and R2 of mean and sample on both drivers' data, beside the thesis's where the experiment is one of its."""
    printed = printed_one_step(report.experiment, report.system)
    columns = ["Rate", "Prediction", *(["Thesis NRMSE", "Thesis R²"] if printed else [])]
    for words in data_of(report).values():
        columns += [f"NRMSE, {words}", "R²"]
    rows = []
    for rate in rates(report):
        for prediction in ("mean", "sample"):
            cells = [with_unit(rate, report.units), prediction]
            cells += _thesis(printed.get(rate, {}).get(prediction)) if printed else []
            for key in data_of(report):
                errors = scores(report, key, rate).get(prediction) or {}
                cells += [_nrmse(errors), coefficient(errors.get("r2"))]
            rows.append(row(*cells))
    note = (
        "NRMSE: root mean square error over the pooled range (max - min) of the residual; ± is the standard "
        "deviation over episodes." + _averaged(report) + _outside(report)
    )
    return Sheet(
        "One step: the correction's error on target transitions", tuple(columns), tuple(rows), 2, note
    )


def _outside(report: LoopReport) -> str:
    """How much of what was visited lies where the GPs were taught nothing."""
    shares = report.summary.get("outside_recording") or {}
    words = {"policy": "the source policy's", "random": "random", "deployed": "the deployed GP policy's"}
    said = [
        f"{whole_percent(share)} of {words.get(name, name)}" for name, share in shares.items() if known(share)
    ]
    return f" Transitions outside the range of the GPs' training rows: {', '.join(said)}." if said else ""


def _averaged(report: LoopReport) -> str:
    return " Averages over the seeds' GPs." if len(report.seeds) > 1 else ""


def calibration_sheet(report: LoopReport) -> Sheet:
    """Covered shares, likelihood and predicted spread of the GPs' one-step distributions."""
    levels = coverage_levels(report)
    columns = [
        "Rate",
        "Data",
        *(f"in its {float(level):.0%} interval".replace("%", " %") for level in levels),
    ]
    columns += ["Predicted std", "Error (rms)", "Negative log likelihood"]
    rows = []
    for rate in rates(report):
        for key, words in data_of(report).items():
            found = scores(report, key, rate)
            if not found:
                continue
            covered = found.get("coverage") or {}
            cells = [with_unit(rate, report.units), words]
            cells += [whole_percent(covered.get(level)) for level in levels]
            cells += [
                significant(found.get("predicted_std")),
                significant((found.get("mean") or {}).get("rmse")),
            ]
            rows.append(row(*cells, significant(found.get("negative_log_likelihood"))))
    note = "Below the nominal share the GP is too sure of itself, above it too cautious." + _averaged(report)
    return Sheet(
        "Calibration: how often the target lies in the predicted interval",
        tuple(columns),
        tuple(rows),
        2,
        note,
    )


def coverage_levels(report: LoopReport) -> list[str]:
    """The nominal levels that were scored, ascending, as they are keyed."""
    levels = {
        level
        for key in data_of(report)
        for rate in rates(report)
        for level in (scores(report, key, rate).get("coverage") or {})
    }
    return sorted(levels, key=float)


def rollout_simulators(report: LoopReport) -> dict[str, Mapping[str, Any]]:
    """Simulator to its divergence from the target."""
    rollout = report.summary.get("rollout") or {}
    return {name: found for name, found in rollout.items() if isinstance(found, Mapping) and "rms" in found}


def rollout_sheet(report: LoopReport) -> Sheet:
    """Root mean square distance to the target's rollouts, per channel."""
    simulators = rollout_simulators(report)
    channels = list(dict.fromkeys(channel for found in simulators.values() for channel in found["rms"]))
    rows = [
        row(Cell(name, name=name), *(significant(found["rms"].get(channel)) for channel in channels))
        for name, found in simulators.items()
    ]
    rollout = report.summary.get("rollout") or {}
    count, horizon = rollout.get("rollouts"), rollout.get("horizon_s")
    title = "Rollouts: root mean square distance to the target"
    if known(count) and known(horizon):
        actions = "recorded" if report.summary.get("judged_on") else "random"
        title += f", {count} rollouts of {horizon:g} s under the same {actions} actions"
    return Sheet(
        title,
        ("Simulator", *(with_unit(name, report.units) for name in channels)),
        tuple(rows),
        note=" ".join([_averaged(report).strip(), *_runaways(simulators)]).strip(),
    )


def _runaways(simulators: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """What a mean over infinity cannot say."""
    return [
        f"{name}: {_rollouts(found['not_finite'])} ceased to be finite, and count as infinitely far."
        for name, found in simulators.items()
        if known(found.get("not_finite")) and found["not_finite"]
    ]


def _rollouts(count: float) -> str:
    """A count, or its average over the seeds."""
    if count == 1:
        return "1 rollout"
    return f"{count:.0f} rollouts" if float(count).is_integer() else f"{count:.1f} rollouts a seed"


def fit_sheet(report: LoopReport) -> Sheet:
    """What each fit says of itself."""
    columns = (
        "Seed", "Rate", "Outcome", "Rows", "Log likelihood", "at the start",
        "Noise std", "Noise std, standardised", "Signal std, standardised", "Evaluations",
    )  # fmt: skip
    rows = []
    for seed, rate, fit in fits(report):
        standard, original = fit.get("hyper_parameters") or {}, fit.get("hyper_parameters_original") or {}
        outcome = str(fit.get("outcome", MISSING)).replace("_", " ")
        rate_unit = unit(report.units.get(rate, ""))
        rows.append(
            row(
                str(seed),
                rate,
                Cell(outcome, marked=fit.get("converged") is False, title=str(fit.get("advice", ""))),
                str(fit.get("rows", MISSING)),
                significant(fit.get("log_marginal_likelihood"), 4),
                significant(fit.get("initial_log_marginal_likelihood"), 4),
                f"{significant(original.get('noise_std'))} {rate_unit}".strip(),
                significant(standard.get("noise_std")),
                significant(standard.get("signal_std")),
                str(fit.get("evaluations", MISSING)),
            )
        )
    note = "Log marginal likelihood of the standardised residuals, in natural logarithms."
    return Sheet("Fits: one Gaussian process per rate", columns, tuple(rows), 3, note)


def scale_sheet(report: LoopReport) -> Sheet:
    """Length scale and linear weight of every input, standardised, of every fit."""
    columns: dict[str, None] = {name: None for fit in report.fits.values() for name in fit.get("inputs", ())}
    rows = []
    for seed, rate, fit in fits(report):
        hyper, names = fit.get("hyper_parameters") or {}, report.fits[seed].get("inputs", ())
        for words, key in (("length scale", "lengthscales"), ("linear std", "linear_stds")):
            values = dict(zip(names, hyper.get(key) or (), strict=False))
            rows.append(row(str(seed), rate, words, *(significant(values.get(name)) for name in columns)))
    note = (
        "Standardised inputs. A length scale far above 1: the smooth part ignores the input; "
        "a linear std near 0: so does the linear part."
    )
    return Sheet("Hyper-parameters per input", ("Seed", "Rate", "", *columns), tuple(rows), 3, note)


def fits(report: LoopReport) -> Iterator[tuple[int, str, Mapping[str, Any]]]:
    """(seed, rate, report of the fit)."""
    for seed, fit in report.fits.items():
        for rate, found in (fit.get("rates") or {}).items():
            yield seed, rate, found


def gp_warnings(report: LoopReport) -> list[str]:
    """What the fits and the coverage of the recordings warn of, each once, with the seeds that gave it."""
    seeds: dict[str, list[int]] = {}
    for seed, fit in report.fits.items():
        for text in fit.get("warnings") or ():
            seeds.setdefault(str(text), []).append(seed)
    for seed, outside in report.outside.items():
        for text in coverage_warnings(outside):
            seeds.setdefault(text, []).append(seed)
    if len(report.seeds) < 2:
        return list(seeds)
    return [
        f"{text} (seeds {', '.join(map(str, found))})" if len(found) > 1 else f"{text} (seed {found[0]})"
        for text, found in seeds.items()
    ]


def _thesis(figure: OneStepFigure | None) -> tuple[str, str]:
    if figure is None:
        return MISSING, MISSING
    r2 = f"{figure.r2.mean} ± {figure.r2.std}" if figure.r2 else MISSING
    return f"{figure.nrmse.mean} ± {figure.nrmse.std} %", r2


def _nrmse(errors: Mapping[str, Any]) -> str:
    value, spread = errors.get("nrmse"), errors.get("nrmse_std")
    if not (known(value) and known(spread)):
        return percent(value)
    text = percent(value).removesuffix(" %")
    decimals = len(text.partition(".")[2])
    return f"{text} ± {100.0 * spread:.{decimals}f} %"
