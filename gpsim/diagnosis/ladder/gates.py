"""Gates: laws that act in a region of a coordinate, since a moment, or since an episode, only.

One gate an account. Where and since when is scanned by lines, edges are then moved while that pays; a gate must take
half of what is left beyond the noise, since on real logs onsets fit whatever drifts, or do better than an unusual law.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, pairwise, product

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Hypothesis, Problem
from gpsim.diagnosis.ladder.account import Account
from gpsim.diagnosis.ladder.laws import Law
from gpsim.diagnosis.ladder.offers import Lines, nudged
from gpsim.diagnosis.ladder.search import CLOSE, FIRST_LOOK, SETTLE, Search
from gpsim.effects import Gate, effect_of, has_patch

MOMENTS = 10  # at which a law may have begun, that are scanned
PLACES = 8  # parts of a coordinate's way, in runs of which a law may act alone
EARLIEST, LATEST = 0.12, 0.88  # quantiles of time between which something may begin
MOVES = (0.5, 0.25, 0.12, 0.06)  # of the distance between two places, by which an edge is moved
FINER_MOVES = (0.06, 0.03, 0.015)  # once the law has told the noise
PROBED = 3  # gates that are fitted of those that promise most
BEYOND = 1e6  # where no coordinate goes: an edge there is none
LEAST = 0.1  # nats that a move of an edge gains, or it is the last


def gated(search: Search) -> None:
    """The account with one law behind a gate: where that takes off half of what is left, or in an unusual law's place.

    A battery that sags, or a force that ripples, may be what began at some moment, or acts in some place.
    """
    if search.dear:
        return
    whole, now = search.account, search.score(search.account)
    found: list[Account] = []
    if search.left() > search.numbers.gate:
        least = max(search.numbers.gate, search.numbers.share_of_gate * search.left())
        found += _behind_gates(search, least, now - least)
    for i, law in enumerate(whole.laws):
        if law.price >= search.numbers.unusual:
            search.account = search.without(whole, [i], whole.hypothesis, SETTLE)
            most = now - search.numbers.gate
            tried = _behind_gates(search, search.score(search.account) - now, most)
            # A usual law's, or onsets creep into real logs.
            found += [account for account in tried if account.laws[-1].usual]
            search.account = whole
    if not found:
        return
    search.account = min(found, key=search.score)
    gain = now - search.score(search.account)
    search.say("acts behind a gate", True, search.account.hypothesis.names[-1], gain=gain)
    search.tell_noise()
    search.account = _with_edges(search, search.account, FINER_MOVES)  # under the noise that is left now
    search.tell_noise()
    search.refit(SETTLE)
    search.eliminate()


def _behind_gates(search: Search, hoped: float, most: float) -> list[Account]:
    """Accounts with a law behind a gate that cost no more than `most`, of those that promise half of what is hoped."""
    promised = sorted(_promises(search), key=lambda f: -f[0])[:PROBED]
    tried = [
        _with_edges(search, _tried(search, search.account, law, values))
        for gain, law, values in promised
        if gain > 0.5 * hoped
    ]
    return [account for account in tried if search.score(account) <= most]


def _tried(search: Search, account: Account, law: Law, values: Sequence[float]) -> Account:
    """The account with a gated law, in the place of the same one without a gate where that stands."""
    same = [i for i, own in enumerate(account.laws) if own.key[:2] == law.key[:2]]
    laws, hypothesis = account.without(same)
    laws, hypothesis = (*laws, law), hypothesis.plus(law.term(values), law.candidate.declared)
    return search.fitted(laws, hypothesis, account.fit.starts, CLOSE)


def _promises(search: Search) -> Iterator[tuple[float, Law, list[float]]]:
    """Gain by lines of every law behind every gate that is scanned, with the values to start from."""
    account = search.account
    lines = Lines(search.shooting.slopes(account.fit), account.fit)
    for law in search.laws:
        effect = effect_of(law.candidate.family)
        stands = [i for i, own in enumerate(account.laws) if own.key == law.key]
        if not effect.gated or effect.drifts or law.candidate.variant:
            continue
        terms = [account.hypothesis.terms[i] for i in stands]
        standing = [t.values[p.name] for t in terms for p in law.candidate.declared]
        # A law that stands may be right in a part alone, with another size: beside itself it tells which.
        alone = law.has_slope or not stands
        _, beside = account.without([] if alone else stands)
        before = lines.slopes.r if alone else _white(search, beside)
        own, paid = law.candidate.declared[0], search.price(law) if stands else 0.0
        sizes = [standing] if stands else [list(values) for values in law.starts]
        tried = [nudged(law)] if law.has_slope else [(1.0, values) for values in sizes]
        linear = law.has_slope or (alone and law.grows)
        for step, values in tried:
            for gate, change in _changes(search, law, beside, values, before):
                owned = _priced(search, law, gate)
                price = search.price(owned) - paid
                if not linear:
                    yield lines.gain(before + change) - price, owned, list(values)
                    continue
                gain, size = lines.along(-change / ((values[0] - own.none) or step))
                first = size + (standing[0] if stands else own.none)
                if own.low <= first <= own.high:
                    yield gain - price, owned, [first, *values[1:]]


def _changes(
    search: Search, law: Law, beside: Hypothesis, values: Sequence[float], before: FloatArray
) -> Iterator[tuple[Gate, FloatArray]]:
    """What a law behind a gate changes in the residual (W, M) of an account `beside` it.

    Since a moment: in the windows after it. In runs of places: the sum of what it changes in each of them alone.
    """
    windows, names = search.shooting.problem.windows, search.shooting.problem.simulator.state.names

    def behind(gate: Gate) -> FloatArray:
        law_behind = replace(law.term(values), gate=gate)
        return _white(search, beside.plus(law_behind, law.candidate.declared)) - before

    whole = behind(Gate())
    if windows.own_clocks:
        for e in np.unique(windows.episode)[1:]:
            yield Gate(since_episode=int(e)), np.where((windows.episode >= e)[:, None], whole, 0.0)
    for since in np.quantile(windows.t[:, 0], np.linspace(EARLIEST, LATEST, MOMENTS)):
        yield Gate(since=float(since)), np.where((windows.t[:, 0] >= since)[:, None], whole, 0.0)
    site, coordinates = effect_of(law.candidate.family).site, search.shooting.problem.simulator.coordinates
    driven = [c.name for c in coordinates if site == "actuator" and law.has_slope and law.parameters == 1]
    for on in driven or [n for n in names if site == "force" and n == law.candidate.place.on]:
        visited = windows.measured[windows.valid][:, names.index(on)]
        edges = np.unique(np.quantile(visited, np.linspace(0.0, 1.0, PLACES + 1)))
        edges[0], edges[-1] = -BEYOND, BEYOND
        parts = [behind(Gate(region={on: (float(low), float(high))})) for low, high in pairwise(edges)]
        sums = np.cumsum([np.zeros_like(before), *parts], axis=0)
        for i, j in combinations(range(len(edges)), 2):
            if j - i < len(parts):
                yield Gate(region={on: (float(edges[i]), float(edges[j]))}), sums[j] - sums[i]


def _white(search: Search, hypothesis: Hypothesis) -> FloatArray:
    """(W, M) the whitened residual of a hypothesis from the account's start states."""
    starts = search.account.fit.starts
    left = search.shooting.residuals(hypothesis, hypothesis.theta[None], starts[None])[0]
    return np.asarray(np.nan_to_num(left * search.shooting.noise.whitening).reshape(len(starts), -1))


def _priced(search: Search, law: Law, gate: Gate) -> Law:
    """The law behind a gate; friction in a region has a name of its own."""
    candidate = law.candidate
    if gate.region and has_patch(candidate.family) and candidate.place.on in gate.region:
        candidate = replace(candidate, family="local_friction_patch")
    return replace(law, candidate=candidate, gate=gate, price=law.price + search.numbers.gate)


def _with_edges(search: Search, account: Account, moves: Sequence[float] = MOVES) -> Account:
    """The account with the edges of its last law's gate where they fit best."""
    gate, problem = account.laws[-1].gate, search.shooting.problem
    if gate.since_episode is not None:
        return account
    if gate.since is not None:
        width = float(np.ptp(problem.windows.t)) / (MOMENTS + 2)
    else:
        ((on, _),) = gate.region.items()
        column = problem.simulator.state.names.index(on)
        width = float(np.ptp(problem.windows.measured[problem.windows.valid][:, column])) / PLACES
    for share in moves:
        for edge, sign in product((0, 1), (-1.0, 1.0)):
            while (moved := _moved(account.laws[-1].gate, edge, sign * share * width)) is not None:
                tried = _behind(search, account, moved)
                if tried.fit.cost > account.fit.cost - LEAST:
                    break
                account = tried
    return account


def _moved(gate: Gate, edge: int, by: float) -> Gate | None:
    if gate.since is not None:
        return Gate(since=gate.since + by) if edge == 0 else None
    ((on, ends),) = gate.region.items()
    if abs(ends[edge]) >= BEYOND:
        return None
    new = list(ends)
    new[edge] += by
    return Gate(region={on: (new[0], new[1])}) if new[0] < new[1] else None


def _behind(search: Search, account: Account, gate: Gate) -> Account:
    last = len(account.laws) - 1
    laws = (*account.laws[:-1], replace(account.laws[-1], gate=gate))
    hypothesis: Hypothesis = account.hypothesis.gated(last, gate)
    return search.fitted(laws, hypothesis, account.fit.starts, FIRST_LOOK)


def trimmed(hypothesis: Hypothesis, problem: Problem) -> Hypothesis:
    """Regions that reach beyond what was visited end there."""
    names, windows = problem.simulator.state.names, problem.windows
    for i, term in enumerate(hypothesis.terms):
        region = {}
        for on, (low, high) in term.gate.region.items():
            x: FloatArray = windows.measured[windows.valid][:, names.index(on)]
            region[on] = (max(low, float(x.min())), min(high, float(x.max())))
        if region:
            hypothesis = hypothesis.gated(i, replace(term.gate, region=region))
    return hypothesis
