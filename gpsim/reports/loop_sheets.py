"""The sheets of a loop: returns, goals reached, one-step errors, calibration, rollouts, fits; and its headline."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gpsim.evaluation import coverage_warnings
from gpsim.reports.loop_report import ALL, LoopReport
from gpsim.reports.sheets import (
    MISSING,
    Cell,
    Sheet,
    coefficient,
    fixed,
    known,
    percent,
    plus_minus,
    row,
    sheet,
    significant,
    span,
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
Column = tuple[str, Callable[[str, Mapping[str, Any]], Cell | str]]
"""The head of a column, and its cell of a policy and what is known of that."""
POLICY: Column = ("Policy", lambda policy, stats: Cell(policy, name=policy))


def return_sheets(report: LoopReport) -> list[Sheet]:
    """A sheet for every set of starts that the summary holds."""
    return [_returns(report, key) for key in report.set_words if report.summary.get(key)]


def failing(report: LoopReport, starts: str) -> dict[str, dict[int, float]]:
    """Policy to seed to mean of the seeds that fall short, of the policies that are expected to succeed.

    They fall short of the highest mean of any seed of any policy: what can be earned there, as far as is known.
    """
    means = {name: report.stats(starts, name).get("by_seed") or [] for name in report.policies}
    earned = [float(mean) for found in means.values() for mean in found if known(mean)]
    short = SHORT * max(earned, default=report.best_return)
    found = {
        name: {s: float(m) for s, m in zip(report.seeds, means[name], strict=False) if known(m) and m < short}
        for name in report.policies
        if name in EXPECTED_TO_SUCCEED
    }
    return {name: low for name, low in found.items() if low}


def _returns(report: LoopReport, starts: str) -> Sheet:
    columns = [
        POLICY,
        (
            "Mean ± std",
            lambda p, s: Cell(plus_minus(s.get("mean"), s.get("std")), below=span(s.get("interval"))),
        ),
        ("IQM", lambda p, s: Cell(fixed(s.get("iqm")), below=span(s.get("iqm_interval")))),
    ]
    if report.returns and report.trips is None and not report.own_rewards:
        share = lambda p, s: whole_percent(report.full_share(starts, p)) if s.get("episodes") else MISSING  # noqa: E731
        columns.append(("Full episodes", share))
    if promised := report.summary.get("own_simulator") if starts == ALL else None:
        columns.append(("In its own simulator", lambda p, s: fixed(promised.get(p))))
    short = failing(report, starts)

    def seeds(policy: str, stats: Mapping[str, Any]) -> list[Cell | str]:
        means = list(stats.get("by_seed") or [])
        means += [None] * (len(report.seeds) - len(means))
        low = short.get(policy, {})
        return [Cell(fixed(mean), marked=s in low) for s, mean in zip(report.seeds, means, strict=False)]

    stats = {policy: report.stats(starts, policy) for policy in report.policies}
    title = f"Return on the target, {report.set_words[starts]}"
    count = len(report.starts[starts]) if starts in report.starts else 0
    of_all = (report.summary.get("share") or {}).get(starts)
    if starts == ALL:
        title += f" ({count})" if count else ""
    elif known(of_all):
        title += f" ({whole_percent(of_all)}{f' of {count}' if count else ''})"
    note = "" if starts in report.start_sets else "No start belongs to this set."
    listed = [f"{policy} with seed {s} ({fixed(m)})" for policy, low in short.items() for s, m in low.items()]
    if listed and not note:
        note = f"Below {100 * SHORT:g} % of the best seed's mean: {', '.join(listed)}."
    return _by_policy(report, title, columns, seeds, stats, note)


def _by_policy(
    report: LoopReport,
    title: str,
    columns: Sequence[Column],
    seeds: Callable[[str, Mapping[str, Any]], list[Cell | str]],
    stats: Mapping[str, Mapping[str, Any]],
    note: str,
) -> Sheet:
    """A row a policy, and of several seeds a column each at the end."""
    several = len(report.seeds) if len(report.seeds) > 1 else 0
    heads = [head for head, _ in columns] + [f"Seed {seed}" for seed in report.seeds if several]
    rows = ([*(say(p, s) for _, say in columns), *(seeds(p, s) if several else [])] for p, s in stats.items())
    return sheet(title, heads, rows, note=note, tail=several)


def success_sheets(report: LoopReport) -> list[Sheet]:
    """A sheet for every set of starts; equal sets are shown once."""
    if report.trips is None:
        return []
    shown: dict[bytes, str] = {}
    for key in report.start_sets:
        shown.setdefault(report.starts[key].tobytes(), key)
    return [_successes(report, key) for key in shown.values()]


def _trips(report: LoopReport, starts: str, policy: str) -> Mapping[str, Any]:
    """The summary of a policy's trips on a set of starts, keyed as returns are; empty where there is none."""
    return (report.summary.get(starts.replace("returns", "success")) or {}).get(policy) or {}


def _successes(report: LoopReport, starts: str) -> Sheet:
    def of_target(key: str) -> Column:
        return "of Target's", lambda p, s: fixed((s.get("of_target") or {}).get(key), 3)

    def reached(policy: str, stats: Mapping[str, Any]) -> Cell:
        edges = stats.get("interval")
        below = " to ".join(percent(e, 3) for e in edges) if edges and all(map(known, edges)) else ""
        return Cell(whole_percent(stats.get("rate")), below=below)

    columns: list[Column] = [
        POLICY,
        ("Reached", reached),
        ("facing away", lambda p, s: whole_percent(s.get("behind"))),
        ("facing the goal", lambda p, s: whole_percent(s.get("ahead"))),
        ("Steps", lambda p, s: fixed(s.get("steps"))),
        of_target("steps"),
        ("Metres", lambda p, s: fixed(s.get("path"), 2)),
        of_target("path"),
    ]
    share = (report.summary.get("share") or {}).get(starts)
    same = [key for key in report.start_sets if (report.starts[key] == report.starts[starts]).all()]
    words = "all starts" if ALL in same else report.set_words[starts]
    return _by_policy(
        report,
        f"Goals reached on the target, {words} ({whole_percent(share)} of {len(report.starts[starts])})",
        columns,
        lambda p, s: [whole_percent(rate) for rate in s.get("by_seed") or []],
        {policy: _trips(report, starts, policy) for policy in report.policies},
        "Steps and metres: means over the trips that reached the goal; of Target's: on the trips that the Target "
        "policy of the same seed completed too.",
    )


@dataclass(frozen=True)
class Card:
    """A headline number."""

    policy: str
    value: str
    words: str


def cards(report: LoopReport) -> list[Card]:
    """Source, the corrected simulator's policy and Target, as far as they were compared, on the first starts."""
    starts = next(iter(report.start_sets), None)
    if starts is None:
        return []
    if report.trips is not None:
        rates = {n: _trips(report, starts, n).get("rate") for n in ("Source", *CORRECTED, "Target")}
        return [Card(name, whole_percent(rate), WORDS[name]) for name, rate in rates.items() if known(rate)]
    means = {name: report.stats(starts, name).get("mean") for name in WORDS}
    corrected = next((name for name in CORRECTED if known(means[name])), "Source")
    shown = dict.fromkeys(("Source", corrected, "Target"))
    return [Card(name, fixed(means[name]), WORDS[name]) for name in shown if known(means[name])]


def paragraph(report: LoopReport) -> str:
    """Plain words with the headline numbers, and what they are of where that is not what was recorded."""
    measured = report.summary.get("measured_on")
    return _numbers(report) + (f" Measured on {measured}." if measured else "")


def _numbers(report: LoopReport) -> str:
    shown, parts = cards(report), []
    if not shown:
        why = report.summary.get("not_driven")
        return f"No policy was evaluated on the target{f': {why}' if why else ''}.{_one_step(report)}"
    starts = report.start_sets[0]
    if report.trips is not None:
        parts = [_goal(card, _trips(report, starts, card.policy)) for card in shown]
        return f"{'; '.join(parts)}. {_scope(report, starts)}{_one_step(report)}"
    best = "" if report.own_rewards else f" of {report.best_return:g}"
    target = report.stats(starts, "Target").get("mean")
    for card in shown:
        if card.policy == "Source":
            parts.append(f"the policy trained in the plain simulator earns {card.value}{best} on the target")
        elif card.policy == "Target":
            parts.append(f"the reachable optimum, trained on the target itself, earns {card.value}")
        else:
            mean = report.stats(starts, card.policy)["mean"]
            ratio = f" ({whole_percent(mean / target)} of Target)" if known(target) and target > 0 else ""
            parts.append(f"the policy {card.words} ({card.policy}) earns {card.value}{ratio}")
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}. {_scope(report, starts)}{_one_step(report)}"


def _goal(card: Card, found: Mapping[str, Any]) -> str:
    """Who reaches the goal, and how directly."""
    text = f"{card.policy}, {card.words}, reaches the goal from {card.value} of the starts"
    if card.policy == "Source" and known(found.get("behind")):
        text += f" ({whole_percent(found['behind'])} of those that face away)"
    ratio = (found.get("of_target") or {}).get("steps")
    return f"{text} in {ratio:.2f} of Target's steps" if card.policy in CORRECTED and known(ratio) else text


def _scope(report: LoopReport, starts: str) -> str:
    share = (report.summary.get("share") or {}).get(starts)
    seeds = f"{len(report.seeds)} seeds" if len(report.seeds) != 1 else f"one seed ({report.seeds[0]})"
    of = f", {whole_percent(share)} of all" if known(share) and starts != ALL else ""
    what = "Shares" if report.trips else "Mean returns"
    return f"{what} over {seeds} and the {report.set_words[starts].removeprefix('all ')}{of}."


def _one_step(report: LoopReport) -> str:
    said = []
    for key, words in data_of(report).items():
        errors = [(scores(report, key, rate).get("mean") or {}).get("nrmse") for rate in rates(report)]
        finite = [error for error in errors if known(error)]
        if finite:
            of = {"one_step": "the ", "one_step_random": "data of "}[key]
            said.append(f"{percent(max(finite))} on {of}{words.removeprefix(of)}")
    if not said:
        return ""
    return f" One step ahead the correction errs by {' and '.join(said)} (NRMSE of the worse rate)."


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


def scores(report: LoopReport, key: str, rate: str) -> Mapping[str, Any]:
    """The scores of a rate on one driver's data; empty where there are none."""
    found = (report.summary.get(key) or {}).get(rate)
    return found if isinstance(found, Mapping) else {}


def one_step_sheet(report: LoopReport) -> Sheet:
    """NRMSE and R2 of mean and sample on both drivers' data."""

    def errors(key: str, rate: str, prediction: str) -> tuple[str, str]:
        found = scores(report, key, rate).get(prediction) or {}
        value, spread = found.get("nrmse"), found.get("nrmse_std")
        text = percent(value)
        if known(value) and known(spread):
            digits = text.removesuffix(" %")
            text = f"{digits} ± {100.0 * spread:.{len(digits.partition('.')[2])}f} %"
        return text, coefficient(found.get("r2"))

    data = data_of(report)
    heads = [head for words in data.values() for head in (f"NRMSE, {words}", "R²")]
    rows = (
        (with_unit(rate, report.units), how, *(cell for key in data for cell in errors(key, rate, how)))
        for rate in rates(report)
        for how in ("mean", "sample")
    )
    # How much of what was visited lies where the GPs were taught nothing.
    shares = report.summary.get("outside_recording") or {}
    outside = [f"{whole_percent(s)} of {DRIVERS.get(name, name)}" for name, s in shares.items() if known(s)]
    note = (
        "NRMSE: root mean square error over the pooled range (max - min) of the residual; ± is the standard "
        "deviation over episodes."
    ) + _averaged(report)
    note += (
        f" Transitions outside the range of the GPs' training rows: {', '.join(outside)}." if outside else ""
    )
    title = "One step: the correction's error on target transitions"
    return sheet(title, ("Rate", "Prediction", *heads), rows, labels=2, note=note)


def _averaged(report: LoopReport) -> str:
    return " Averages over the seeds' GPs." if len(report.seeds) > 1 else ""


def calibration_sheet(report: LoopReport) -> Sheet:
    """Covered shares, likelihood and predicted spread of the GPs' one-step distributions."""
    levels = coverage_levels(report)
    heads = [f"in its {100.0 * float(level):.0f} % interval" for level in levels]
    found = {(r, key): scores(report, key, r) for r in rates(report) for key in data_of(report)}
    rows = (
        (
            with_unit(rate, report.units),
            data_of(report)[key],
            *(whole_percent((score.get("coverage") or {}).get(level)) for level in levels),
            significant(score.get("predicted_std")),
            significant((score.get("mean") or {}).get("rmse")),
            significant(score.get("negative_log_likelihood")),
        )
        for (rate, key), score in found.items()
        if score
    )
    return sheet(
        "Calibration: how often the target lies in the predicted interval",
        ("Rate", "Data", *heads, "Predicted std", "Error (rms)", "Negative log likelihood"),
        rows,
        labels=2,
        note="Below the nominal share, the GP is overconfident; above it, too cautious." + _averaged(report),
    )


def coverage_levels(report: LoopReport) -> list[str]:
    """The nominal levels that were scored, ascending, as they are keyed."""
    every = [scores(report, key, rate) for key in data_of(report) for rate in rates(report)]
    return sorted({level for score in every for level in score.get("coverage") or {}}, key=float)


def rollout_simulators(report: LoopReport) -> dict[str, Mapping[str, Any]]:
    """Simulator to its divergence from the target."""
    rollout = report.summary.get("rollout") or {}
    return {name: found for name, found in rollout.items() if isinstance(found, Mapping) and "rms" in found}


def rollout_sheet(report: LoopReport) -> Sheet:
    """Root mean square distance to the target's rollouts, per channel, and what a mean over infinity cannot say."""
    simulators = rollout_simulators(report)
    channels = list(dict.fromkeys(channel for found in simulators.values() for channel in found["rms"]))
    rows = (
        row(Cell(name, name=name), *(significant(found["rms"].get(channel)) for channel in channels))
        for name, found in simulators.items()
    )
    rollout, title = report.summary.get("rollout") or {}, "Rollouts: root mean square distance to the target"
    if known(rollout.get("rollouts")) and known(rollout.get("horizon_s")):
        actions = "recorded" if report.summary.get("judged_on") else "random"
        title += (
            f", {rollout['rollouts']} rollouts of {rollout['horizon_s']:g} s under the same {actions} actions"
        )
    notes = [_averaged(report).strip()]
    for name, found in simulators.items():
        count = found.get("not_finite")
        if known(count) and count:
            many = f"{count:.0f} rollouts" if float(count).is_integer() else f"{count:.1f} rollouts a seed"
            many = "1 rollout" if count == 1 else many
            notes.append(f"{name}: {many} diverged, and count as infinitely far.")
    heads = ("Simulator", *(with_unit(name, report.units) for name in channels))
    return sheet(title, heads, rows, note=" ".join(notes).strip())


def fit_sheet(report: LoopReport) -> Sheet:
    """How each fit ended, on how many rows, and the noise that it found; the rest is in fit.json."""
    rows = []
    for seed, fitted in report.fits.items():
        for rate, fit in (fitted.get("rates") or {}).items():
            noise = (fit.get("hyper_parameters_original") or {}).get("noise_std")
            outcome = Cell(
                str(fit.get("outcome", MISSING)).replace("_", " "),
                marked=fit.get("converged") is False,
                title=str(fit.get("advice", "")),
            )
            spread = f"{significant(noise)} {report.unit(rate)}".strip()
            rows.append(row(str(seed), rate, outcome, str(fit.get("rows", MISSING)), spread))
    columns = ("Seed", "Rate", "Outcome", "Rows", "Noise std")
    return Sheet("Fits: one Gaussian process per rate", columns, tuple(rows), 3)


def gp_warnings(report: LoopReport) -> list[str]:
    """What the fits and the coverage of the recordings warn of, each once, with the seeds that gave it."""
    seeds: dict[str, list[int]] = {}
    warned = [(seed, text) for seed, fit in report.fits.items() for text in fit.get("warnings") or ()]
    warned += [(seed, text) for seed, found in report.outside.items() for text in coverage_warnings(found)]
    for seed, text in warned:
        seeds.setdefault(str(text), []).append(seed)
    if len(report.seeds) < 2:
        return list(seeds)
    return [
        f"{text} (seed{'s' if len(found) > 1 else ''} {', '.join(map(str, found))})"
        for text, found in seeds.items()
    ]
