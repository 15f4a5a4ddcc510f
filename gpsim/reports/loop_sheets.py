"""The sheets of the returns: one per set of starts, with the thesis's figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gpsim.reports.loop_report import (
    LoopReport,
    printed_returns,
)
from gpsim.reports.model_sheets import data_of, rates, scores
from gpsim.reports.sheets import Cell, Sheet, fixed, known, percent, plus_minus, row, span, whole_percent

SHORT = 0.9
"""A seed falls short when its mean is below this share of the best seed's, of any policy, on the same starts."""

EXPECTED_TO_SUCCEED = ("GP-Mean", "GP-Sample", "Effects", "Target")
"""The others fall short by design: they know nothing of what the simulator lacks."""


def return_sheets(report: LoopReport) -> list[Sheet]:
    """A sheet for every set of starts that the summary holds."""
    return [_returns(report, key) for key in report.set_words if report.summary.get(key)]


def best_seed(report: LoopReport, starts: str) -> float:
    """The highest mean of any seed of any policy on a set of starts: what can be earned there, as far as is known."""
    means = [mean for name in report.policies for mean in report.stats(starts, name).get("by_seed") or []]
    return max((float(mean) for mean in means if known(mean)), default=report.best_return)


def failing(report: LoopReport, starts: str) -> dict[str, list[tuple[int, float]]]:
    """Policy to (seed, mean) of the seeds that fall short, of the policies that are expected to succeed."""
    found = {}
    for policy in (name for name in report.policies if name in EXPECTED_TO_SUCCEED):
        means = report.stats(starts, policy).get("by_seed") or []
        short = SHORT * best_seed(report, starts)
        low = [
            (s, float(mean))
            for s, mean in zip(report.seeds, means, strict=False)
            if known(mean) and mean < short
        ]
        if low:
            found[policy] = low
    return found


def _returns(report: LoopReport, starts: str) -> Sheet:
    several = len(report.seeds) > 1
    # The thesis leaves starts that cannot be solved out.
    compare = starts != "returns_all" and bool(printed_returns(report.system))
    full = bool(report.returns) and report.trips is None and not report.own_rewards
    columns = ["Policy"]
    columns += ["Thesis"] if compare else []
    columns += ["Mean ± std", "IQM"]
    columns += ["Full episodes"] if full else []
    promised = report.summary.get("own_simulator") if starts == "returns_all" else None
    columns += ["In its own simulator"] if promised else []
    columns += [f"Seed {seed}" for seed in report.seeds] if several else []
    rows = []
    for policy in report.policies:
        stats = report.stats(starts, policy)
        cells: list[Cell | str] = [Cell(policy, name=policy)]
        cells += [_thesis(report, policy)] if compare else []
        cells += [
            Cell(plus_minus(stats.get("mean"), stats.get("std")), below=span(stats.get("interval"))),
            Cell(fixed(stats.get("iqm")), below=span(stats.get("iqm_interval"))),
        ]
        cells += (
            [whole_percent(report.full_share(starts, policy)) if stats.get("episodes") else "–"]
            if full
            else []
        )
        cells += [fixed(promised.get(policy))] if promised else []
        cells += _by_seed(report, starts, policy) if several else []
        rows.append(row(*cells))
    return Sheet(
        _returns_title(report, starts),
        tuple(columns),
        tuple(rows),
        note=_note(report, starts),
        tail=len(report.seeds) if several else 0,
    )


def _thesis(report: LoopReport, policy: str) -> str:
    figure = printed_returns(report.system).get(policy)
    return f"{figure.mean} ± {figure.std}" if figure else "–"


def _by_seed(report: LoopReport, starts: str, policy: str) -> list[Cell | str]:
    means = list(report.stats(starts, policy).get("by_seed") or [])
    means += [None] * (len(report.seeds) - len(means))
    short = {seed for seed, _ in failing(report, starts).get(policy, [])}
    return [Cell(fixed(mean), marked=seed in short) for seed, mean in zip(report.seeds, means, strict=False)]


def _returns_title(report: LoopReport, starts: str) -> str:
    share = (report.summary.get("share") or {}).get(starts)
    count = len(report.starts[starts]) if starts in report.starts else None
    words = report.set_words[starts]
    if starts == "returns_all":
        return f"Return on the target, {words}" + (f" ({count})" if count else "")
    of = f" of {count}" if count else ""
    return f"Return on the target, {words}" + (f" ({whole_percent(share)}{of})" if known(share) else "")


def _note(report: LoopReport, starts: str) -> str:
    if starts not in report.start_sets:
        return "No start belongs to this set."
    listed = [
        f"{policy} with seed {seed} ({fixed(mean)})"
        for policy, seeds in failing(report, starts).items()
        for seed, mean in seeds
    ]
    if not listed:
        return ""
    return f"Below {100 * SHORT:g} % of the best seed's mean: {', '.join(listed)}."


def success_sheets(report: LoopReport) -> list[Sheet]:
    """A sheet for every set of starts; equal sets are shown once."""
    if report.trips is None:
        return []
    shown: dict[bytes, str] = {}
    for key in report.start_sets:
        shown.setdefault(report.starts[key].tobytes(), key)
    return [_successes(report, key) for key in shown.values()]


def stats(report: LoopReport, starts: str, policy: str) -> Mapping[str, Any]:
    """The summary of a policy's trips on a set of starts, keyed as returns are; empty where there is none."""
    found = (report.summary.get(starts.replace("returns", "success")) or {}).get(policy)
    return found or {}


def _successes(report: LoopReport, starts: str) -> Sheet:
    several = len(report.seeds) > 1
    columns = [
        "Policy",
        "Reached",
        "facing away",
        "facing the goal",
        "Steps",
        "of Target's",
        "Metres",
        "of Target's",
    ]
    columns += [f"Seed {seed}" for seed in report.seeds] if several else []
    rows = []
    for policy in report.policies:
        found = stats(report, starts, policy)
        target = found.get("of_target") or {}
        cells: list[Cell | str] = [
            Cell(policy, name=policy),
            Cell(whole_percent(found.get("rate")), below=_span(found.get("interval"))),
            whole_percent(found.get("behind")),
            whole_percent(found.get("ahead")),
            fixed(found.get("steps")),
            fixed(target.get("steps"), 3),
            fixed(found.get("path"), 2),
            fixed(target.get("path"), 3),
        ]
        cells += [whole_percent(rate) for rate in found.get("by_seed") or []] if several else []
        rows.append(row(*cells))
    return Sheet(
        _successes_title(report, starts),
        tuple(columns),
        tuple(rows),
        note="Steps and metres: means over the trips that reached the goal; of Target's: on the trips that the Target "
        "policy of the same seed completed too.",
        tail=len(report.seeds) if several else 0,
    )


def _span(interval: Any) -> str:
    if not interval or not all(known(value) for value in interval):
        return ""
    return f"{percent(interval[0], 3)} to {percent(interval[1], 3)}"


def _successes_title(report: LoopReport, starts: str) -> str:
    share = (report.summary.get("share") or {}).get(starts)
    same = [key for key in report.start_sets if (report.starts[key] == report.starts[starts]).all()]
    words = "all starts" if "returns_all" in same else report.set_words[starts]
    return f"Goals reached on the target, {words} ({whole_percent(share)} of {len(report.starts[starts])})"


CORRECTED = ("GP-Sample", "Effects", "GP-Mean")
"""Policies trained in a corrected simulator, the one to name first first."""

WORDS = {
    "Source": "trained in the plain simulator",
    "Target": "trained on the target itself, the reachable optimum",
    "GP-Mean": "trained in the simulator corrected by the GP's mean",
    "GP-Sample": "trained in the simulator corrected by samples of the GP",
    "Effects": "trained in the simulator corrected by named effects",
}


@dataclass(frozen=True)
class Card:
    """A headline number."""

    policy: str
    value: str
    words: str


def headline_starts(report: LoopReport) -> str | None:
    """The set of starts that the headline speaks of: the first that holds any."""
    return next(iter(report.start_sets), None)


def cards(report: LoopReport) -> list[Card]:
    """Source, the corrected simulator's policy and Target, as far as they were compared."""
    starts = headline_starts(report)
    if starts is None:
        return []
    if report.trips is not None:
        return [
            Card(name, whole_percent(stats(report, starts, name).get("rate")), WORDS[name])
            for name in ("Source", *CORRECTED, "Target")
            if known(stats(report, starts, name).get("rate"))
        ]
    corrected = next((name for name in CORRECTED if known(report.stats(starts, name).get("mean"))), None)
    found = []
    for name in ("Source", corrected, "Target"):
        mean = report.stats(starts, name).get("mean") if name else None
        if name and known(mean):
            found.append(Card(name, fixed(mean), WORDS[name]))
    return found


def paragraph(report: LoopReport) -> str:
    """Plain words with the headline numbers, and what they are of where that is not what was recorded."""
    measured = report.summary.get("measured_on")
    return _numbers(report) + (f" Measured on {measured}." if measured else "")


def _numbers(report: LoopReport) -> str:
    starts = headline_starts(report)
    shown = cards(report)
    if starts is None or not shown:
        why = report.summary.get("not_driven")
        said = (
            f"No policy was evaluated on the target: {why}."
            if why
            else "No policy was evaluated on the target."
        )
        return said + _one_step(report)
    if report.trips is not None:
        return f"{_goals(report, starts, shown)} {_scope(report, starts)}{_one_step(report)}"
    best = "" if report.own_rewards else f" of {report.best_return:g}"
    parts = []
    for card in shown:
        if card.policy == "Source":
            parts.append(f"the policy trained in the plain simulator earns {card.value}{best} on the target")
        elif card.policy == "Target":
            parts.append(f"the reachable optimum, trained on the target itself, earns {card.value}")
        else:
            parts.append(
                f"the policy {card.words} ({card.policy}) earns {card.value}{_ratio(report, starts, card)}"
            )
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}. {_scope(report, starts)}{_one_step(report)}"


def _goals(report: LoopReport, starts: str, shown: list[Card]) -> str:
    """Who reaches the goal, and how directly."""
    parts = []
    for card in shown:
        found = stats(report, starts, card.policy)
        text = f"{card.policy}, {card.words}, reaches the goal from {card.value} of the starts"
        if card.policy == "Source" and known(found.get("behind")):
            text += f" ({whole_percent(found['behind'])} of those that face away)"
        ratio = (found.get("of_target") or {}).get("steps")
        if card.policy in CORRECTED and known(ratio):
            text += f" in {ratio:.2f} of Target's steps"
        parts.append(text)
    return "; ".join(parts) + "."


def _ratio(report: LoopReport, starts: str, card: Card) -> str:
    target, mean = report.stats(starts, "Target").get("mean"), report.stats(starts, card.policy).get("mean")
    return (
        f" ({whole_percent(mean / target)} of Target)" if known(target) and known(mean) and target > 0 else ""
    )


def _scope(report: LoopReport, starts: str) -> str:
    share = (report.summary.get("share") or {}).get(starts)
    seeds = f"{len(report.seeds)} seeds" if len(report.seeds) != 1 else f"one seed ({report.seeds[0]})"
    of = f", {whole_percent(share)} of all" if known(share) and starts != "returns_all" else ""
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
