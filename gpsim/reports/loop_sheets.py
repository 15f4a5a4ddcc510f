"""The sheets of the returns: one per set of starts, with the thesis's figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gpsim.reports.loop_report import LoopReport, printed_returns
from gpsim.reports.model_sheets import data_of, rates, scores
from gpsim.reports.sheets import Cell, Sheet, fixed, known, percent, plus_minus, sheet, span, whole_percent

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


Column = tuple[str, Callable[[str, Mapping[str, Any]], Cell | str]]
"""The head of a column, and its cell of a policy and what is known of that."""
POLICY: Column = ("Policy", lambda policy, stats: Cell(policy, name=policy))


def _returns(report: LoopReport, starts: str) -> Sheet:
    columns, printed = [POLICY], printed_returns(report.system)
    if starts != "returns_all" and printed:  # the thesis leaves starts that cannot be solved out
        columns.append(
            ("Thesis", lambda p, s: f"{printed[p].mean} ± {printed[p].std}" if p in printed else "–")
        )
    columns += [
        (
            "Mean ± std",
            lambda p, s: Cell(plus_minus(s.get("mean"), s.get("std")), below=span(s.get("interval"))),
        ),
        ("IQM", lambda p, s: Cell(fixed(s.get("iqm")), below=span(s.get("iqm_interval")))),
    ]
    if report.returns and report.trips is None and not report.own_rewards:
        share = lambda p, s: whole_percent(report.full_share(starts, p)) if s.get("episodes") else "–"  # noqa: E731
        columns.append(("Full episodes", share))
    if promised := report.summary.get("own_simulator") if starts == "returns_all" else None:
        columns.append(("In its own simulator", lambda p, s: fixed(promised.get(p))))
    short = {policy: {seed for seed, _ in low} for policy, low in failing(report, starts).items()}

    def seeds(policy: str, stats: Mapping[str, Any]) -> list[Cell | str]:
        means = list(stats.get("by_seed") or [])
        means += [None] * (len(report.seeds) - len(means))
        low = short.get(policy, set())
        return [Cell(fixed(mean), marked=s in low) for s, mean in zip(report.seeds, means, strict=False)]

    return _by_policy(
        report,
        _returns_title(report, starts),
        columns,
        seeds,
        {policy: report.stats(starts, policy) for policy in report.policies},
        _note(report, starts),
    )


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


def _returns_title(report: LoopReport, starts: str) -> str:
    share = (report.summary.get("share") or {}).get(starts)
    count = len(report.starts[starts]) if starts in report.starts else 0
    title = f"Return on the target, {report.set_words[starts]}"
    if starts == "returns_all":
        return f"{title} ({count})" if count else title
    return f"{title} ({whole_percent(share)}{f' of {count}' if count else ''})" if known(share) else title


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
    def of_target(key: str) -> Column:
        return "of Target's", lambda p, s: fixed((s.get("of_target") or {}).get(key), 3)

    columns: list[Column] = [
        POLICY,
        ("Reached", lambda p, s: Cell(whole_percent(s.get("rate")), below=_span(s.get("interval")))),
        ("facing away", lambda p, s: whole_percent(s.get("behind"))),
        ("facing the goal", lambda p, s: whole_percent(s.get("ahead"))),
        ("Steps", lambda p, s: fixed(s.get("steps"))),
        of_target("steps"),
        ("Metres", lambda p, s: fixed(s.get("path"), 2)),
        of_target("path"),
    ]
    return _by_policy(
        report,
        _successes_title(report, starts),
        columns,
        lambda p, s: [whole_percent(rate) for rate in s.get("by_seed") or []],
        {policy: stats(report, starts, policy) for policy in report.policies},
        "Steps and metres: means over the trips that reached the goal; of Target's: on the trips that the Target "
        "policy of the same seed completed too.",
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
        return f"No policy was evaluated on the target{f': {why}' if why else ''}.{_one_step(report)}"
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
