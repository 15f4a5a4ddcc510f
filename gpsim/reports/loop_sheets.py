"""The sheets of a loop: returns, goals reached, one-step errors, calibration, rollouts, fits; and its headline."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gpsim.evaluation import coverage_warnings
from gpsim.reports import sheets
from gpsim.reports.loop_report import ALL, LoopReport
from gpsim.reports.sheets import (
    MISSING,
    Cell,
    Sheet,
    fixed,
    known,
    percent,
    sheet,
    significant,
    whole_percent,
    with_unit,
)

SHORT = 0.9
"""A seed falls short when its mean is below this share of the best seed's, of any policy, on the same starts."""
EXPECTED_TO_SUCCEED = ("GP-Mean", "GP-Sample", "Effects", "Target")
"""The others fall short by design: they know nothing of what the simulator lacks."""
CORRECTED = ("GP-Sample", "Effects", "GP-Mean")
"""Policies trained in a corrected simulator, the one to name first first."""
WORDS = {
    "Source": "trained in the plain simulator",
    "Target": "trained on the target itself, the reachable optimum",
    "GP-Mean": "trained in the simulator corrected by the GP's mean",
    "GP-Sample": "trained in the simulator corrected by samples of the GP",
    "Effects": "trained in the simulator corrected by named effects",
}
DATA = {"one_step": "policy's own data", "one_step_random": "random actions"}
"""The two drivers of the target on whose transitions one step is scored, by their key in summary.json."""
DRIVERS = {"policy": "the source policy's", "random": "random", "deployed": "the deployed GP policy's"}
Stats = Mapping[str, Any]
Column = tuple[str, Callable[[str, Stats], Cell | str]]
"""The head of a column, and its cell of a policy and what is known of that."""


def return_sheets(report: LoopReport) -> list[Sheet]:
    """A sheet for every set of starts that the summary holds."""
    return [_returns(report, key) for key in report.set_words if report.summary.get(key)]


def _returns(report: LoopReport, starts: str) -> Sheet:
    def mean(policy: str, s: Stats) -> Cell:
        return Cell(sheets.plus_minus(s.get("mean"), s.get("std")), below=sheets.span(s.get("interval")))

    def iqm(policy: str, s: Stats) -> Cell:
        return Cell(fixed(s.get("iqm")), below=sheets.span(s.get("iqm_interval")))

    def full(policy: str, s: Stats) -> str:
        return whole_percent(report.full_share(starts, policy)) if s.get("episodes") else MISSING

    columns: list[Column] = [("Mean ± std", mean), ("IQM", iqm)]
    if report.returns and report.trips is None and not report.own_rewards:
        columns.append(("Full episodes", full))
    if promised := report.summary.get("own_simulator") if starts == ALL else None:
        columns.append(("In its own simulator", lambda p, s: fixed(promised.get(p))))
    short = _failing(report, starts)

    def seeds(policy: str, s: Stats) -> list[Cell | str]:
        means = dict(zip(report.seeds, s.get("by_seed") or [], strict=False))
        low = short.get(policy, {})
        return [Cell(fixed(means.get(seed)), marked=seed in low) for seed in report.seeds]

    count = len(report.starts[starts]) if starts in report.starts else 0
    part = (report.summary.get("share") or {}).get(starts)
    share = f" ({whole_percent(part)}{f' of {count}' if count else ''})" if known(part) else ""
    if starts == ALL:
        share = f" ({count})" if count else ""
    note = "" if starts in report.start_sets else "No start belongs to this set."
    listed = [f"{policy} with seed {s} ({fixed(m)})" for policy, low in short.items() for s, m in low.items()]
    if listed and not note:
        note = f"Below {100 * SHORT:g} % of the best seed's mean: {', '.join(listed)}."
    title = f"Return on the target, {report.set_words[starts]}{share}"
    stats = {policy: report.stats(starts, policy) for policy in report.policies}
    return _by_policy(report, title, columns, seeds, stats, note)


def _failing(report: LoopReport, starts: str) -> dict[str, dict[int, float]]:
    """Policy to seed to mean of the seeds that fall short, of the policies that are expected to succeed.

    They fall short of the highest mean of any seed of any policy: what can be earned there, as far as is known.
    """
    means = {name: report.stats(starts, name).get("by_seed") or [] for name in report.policies}
    short = SHORT * max(
        (float(m) for found in means.values() for m in found if known(m)), default=report.best_return
    )
    return {
        name: {s: float(m) for s, m in zip(report.seeds, means[name], strict=False) if known(m) and m < short}
        for name in report.policies
        if name in EXPECTED_TO_SUCCEED
    }


def _by_policy(
    report: LoopReport,
    title: str,
    columns: Sequence[Column],
    seeds: Callable[[str, Stats], Sequence[Cell | str]],
    stats: Mapping[str, Stats],
    note: str,
) -> Sheet:
    """A row a policy, and of several seeds a column each at the end."""
    several = len(report.seeds) if len(report.seeds) > 1 else 0
    heads = ["Policy", *(head for head, _ in columns), *(f"Seed {seed}" for seed in report.seeds[:several])]
    rows = (
        [Cell(p, name=p), *(say(p, s) for _, say in columns), *(seeds(p, s) if several else [])]
        for p, s in stats.items()
    )
    return sheet(title, heads, rows, note=note, tail=several)


def success_sheets(report: LoopReport) -> list[Sheet]:
    """A sheet for every set of starts; equal sets are shown once."""
    if report.trips is None:
        return []
    shown: dict[bytes, list[str]] = {}
    for key in report.start_sets:
        shown.setdefault(report.starts[key].tobytes(), []).append(key)
    return [_successes(report, keys) for keys in shown.values()]


def _trips(report: LoopReport, starts: str, policy: str) -> Stats:
    """The summary of a policy's trips on a set of starts, keyed as returns are; empty where there is none."""
    return (report.summary.get(starts.replace("returns", "success")) or {}).get(policy) or {}


def _successes(report: LoopReport, same: Sequence[str]) -> Sheet:
    def column(head: str, key: str, say: Callable[..., str], *more: Any) -> Column:
        return head, lambda p, s: say(s.get(key), *more)

    def of_target(key: str) -> Column:
        return "of Target's", lambda p, s: fixed((s.get("of_target") or {}).get(key), 3)

    def reached(policy: str, s: Stats) -> Cell:
        edges = s.get("interval")
        below = " to ".join(percent(e, 3) for e in edges) if edges and all(map(known, edges)) else ""
        return Cell(whole_percent(s.get("rate")), below=below)

    starts, words = same[0], "all starts" if ALL in same else report.set_words[same[0]]
    share = whole_percent((report.summary.get("share") or {}).get(starts))
    return _by_policy(
        report,
        f"Goals reached on the target, {words} ({share} of {len(report.starts[starts])})",
        [
            ("Reached", reached),
            column("facing away", "behind", whole_percent),
            column("facing the goal", "ahead", whole_percent),
            column("Steps", "steps", fixed),
            of_target("steps"),
            column("Metres", "path", fixed, 2),
            of_target("path"),
        ],
        lambda p, s: [whole_percent(rate) for rate in s.get("by_seed") or []],
        {policy: _trips(report, starts, policy) for policy in report.policies},
        "Steps and metres are means over the trips that reached the goal. The ratios to Target's use the trips that "
        "the Target policy of the same seed completed too.",
    )


@dataclass(frozen=True)
class Card:
    """A headline number; more: a share of it in the template's words, empty where there is none."""

    policy: str
    value: str
    words: str
    more: str = ""


def cards(report: LoopReport) -> list[Card]:
    """Source, the corrected simulator's policy and Target, as far as they were compared, on the first starts."""
    starts = next(iter(report.start_sets), "")
    if report.trips is not None:
        trips = {n: _trips(report, starts, n) for n in ("Source", *CORRECTED, "Target")}
        shares = {n: found["rate"] for n, found in trips.items() if known(found.get("rate"))}
        return [Card(n, whole_percent(share), WORDS[n], _goal(n, trips[n])) for n, share in shares.items()]
    means: dict[str, Any] = {name: report.stats(starts, name).get("mean") for name in WORDS}
    corrected = next((name for name in CORRECTED if known(means[name])), "Source")
    target, shown = means["Target"], dict.fromkeys(("Source", corrected, "Target"))
    of = (
        whole_percent(means[corrected] / target)
        if known(means[corrected]) and known(target) and target > 0
        else ""
    )
    return [Card(n, fixed(means[n]), WORDS[n], of * (n == corrected)) for n in shown if known(means[n])]


def _goal(policy: str, found: Stats) -> str:
    """Of Source's trips that face away how many reach it; of others over how many of Target's steps."""
    if policy == "Source":
        return whole_percent(found["behind"]) if known(found.get("behind")) else ""
    ratio = (found.get("of_target") or {}).get("steps")
    return f"{ratio:.2f}" if policy in CORRECTED and known(ratio) else ""


def worst_steps(report: LoopReport) -> dict[str, str]:
    """The data that one step was scored on -> NRMSE of the worse rate."""
    worst = {}
    for key, words in data_of(report).items():
        errors = [(scores(report, key, rate).get("mean") or {}).get("nrmse") for rate in rates(report)]
        if finite := [error for error in errors if known(error)]:
            before = {"one_step": "the ", "one_step_random": "data of "}[key]
            worst[before + words.removeprefix(before)] = percent(max(finite))
    return worst


def data_of(report: LoopReport) -> dict[str, str]:
    """The data that one step was scored on, in words, by their key in summary.json."""
    recorded = report.summary.get("judged_on")
    return {"one_step": str(recorded).partition(":")[0]} if recorded else DATA


def rates(report: LoopReport) -> list[str]:
    """The rates that one step was scored for, in order."""
    every = [report.summary.get(key) or {} for key in data_of(report)]
    return list(
        dict.fromkeys(n for found in every for n, score in found.items() if isinstance(score, Mapping))
    )


def scores(report: LoopReport, key: str, rate: str) -> Stats:
    """The scores of a rate on one driver's data; empty where there are none."""
    found = (report.summary.get(key) or {}).get(rate)
    return found if isinstance(found, Mapping) else {}


def one_step_sheet(report: LoopReport) -> Sheet:
    """NRMSE and R2 of mean and sample on both drivers' data."""

    def errors(found: Stats) -> tuple[str, str]:
        value, spread = found.get("nrmse"), found.get("nrmse_std")
        text = percent(value)
        if known(value) and known(spread):
            digits = text.removesuffix(" %")
            text = f"{digits} ± {100.0 * spread:.{len(digits.partition('.')[2])}f} %"
        return text, sheets.coefficient(found.get("r2"))

    data = data_of(report)
    rows = []
    for rate in rates(report):
        for how in ("mean", "sample"):
            cells = (cell for key in data for cell in errors(scores(report, key, rate).get(how) or {}))
            rows.append((with_unit(rate, report.units), how, *cells))
    # How much of what was visited lies where the GPs were taught nothing.
    shares = report.summary.get("outside_recording") or {}
    outside = [f"{whole_percent(s)} of {DRIVERS.get(name, name)}" for name, s in shares.items() if known(s)]
    note = (
        "NRMSE: root mean square error over the pooled range (max - min) of the residual; ± is the standard "
        f"deviation over episodes.{_averaged(report)}"
    )
    if outside:
        note += f" Transitions outside the range of the GPs' training rows: {', '.join(outside)}."
    heads = ("Rate", "Prediction", *(head for words in data.values() for head in (f"NRMSE, {words}", "R²")))
    return sheet("One step: the correction's error on target transitions", heads, rows, labels=2, note=note)


def _averaged(report: LoopReport) -> str:
    return " Averages over the seeds' GPs." if len(report.seeds) > 1 else ""


def calibration_sheet(report: LoopReport) -> Sheet:
    """Covered shares, likelihood and predicted spread of the GPs' one-step distributions."""
    data, each = data_of(report), [(r, key) for r in rates(report) for key in data_of(report)]
    found = {(r, key): score for r, key in each if (score := scores(report, key, r))}
    levels = sorted({level for score in found.values() for level in score.get("coverage") or {}}, key=float)
    rows = (
        (
            with_unit(rate, report.units),
            data[key],
            *(whole_percent((score.get("coverage") or {}).get(level)) for level in levels),
            significant(score.get("predicted_std")),
            significant((score.get("mean") or {}).get("rmse")),
            significant(score.get("negative_log_likelihood")),
        )
        for (rate, key), score in found.items()
    )
    shares = (f"in its {100.0 * float(level):.0f} % interval" for level in levels)
    heads = ("Rate", "Data", *shares, "Predicted std", "Error (rms)", "Negative log likelihood")
    note = f"Below the nominal share, the GP is overconfident; above it, too cautious.{_averaged(report)}"
    title = "Calibration: how often the target lies in the predicted interval"
    return sheet(title, heads, rows, labels=2, note=note)


def rollout_sheet(report: LoopReport) -> Sheet:
    """Root mean square distance to the target's rollouts, per channel, and what a mean over infinity cannot say."""
    rollout, title = report.summary.get("rollout") or {}, "Rollouts: root mean square distance to the target"
    simulators = {name: of for name, of in rollout.items() if isinstance(of, Mapping) and "rms" in of}
    channels = list(dict.fromkeys(channel for found in simulators.values() for channel in found["rms"]))
    rows: list[tuple[Cell | str, ...]] = [
        (Cell(name, name=name), *(significant(found["rms"].get(channel)) for channel in channels))
        for name, found in simulators.items()
    ]
    if known(rollout.get("rollouts")) and known(rollout.get("horizon_s")):
        actions = "recorded" if report.summary.get("judged_on") else "random"
        title += (
            f", {rollout['rollouts']} rollouts of {rollout['horizon_s']:g} s under the same {actions} actions"
        )
    notes = [_averaged(report).strip()]
    for name, found in simulators.items():
        if known(count := found.get("not_finite")) and count:
            many = f"{count:.0f} rollouts" if float(count).is_integer() else f"{count:.1f} rollouts a seed"
            many = "1 rollout" if count == 1 else many
            notes.append(f"{name}: {many} diverged, and count as infinitely far.")
    heads = ("Simulator", *(with_unit(name, report.units) for name in channels))
    return sheet(title, heads, rows, note=" ".join(notes).strip())


def fit_sheet(report: LoopReport) -> Sheet:
    """How each fit ended, on how many rows, and the noise that it found; the rest is in fit.json."""
    rows: list[tuple[Cell | str, ...]] = []
    for seed, fitted in report.fits.items():
        for rate, fit in (fitted.get("rates") or {}).items():
            noise = significant((fit.get("hyper_parameters_original") or {}).get("noise_std"))
            words, advice = str(fit.get("outcome", MISSING)).replace("_", " "), str(fit.get("advice", ""))
            outcome = Cell(words, marked=fit.get("converged") is False, title=advice)
            spread = f"{noise} {report.unit(rate)}".strip()
            rows.append((str(seed), rate, outcome, str(fit.get("rows", MISSING)), spread))
    heads = ("Seed", "Rate", "Outcome", "Rows", "Noise std")
    return sheet("Fits: one Gaussian process per rate", heads, rows, labels=3)


def gp_warnings(report: LoopReport) -> list[str]:
    """What the fits and the coverage of the recordings warn of, each once, with the seeds that gave it."""
    seeds: dict[str, list[int]] = {}
    warned = [(seed, text) for seed, fit in report.fits.items() for text in fit.get("warnings") or ()]
    warned += [(seed, text) for seed, found in report.outside.items() for text in coverage_warnings(found)]
    for seed, text in warned:
        seeds.setdefault(str(text), []).append(seed)
    if len(report.seeds) < 2:
        return list(seeds)
    return [f"{text} (seed{'s' * (len(of) > 1)} {', '.join(map(str, of))})" for text, of in seeds.items()]
