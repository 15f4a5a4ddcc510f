"""The report in a paragraph: what the first policy earns, what the corrected one does, what can be earned."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.reports.loop_report import LoopReport
from gpsim.reports.model_sheets import data_of, rates, scores
from gpsim.reports.sheets import fixed, known, percent, whole_percent
from gpsim.reports.success_sheets import stats

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
