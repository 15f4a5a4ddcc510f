"""Twins: what could stand in for each law, fitted in its place.

Lines order the substitutes and decide nothing: of those that promise most, and of what is a law's gauge, the account is
fitted with the one in the other's place. The better one leads, the others are rivals.
"""

from __future__ import annotations

from dataclasses import replace

from gpsim.diagnosis.fitting import Hypothesis, unexplained
from gpsim.diagnosis.ladder.account import Account, Quadratic, placed
from gpsim.diagnosis.ladder.laws import Law
from gpsim.diagnosis.ladder.offers import Offers
from gpsim.diagnosis.ladder.search import CLOSE, FINISH, FIRST_LOOK, PROBED, Key, Search

ROUNDS = 6  # laws that change their place, at most
HOPELESS = 40.0  # nats behind, from which a twin is not fitted to its end
MISLED = 0.6  # or of what the law is worth, by which lines may be wrong of another one in its place


def swap(search: Search) -> None:
    """Each law's nearest substitutes in its place, fitted; the account moves while one is better.

    Not where every fit is of a whole robot: its regression has compared what may stand in for what.
    """
    done = set[tuple[object, ...]]()
    for _ in range(ROUNDS if search.only_few or not search.dear else 0):
        less = search.drop_each()
        order = sorted(less, key=lambda key: less[key].fit.cost)
        if not any(_replaced(search, key, less[key], done) for key in order):
            return
        search.tell_noise()
        search.refit(CLOSE)


def _replaced(search: Search, key: Key, part: Account, done: set[tuple[object, ...]]) -> bool:
    """Whether one stands in for a law; part: the account without that."""
    account, now = search.account, search.score(search.account)
    index = next(i for i, law in enumerate(account.laws) if law.key == key)
    law, names = account.laws[index], tuple(sorted(law.key for law in account.laws))
    absent = [o for o in search.laws if not account.holds(o) and (key, o.key, names) not in done]
    if search.dear:
        absent = [o for o in absent if not o.stiff]
    missed = search.score(part) - now
    misled = max(HOPELESS, MISLED * missed)
    offered = Offers(search.shooting, account.fit).in_place(absent, law, account.rows[index], part.fit)
    near = [o for o in offered if o.gain - search.price(o.law) > missed - misled]
    near = sorted(near, key=lambda o: search.price(o.law) - o.gain)[:PROBED]
    gauges = {o.key for o in absent if law.is_ratio and o.is_ratio and o.key in search.gauges}
    near += [o for o in offered if o.law.key in gauges and o not in near]
    for offer in near:
        other, starts = offer.law, part.fit.starts
        done.add((key, other.key, names))
        laws, hypothesis = part.plus(other, offer.values)
        if other.key in gauges:
            laws, hypothesis, starts = (*_in_gauge(account, index, other), account.fit.starts)
        tried = search.fitted(laws, hypothesis, starts, FIRST_LOOK)
        if search.score(tried) > now + max(HOPELESS, misled / 2):
            continue
        tried = _leaner(search, Account(laws, search.shooting.fit(tried.fit, FINISH)), other)
        search.tried.append(tried)
        gain = now - search.score(tried)
        if gain < _enough(search, law, other, tried) or search.strange(tried, other):
            continue
        if gain + search.later(account) - search.later(tried) > search.numbers.surely:
            search.say(f"stands in for {law.name}", True, other.name, gain=gain)
            search.account = tried
            return True
    return False


def _in_gauge(account: Account, index: int, other: Law) -> tuple[tuple[Law, ...], Hypothesis]:
    """The account with a ratio in another one's place, as much the other way, as all forces are then.

    A mass and a motor's gain: where all forces are free, lines cannot tell how far one is from the other.
    """
    (ratio,) = account.hypothesis.terms[index].values.values()
    laws, hypothesis = account.without([index])
    terms = []
    for term, declared in zip(hypothesis.terms, hypothesis.declared, strict=True):
        size = declared[0].name if term.effect.site == "force" and declared[0].unit != "1" else None
        values = {name: value / ratio if name == size else value for name, value in term.values.items()}
        terms.append(replace(term, values=values))
    scaled = replace(hypothesis, terms=tuple(terms))
    return (*laws, other), scaled.plus(other.term([1.0 / ratio]), other.candidate.declared)


def _leaner(search: Search, account: Account, kept: Law) -> Account:
    """An account without what no longer pays beside a law."""
    prices = [search.price(law) for law in account.laws]
    held = [law.key == kept.key or law.free for law in account.laws]
    gone = Quadratic(account).taken_away(prices, held)
    if not gone:
        return account
    less = search.without(account, [g.index for g in gone], placed(account.hypothesis, gone[-1].z), FINISH)
    return less if search.score(less) < search.score(account) else account


def _enough(search: Search, law: Law, other: Law, tried: Account) -> float:
    """Nats by which a law must be better in another's place: usual ones stand until a good part is at stake.

    Or where one unusual law does what takes several usual ones, and hardly anything is left then.
    """
    if other.price <= law.price:
        return search.numbers.surely
    fewer = len(tried.laws) < len(search.account.laws)
    rest = unexplained(search.shooting.problem, tried.fit)
    if fewer and rest < (1.0 - search.verdict.nearly_all) * search.left():
        return search.numbers.unusual
    return search.enough(other)
