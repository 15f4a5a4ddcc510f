"""Several recordings of one machine: values that are one recording's own.

All recordings share a law's values until one of them insists on its own: a payload, a worn tyre, a marker glued on
anew. Own values are parameters more, priced as all are; the law itself is known already, so nothing else is to be paid.
"""

from __future__ import annotations

import numpy as np

from gpsim.diagnosis.ladder.account import Account
from gpsim.diagnosis.ladder.search import CLOSE, FIRST_LOOK, Search

MOST = 6  # values of recordings' own, at most
PROMISING = 3  # of them that are fitted of those whose windows pull hardest


def with_own_values(search: Search) -> None:
    """The account in which laws have values of their own in recordings that insist on it."""
    windows = search.shooting.problem.windows
    sources = np.unique(windows.sources)
    if len(sources) < 2 or not search.account.laws:
        return
    for _ in range(MOST):
        account, now = search.account, search.score(search.account)
        best: Account | None = None
        for index, source in _promising(search, account, sources.tolist())[:PROMISING]:
            hypothesis = account.hypothesis.with_own(index, source)
            tried = search.fitted(account.laws, hypothesis, account.fit.starts, FIRST_LOOK)
            if best is None or tried.fit.cost < best.fit.cost:
                best = tried
        if best is None:
            return
        best = Account(best.laws, search.shooting.fit(best.fit, CLOSE))
        if _score(search, best) > now - search.numbers.law:
            return
        best = _unshared(search, best, now)
        search.say("a recording's own value", True, *best.hypothesis.names, gain=now - _score(search, best))
        search.account = best


def _unshared(search: Search, account: Account, now: float) -> Account:
    """The account whose law does nothing but in the recordings that have values of their own, where that is as good."""
    for index, term in enumerate(account.hypothesis.terms):
        if term.owners and any(p.name in term.values for p in account.laws[index].candidate.declared):
            hypothesis = account.hypothesis.without_shared(index)
            tried = search.fitted(account.laws, hypothesis, account.fit.starts, CLOSE)
            if _score(search, tried) < _score(search, account):
                account = tried
    return account


def _score(search: Search, account: Account) -> float:
    """What the account costs, its own values paid."""
    spare = len(account.hypothesis.parameters) - sum(len(law.candidate.declared) for law in account.laws)
    return search.score(account) + float(0.5 * spare * np.log(max(search.shooting.noise.effective, 2.0)))


def _promising(search: Search, account: Account, sources: list[int]) -> list[tuple[int, int]]:
    """Law and recording, those first whose windows would gain most by values of their own, by the quadratic."""
    fit, windows, out = account.fit, search.shooting.problem.windows, []
    for index, rows in enumerate(account.rows):
        for source in sources:
            if source in account.hypothesis.terms[index].owners:
                continue
            own = np.flatnonzero(windows.sources == source)
            pull = fit.gradients[own].sum(axis=0)[rows]
            information = fit.by_window[own].sum(axis=0)[rows, rows]
            gain = 0.5 * float(
                pull @ np.linalg.lstsq(information + 1e-12 * np.eye(len(pull)), pull, rcond=None)[0]
            )
            out.append((gain, index, source))
    least = search.price(account.laws[0]) if account.laws else 0.0
    return [(i, s) for gain, i, s in sorted(out, reverse=True) if gain > 0.5 * least]
