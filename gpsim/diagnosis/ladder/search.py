"""Rungs 1 and 2: all that is usual at once, what is unusual beside it, and what the recording does not ask for away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import (
    FEW_JOINTS,
    Fit,
    Hypothesis,
    Noise,
    Problem,
    Shooting,
    fit,
    sensor_noise,
    unexplained,
)
from gpsim.diagnosis.ladder.account import Account, Quadratic, bill, placed, price
from gpsim.diagnosis.ladder.laws import SERVO_GAINS, Law
from gpsim.diagnosis.ladder.offers import Offer, Offers, column
from gpsim.diagnosis.ladder.robots import BETTER, ROWS, Sized, Trials
from gpsim.effects import Scheme, Term, closed

INDEPENDENT = 1e-4  # of a column's square, that others must leave of it: else they are gauges of one another
Key = tuple[str, str, str]
# Rounds of a fit: among others, after a change, before a decision, to its end.
FIRST_LOOK, SETTLE, CLOSE, FINISH = 2, 5, 4, 10
LOOSE = 8.0  # nats that a batch of laws may cost together and still go without a fit between them
SETTLED = 12  # rounds of start states alone, which dry friction lets go but slowly
CHATTERING = 12  # rounds of a fit whose start states stay as measured: its valley is narrow
CHATTERS = np.geomspace(0.05, 20.0, 150)  # times a usual size, at which such friction is looked for
DRIVES, LEAVES = 2, 0.02  # laws that remember, at most; of a robot's misfit, left before any is asked
CRUMB = 0.01  # of a joint's usual force: no row that is so slight changes what it does
AS_BELIEVED = 0.03  # of a servo's gain or a mass: nobody knows these better beforehand
OF_ROWS = 10.0  # times the misfit that is a crumb otherwise: a robot's base whirls
PROBED = 3  # laws that are fitted of those that promise most


class Search:
    """A recording's laws on their way to an account."""

    def __init__(
        self, problem: Problem, held_out: Problem, laws: Sequence[Law], longer: Trials | None = None
    ) -> None:
        run = problem.run
        self.laws, self._trace = list(laws), run.trace
        self.numbers, self.verdict = run.settings.laws, run.settings.verdict
        self.shooting, self.held_out, self._longer = Shooting(problem), Shooting(held_out), longer
        starts = problem.windows.measured[:, 0]
        self.account = Account((), self.shooting.at(Hypothesis(), np.array(starts)))
        self.base = self.account.fit
        self.tried: list[Account] = []
        self.gauges: set[Key] = set()
        self.least = 0.0
        self.dear = closed(problem.simulator) is not None
        self.only_few = False  # few laws stand, so that what is dear elsewhere is asked of a robot, too

    def say(self, rule: str, taken: bool, *names: str, gain: float | None = None) -> None:
        """Write a decision down."""
        self._trace.note(names, self.account.hypothesis.names, taken, rule, gain=gain)

    # Prices

    def price(self, law: Law) -> float:
        """Nats that a law must bring."""
        own = price(law, self.shooting.noise.effective, self.numbers.law)
        return own if law.free else max(own, self.least)

    def score(self, account: Account) -> float:
        """What an account costs in all: less is better [nats]."""
        return account.fit.cost + bill(account.laws, self.shooting.noise.effective, self.numbers.law)

    def tell_noise(self) -> None:
        """The noise as the account leaves it, under which all that was tried is counted anew."""
        self.shooting.told_by(self.account.fit.residuals)
        self.account, *self.tried = (
            Account(a.laws, self.shooting.counted(a.fit)) for a in (self.account, *self.tried)
        )

    def refit(self, rounds: int) -> None:
        """The account fitted on."""
        self.account = Account(self.account.laws, self.shooting.fit(self.account.fit, rounds))

    def fitted(
        self, laws: tuple[Law, ...], hypothesis: Hypothesis, starts: FloatArray, rounds: int
    ) -> Account:
        """Other laws, fitted from where they are."""
        return Account(laws, self.shooting.fit(self.shooting.at(hypothesis, starts), rounds))

    def under_sensors(self) -> None:
        """The account as it is under the noise of sensors alone."""
        told = sensor_noise(self.shooting.problem, self.account.fit.residuals)
        self.shooting.noise = Noise(np.maximum(told, 1e-300), np.ones(len(told)), self.shooting.base_weights)
        self.account = Account(self.account.laws, self.shooting.counted(self.account.fit))

    # Rung 1

    def usual(self, known: Sized | None = None) -> None:
        """All usual laws at once: those with a slope from nothing, those without by scans; then the noise.

        known: what inverse dynamics say, with which alone a robot's laws begin, and which fits weigh as they weigh a
        prior: forces tell of friction what short rollouts hardly feel.
        """
        floats = self.dear and not known
        if floats:
            self.under_sensors()
        self.refit(3)
        self.base = self.account.fit
        if not floats:  # else all of its misfit would pass for correlated noise, under which no fit goes on
            self.tell_noise()
        if known:
            self.laws = [law.believed(known.values, known.deviations) for law in self.laws]
        usual = [law for law in self.laws if law.usual]
        if known:
            laws = tuple(
                law
                for law in self.laws
                if (law.candidate.identity in known.values and (law.usual or not law.candidate.variant))
                or (law.usual and law.of_servo)
            )
            hypothesis = Hypothesis()
            for law in laws:
                nothing = [p.none for p in law.candidate.declared]
                values = known.values.get(law.candidate.identity, nothing)
                hypothesis = hypothesis.plus(law.term(values), law.candidate.declared)
            begun = self.account = Account(laws, self.shooting.at(hypothesis, self.account.fit.starts))
            self.tell_noise()
        simulator = self.shooting.problem.simulator
        asked = {*(c.name for c in simulator.coordinates), *simulator.drives} if known else set[str]()
        rest = [
            law for law in usual if law.has_slope and not (self.account.holds(law) or (known and law.of_row))
        ]
        for law in self._independent([law for law in rest if law.candidate.place.on not in asked]):
            nothing = [p.starts[0] if p.place else p.none for p in law.candidate.declared]
            self.account = self._with(law, nothing)
        jumps = [law for law in usual if not law.has_slope]
        if floats:
            self.refit(SETTLE)
            self._all_alike(jumps)
        for _ in range(0 if known else len(jumps) + 1):
            self.refit(FIRST_LOOK)
            found = self.offers([law for law in jumps if not self.account.holds(law)])
            if not found:
                break
            best = max(found, key=lambda o: o.gain - self.price(o.law))
            if best.gain < self.price(best.law):
                break
            self.account = self._with(best.law, best.values)
            self.say("started from", True, best.law.name, gain=best.gain)
        for _ in range(1 if self.dear else 2):
            self.refit(FIRST_LOOK if self.dear else SETTLE)
            self.tell_noise()
        self.refit(1 if self.dear else CLOSE)
        if known and not any(on.endswith(SERVO_GAINS) for _, on in known.values):
            self._as_servos_are_believed(begun)
        if not self.dear:  # else `unusual` asks for them, beside what pays
            self._probe(jumps)

    def _as_servos_are_believed(self, begun: Account) -> None:
        """The same begun without any servo's gains, where that is better: together they make up for much."""
        gains = [i for i, law in enumerate(begun.laws) if law.of_servo and not law.free]
        if gains:
            laws, plain = begun.without(gains)
            point = self.shooting.at(plain, begun.fit.starts)
            without = Account(laws, self.shooting.fit(point, SETTLE))
            if self.score(without) < self.score(self.account):
                self.say("is as believed", True, *(begun.laws[i].name for i in gains))
                self.account = without

    def _all_alike(self, laws: Sequence[Law]) -> None:
        """The same delay or lag of all commands, while that pays: buses are late for all, rotors are of one kind."""
        families = dict.fromkeys(law.candidate.family for law in laws)
        groups = [[law for law in laws if law.candidate.family == family] for family in families]
        for _ in families:
            self.refit(SETTLE)
            self.tell_noise()
            offers = Offers(self.shooting, self.account.fit)
            absent = [group for group in groups if len(group) > 1 and not self.account.holds(group[0])]
            found = [(*offers.together(group), group) for group in absent]
            gain, values, group = max(found, key=lambda f: f[0], default=(0.0, (), []))
            if gain < sum(self.price(law) for law in group) or not group:
                return
            for law in group:
                self.account = self._with(law, values)
            self.say("started from", True, *(law.name for law in group), gain=gain)

    def _with(self, law: Law, values: Sequence[float]) -> Account:
        laws, hypothesis = self.account.plus(law, values)
        return Account(laws, self.shooting.at(hypothesis, self.account.fit.starts))

    def _independent(self, laws: Sequence[Law]) -> list[Law]:
        """Without those that others make up for exactly: a mass beside a gain, when all forces are free."""
        kept: list[Law] = []
        basis: FloatArray | None = None
        slopes = self.shooting.slopes(self.account.fit, parameters=False)
        for law in laws:
            own = slopes.off_starts(column(self.shooting, self.account.fit, law))[:, :, 0].ravel()
            size = float(own @ own)
            left = own
            if basis is not None and size > 0:
                for _ in range(2):
                    left = left - basis @ (basis.T @ left)
            rest = float(left @ left)
            if size <= 0.0 or rest < INDEPENDENT * size:
                self.say("others make up for it", False, law.name)
                self.gauges.add(law.key)
                continue
            unit = (left / np.sqrt(rest))[:, None]
            basis = unit if basis is None else np.concatenate([basis, unit], axis=1)
            kept.append(law)
        return kept

    def in_other_steps(self, own: Scheme) -> None:
        """The base's own step in the place of fine ones, or these in its, where the account explains more with them."""
        if own == "fine" or self.dear:
            return
        before = self.account
        scheme: Scheme = own if before.hypothesis.scheme == "fine" else "fine"
        other_steps = replace(before.hypothesis, scheme=scheme)
        stepped = [self.fitted(before.laws, other_steps, before.fit.starts, SETTLE)]
        dry = [law for law in self.laws if law.usual and law.dry and scheme == own]
        stepped += [account for law in dry for account in self._chattering(law, scheme)]
        for other in stepped:
            gain = max(
                self.needed(self.account) - self.needed(other),
                self.profiled(other) - self.profiled(self.account),
            )
            if gain > self.numbers.surely:
                self.say("the base's own step" if scheme == own else "fine steps", True, scheme, gain=gain)
                self.account = other
        if self.account is not before:
            base = replace(self.base.hypothesis, scheme=scheme)
            self.base = self.shooting.fit(self.shooting.at(base, self.base.starts), 3)
            self.tell_noise()
            self.refit(SETTLE)
            if dry and len(self.account.laws) == 1:
                self._probe([law for law in self.laws if law.usual])

    def _chattering(self, law: Law, scheme: Scheme) -> list[Account]:
        """Dry friction alone, from start states as measured: where it chatters, these and other laws hide it.

        Its valleys are narrow and many: sizes are scanned, and fitted from the best.
        """
        first = law.candidate.declared[0]
        hypothesis = Hypothesis(scheme=scheme).plus(law.term([first.starts[0]]), law.candidate.declared)
        starts, sizes = np.array(self.shooting.problem.windows.measured[:, 0]), CHATTERS * first.starts[0]
        left = self.shooting.residuals(hypothesis, sizes[:, None], np.tile(starts, (len(sizes), 1, 1)))
        out = []
        for k in np.argsort(self.shooting.costs(left).sum(axis=1))[:PROBED]:
            point = self.shooting.at(hypothesis.having(sizes[k : k + 1]), starts)
            point = self.shooting.fit(point, CHATTERING, released=False)
            found = Account((law,), self.shooting.fit(point, SETTLE))
            own = self._ruler(found)  # what is exact shows under the noise that it leaves
            found = Account((law,), own.fit(own.counted(found.fit), SETTLE))
            out.append(Account((law,), self.shooting.counted(found.fit)))
        return out

    def needed(self, account: Account) -> float:
        """What an account would cost once what does not pay is taken away, by the quadratic [nats]."""
        prices = [self.price(law) for law in account.laws]
        gone = Quadratic(account).taken_away(prices, [law.free for law in account.laws])
        saved = sum(prices[less.index] - less.cost for less in gone)
        return self.score(account) - saved

    # What is absent

    def offers(self, laws: Sequence[Law]) -> list[Offer]:
        """Of each absent law what lines promise from its best start, all others following."""
        return Offers(self.shooting, self.account.fit).of(laws) if laws else []

    def _probe(self, laws: Sequence[Law]) -> None:
        """Absent laws with a jump in an exact fit each, while one of them pays: slopes mislead from a wrong place."""
        for _ in range(4):
            absent = [law for law in laws if not self.account.holds(law)]
            if not self.add_best(self.offers(absent), PROBED):
                return

    def add_best(self, offers: Sequence[Offer], most: int, starts: FloatArray | None = None) -> bool:
        """The absent law that pays most of those that promise most, in an exact fit; whether one pays.

        starts: (W, S) start states from which they are fitted, of the account where none are given.

        A law is worth what it gains under the noise as it is, or under the noise that it leaves, if that is more: a
        mismatch that is large makes its own noise.
        """
        if not self.account.laws and self.left() <= 0.0:
            return False
        found = sorted(offers, key=lambda o: self.price(o.law) - o.gain)[:most]
        best, most_worth, before = None, self.numbers.surely, self.profiled(self.account)
        starts = self.account.fit.starts if starts is None else starts
        for offer in found:
            added, hypothesis = self._without(self._held(offer.law)).plus(offer.law, offer.values)
            tried = self.fitted(added, hypothesis, starts, 3)
            gain, price = self.account.fit.cost - tried.fit.cost, self.price(offer.law)
            if gain > max(price, most_worth if self.dear else 0.0) / 2:
                tried = Account(added, self.shooting.fit(tried.fit, SETTLE))
                gain = self.account.fit.cost - tried.fit.cost
            self.tried.append(tried)
            profiled, ruler = self.profiled(tried) - before, self.shooting
            worth, brought = max(gain, profiled) - price, gain
            if profiled > self.numbers.hidden * max(gain, self.numbers.unusual):
                ruler = self._ruler(tried)
                had, has = (ruler.costs(a.fit.residuals).sum() for a in (self.account, tried))
                brought = float(had - has)
            enough = brought - min(price, brought / 2) >= self.enough(offer.law, ruler)
            if worth > most_worth and enough and not self.strange(tried, offer.law):
                best, most_worth = tried, worth
        if best is None:
            return False
        had, self.account = self.account, best
        self.tell_noise()
        self.refit(SETTLE)
        self.tell_noise()
        self.refit(CLOSE)
        pays = self.freely(had) >= BETTER * self.freely(self.account)
        rule = "pays beside the others" if pays else "held-out simulations are worse with it"
        self.say(rule, pays, best.laws[-1].name, gain=most_worth)
        if not pays:
            self.account = had
            self.tell_noise()
        return pays

    def profiled(self, account: Account) -> float:
        """Nats that an account gains with the noise profiled out: with as many samples as its own residual has."""
        now, other = self.shooting.noise, self._ruler(account).noise
        counts = (now.weights > 0).sum(axis=(0, 1)) / other.times
        gains = counts * np.log(now.white / other.white)
        return float(gains[self.shooting.problem.observed].sum())

    def _ruler(self, account: Account) -> Shooting:
        """The same windows under the noise that an account leaves."""
        other = Shooting(self.shooting.problem)
        other.told_by(account.fit.residuals)
        return other

    def enough(self, law: Law, by: Shooting | None = None) -> float:
        """Nats beyond its price that a law must bring: a part of what is left, and more of it where it is unusual."""
        by = by or self.shooting
        left = unexplained(by.problem, replace(self.account.fit, noise=by.noise))
        if law.price < self.numbers.unusual:
            share = self.numbers.share if law.usual else self.numbers.share_of_drag
            return max(1.0, share * left)
        missing = float(by.costs(self.base.residuals).sum())
        least = min(self.numbers.material * missing, self.numbers.nearly_all * left)
        return max(1.0, self.numbers.share_of_unusual * left, least)

    def missing(self) -> float:
        """Nats of the base's misfit under the noise as it is now."""
        return float(self.shooting.costs(self.base.residuals).sum())

    def left(self) -> float:
        """Nats of misfit beyond the sensors' noise."""
        return unexplained(self.shooting.problem, self.account.fit)

    # Rung 2

    def unusual(self) -> None:
        """Unusual laws beside the usual ones, one at a time, while one pays its price and a part of what is left."""
        few = len(self.shooting.problem.simulator.coordinates) <= FEW_JOINTS
        least = LEAVES if few else self.numbers.robot_leaves
        if self.dear and self.left() < least * self.missing():
            return
        for _ in range(2 if self.dear else 6):
            asked = [law for law in self.laws if not (self.dear and law.stiff)]
            if not self.add_best(
                self.offers([law for law in asked if not self.account.holds(law)]), PROBED + 1
            ):
                return

    def drives(self) -> None:
        """Laws that remember, of the joint of a robot that misses what was read by most: they are dear to simulate."""
        problem = self.shooting.problem
        for _ in range(DRIVES if self.dear else 0):
            if self.left() < LEAVES * self.missing():
                return
            times = np.sqrt((self.account.fit.residuals**2).mean(axis=(0, 1)))
            times *= problem.observed / (sensor_noise(problem, self.account.fit.residuals) + 1e-300)
            by = dict(zip(problem.simulator.state.names, times, strict=True))
            worst = max(problem.simulator.coordinates, key=lambda c: max(by[c.name], by[c.velocity])).name
            here = [
                law for law in self.laws if law.stiff and not law.candidate.variant and self._at(law) == worst
            ]
            promised = self._of_drives([law for law in here if not self.account.holds(law)])
            if not promised or not self.add_best(promised, PROBED):
                return

    def _at(self, law: Law) -> str:
        """The coordinate at which a law of drives acts."""
        on = law.candidate.place.on
        return self.shooting.problem.simulator.coupled().get(on, (on,))[0]

    def _held(self, law: Law) -> int | None:
        """What stands in the account and a law of drives is when nothing yields: a rotor, or dry friction."""
        held = law.stiff if self.dear else "", self._at(law)
        every = (i for i, own in enumerate(self.account.laws) if own.candidate.identity == held)
        return next((i for i in every if not self.account.laws[i].free), None)

    def _without(self, index: int | None) -> Account:
        """The account without a law, not fitted."""
        if index is None:
            return self.account
        laws, hypothesis = self.account.without([index])
        return Account(laws, self.shooting.at(hypothesis, self.account.fit.starts))

    def _of_drives(self, laws: Sequence[Law]) -> list[Offer]:
        """Offers that pay, beside the account or in the place of what a law of drives is when nothing yields."""
        out, offers = list[Offer](), Offers(self.shooting, self.account.fit)
        coupled = self.shooting.problem.simulator.coupled()
        for law in laws:
            if (index := self._held(law)) is None:
                out += offers.of([law])
                continue
            ((name, size),) = self.account.hypothesis.terms[index].values.items()
            if law.candidate.place.on in coupled:
                size /= coupled[law.candidate.place.on][1]
            i = [p.name for p in law.candidate.declared].index(name)
            sized = replace(law, starts=tuple((*s[:i], size, *s[i + 1 :]) for s in law.starts))
            rows, part = self.account.rows[index], self._without(index).fit
            (found,) = offers.in_place([sized], self.account.laws[index], rows, part)
            out.append(Offer(found.gain - offers.lost(rows, part), law, found.values))
        return [o for o in out if o.gain > self.price(o.law)]

    def on_all(self, everything: Problem) -> bool:
        """The account on all windows, on which what is slight shows; whether it was sought on fewer."""
        if self.dear or len(everything.windows) == len(self.shooting.problem.windows):
            return False
        self.shooting, starts = Shooting(everything), np.array(everything.windows.measured[:, 0])
        self.base = self.shooting.fit(self.shooting.at(self.base.hypothesis, starts), CLOSE)
        begun = fit(everything, self.account.hypothesis.frozen(), starts, SETTLED)
        self.shooting.told_by(begun.residuals)
        self.account = Account(self.account.laws, self.shooting.at(self.account.hypothesis, begun.starts))
        self.refit(FINISH)
        self.tried.clear()
        self.tell_noise()
        self.refit(FINISH)
        return True

    # Taking away

    def eliminate(self) -> None:
        """Laws that do not pay go, in batches by the quadratic, each fitted; one that costs more is halved."""
        limit, locked = LOOSE, set[Key]()
        for _ in range(30):
            account = self.account
            kept = [law.key in locked or law.free for law in account.laws]
            gone = Quadratic(account).taken_away([self.price(law) for law in account.laws], kept)
            if not gone:
                return
            foretold = np.cumsum([less.cost for less in gone])
            count = max(int((foretold <= limit).sum()), 1)
            batch = [less.index for less in gone[:count]]
            paid = sum(self.price(account.laws[i]) for i in batch)
            rest = self.without(account, batch, placed(account.hypothesis, gone[count - 1].z), 3)
            if rest.fit.cost - account.fit.cost > paid:
                rest = Account(rest.laws, self.shooting.fit(rest.fit, SETTLE))
            rise = rest.fit.cost - account.fit.cost
            names = [account.laws[i].name for i in batch]
            if rise > paid:
                if count == 1:
                    locked.add(account.laws[batch[0]].key)
                limit = 0.0 if count > 1 else limit
                self.say("is needed", False, *names, gain=-rise)
                continue
            limit = max(limit, LOOSE)
            self.say("does not pay", True, *names, gain=paid - rise)
            self.tried.append(rest)
            self.account = rest

    def through_gauges(self) -> None:
        """Of laws that make up for each other exactly the one stays out without which the fewest are needed.

        Where thrust is uncertain, masses that are off are so in the measure of all gains together.
        """
        for law in [law for law in self.laws if law.key in self.gauges and law.is_ratio]:
            whole = self._with(law, [p.none for p in law.candidate.declared])
            whole = Account(whole.laws, self.shooting.fit(whole.fit, 1))
            around, prices = Quadratic(whole), [self.price(own) for own in whole.laws]
            kept = [own.free for own in whole.laws]
            ratios = [i for i, own in enumerate(whole.laws) if own.is_ratio and around.cost(i) < prices[i]]
            rest = {i: around.taken_away(prices, kept, i) for i in ratios}
            bills = {
                i: sum(less.cost - prices[less.index] for less in gone) for i, gone in rest.items() if gone
            }
            best = min(bills, key=lambda i: bills[i], default=len(whole.laws) - 1)
            if whole.laws[best].key != law.key:
                self.say(f"makes up for {whole.laws[best].name}", True, law.name)
                adapted = placed(whole.hypothesis, around.without([best]))
                self.account = self.without(whole, [best], adapted, SETTLE)

    def without(self, account: Account, gone: Sequence[int], adapted: Hypothesis, rounds: int) -> Account:
        """An account without some laws, from where the quadratic says the others are, or from where they were."""
        laws, plain = account.without(gone)
        foretold = adapted.without_all(gone)
        starts = account.fit.starts
        points = [self.shooting.at(h, starts) for h in (foretold, plain)]
        best = min(points, key=lambda p: p.cost)
        return Account(laws, self.shooting.fit(best, rounds))

    def drop_each(self) -> dict[Key, Account]:
        """Exact fits without each law; what does not pay goes. What each account without one is, by the law's key."""
        while True:
            less, worst = dict[Key, Account](), None
            around = Quadratic(self.account)
            for i, law in enumerate(self.account.laws):
                if law.free:
                    continue
                adapted = placed(self.account.hypothesis, around.without([i]))
                rounds = FIRST_LOOK if around.cost(i) > 150.0 else CLOSE
                rounds = FINISH if self.only_few else rounds
                less[law.key] = self.without(self.account, [i], adapted, rounds)
                behind = less[law.key].fit.cost - self.account.fit.cost - self.price(law)
                if behind < 0 and (worst is None or behind < worst[0]):
                    worst = behind, law
            if worst is None:
                self.tried += less.values()
                return less
            self.say("does not pay", True, worst[1].name, gain=-worst[0])
            self.account = less[worst[1].key]
            self.refit(FIRST_LOOK)

    def strange(self, account: Account, law: Law) -> bool:
        """Whether an unusual law has a size that no machine has."""
        if law.usual or law.free:
            return False
        index = next(i for i, own in enumerate(account.laws) if own.key == law.key)
        return account.hypothesis.times_beyond(index) > 1.0

    def later(self, account: Account) -> float:
        """Nats that an account costs on held-out windows, whose start states alone are fitted."""
        return float(self.judged(account).costs.sum())

    def freely(self, account: Account) -> float:
        """What simulations of what is held out miss with an account, in what they miss with the base.

        Of robots, and as long as those by which accounts are judged in the end: in short windows softer servos and
        loads pass for dry friction, which holds for seconds what these let go.
        """
        return float(self._longer.share(account.hypothesis).mean()) if self._longer else 0.0

    def judged(self, account: Account) -> Fit:
        """An account on held-out windows."""
        shooting, noise = self.held_out, self.shooting.noise
        shooting.noise = Noise(noise.white, noise.times, shooting.base_weights)
        point = shooting.at(account.hypothesis.frozen(), np.array(shooting.problem.windows.measured[:, 0]))
        return shooting.fit(point, 8) if len(point.starts) else point

    # What the user requires

    def require(self) -> None:
        """What the user requires and the account lacks, fitted; where it does nothing it goes again."""
        for law in self.laws:
            if law.free and not self.account.holds(law):
                (offer,) = self.offers([law])
                laws, hypothesis = self.account.plus(law, offer.values)
                self.account = self.fitted(laws, hypothesis, self.account.fit.starts, SETTLE)

    def why_not(self, account: Account) -> str:
        """Why an account that explains more does not lead."""
        names = [law.name for law in account.laws if not self.account.holds(law)]
        strange = [law.name for law in account.laws if self.strange(account, law)]
        unusual = [law.name for law in account.laws if not law.usual and not self.account.holds(law)]
        if strange:
            return f"no machine has {strange[0]} of that size"
        if unusual:
            return f"{unusual[0]} removes too little of the remaining error"
        return (
            f"held-out data do not improve with {names[0]}"
            if names
            else "held-out data do not improve with it"
        )

    # Held out

    def crumbs(self) -> None:
        """Rows that make next to nothing of what their joint is usually moved by pay as any law does, or go.

        One by one every row of a robot is told of: on a clean log also those of friction that it does not have.
        """
        least = OF_ROWS * self.numbers.crumb * self.missing()
        while True:
            laws, terms = self.account.laws, self.account.hypothesis.terms
            slight = [
                law.owned and law.usual and not law.free and _slight(law, term)
                for law, term in zip(laws, terms, strict=True)
            ]
            prices = [
                max(price(replace(law, of_row=False), self.shooting.noise.effective, self.numbers.law), least)
                for law in laws
            ]
            gone = Quadratic(self.account).taken_away(prices, [not s for s in slight])
            if not gone:
                return
            self.say(
                "is a negligible part of the forces of its joint", True, *(laws[g.index].name for g in gone)
            )
            adapted = placed(self.account.hypothesis, gone[-1].z)
            self.account = self.without(self.account, [g.index for g in gone], adapted, CLOSE)

    def judge_held_out(self) -> None:
        """What is worth nothing on held-out windows goes, unusual laws first; what training asks for stays.

        So does what is a crumb of the base's misfit: on clean data every law would stand.
        """
        self.least = self.numbers.crumb * self.missing()
        while self.only_few or not self.dear:
            less = self.drop_each()
            if not len(self.held_out.problem.windows):
                return
            mine, bad = self.judged(self.account), None
            left = unexplained(self.held_out.problem, mine) + self.left()
            for law in self.account.laws:
                if law.key not in less:
                    continue
                gains = self.judged(less[law.key]).costs - mine.costs
                gain, sd = float(gains.sum()), float(np.sqrt(len(gains)) * gains.std())
                trained = less[law.key].fit.cost - self.account.fit.cost - self.price(law)
                short = min(gain + 0.5 * sd + self.numbers.harmless * trained, gain + trained)
                if not law.usual:
                    short = min(short, gain + trained - self.numbers.held_out * left)
                if short < 0 and (bad is None or (law.usual, short) < bad[:2]):
                    bad = law.usual, short, law
            if bad is None:
                return
            self.say("held-out windows do not improve with it", True, bad[2].name, gain=bad[1])
            self.account = less[bad[2].key]
            self.refit(FIRST_LOOK)


def _slight(law: Law, term: Term) -> bool:
    """Whether a row makes less than a hundredth of what its joint is usually moved by, or is as good as believed."""
    place, (size, *_) = law.candidate.place, term.values.values()
    if law.is_ratio:
        return abs(size - 1.0) < AS_BELIEVED
    usual = place.span / (place.speed if term.family == "viscous_friction" else 1.0)
    return term.family in ROWS and abs(size) < CRUMB * usual
