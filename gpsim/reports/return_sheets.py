"""The sheets of the returns: one per set of starts, with the thesis's figures."""

from __future__ import annotations

from gpsim.reports import thesis
from gpsim.reports.loop_report import LoopReport
from gpsim.reports.sheets import Cell, Sheet, fixed, known, plus_minus, row, span, whole_percent

SHORT = 0.9
"""A seed falls short when its mean is below this share of the best seed's, of any policy, on the same starts."""

EXPECTED_TO_SUCCEED = ("GP-Mean", "GP-Sample", "Effects", "Target")
"""The others fall short by design: they know nothing of what the simulator lacks."""


def return_sheets(report: LoopReport) -> list[Sheet]:
    """A sheet for every set of starts that the summary holds."""
    return [_sheet(report, key) for key in report.set_words if report.summary.get(key)]


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


def _sheet(report: LoopReport, starts: str) -> Sheet:
    several = len(report.seeds) > 1
    # The thesis leaves starts that cannot be solved out.
    compare = starts != "returns_all" and bool(thesis.returns(report.system))
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
        _title(report, starts),
        tuple(columns),
        tuple(rows),
        note=_note(report, starts),
        tail=len(report.seeds) if several else 0,
    )


def _thesis(report: LoopReport, policy: str) -> str:
    figure = thesis.returns(report.system).get(policy)
    return f"{figure.mean} ± {figure.std}" if figure else "–"


def _by_seed(report: LoopReport, starts: str, policy: str) -> list[Cell | str]:
    means = list(report.stats(starts, policy).get("by_seed") or [])
    means += [None] * (len(report.seeds) - len(means))
    short = {seed for seed, _ in failing(report, starts).get(policy, [])}
    return [Cell(fixed(mean), marked=seed in short) for seed, mean in zip(report.seeds, means, strict=False)]


def _title(report: LoopReport, starts: str) -> str:
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
