"""The ladder: from what a recording asks to an account, rung by rung; each rung sees only what those below leave.

0. Facts of the log are taken off beforehand (`gpsim.diagnosis.setup`); pushes from outside, once the usual machine is
   known.
1. All that is usual on a machine of the kind is fitted at once, and what does not pay goes.
2. Unusual laws, beside them, one at a time; a law behind a gate; substitutes of each law in its place.
3. A measured curve of one input, on top.

The fourth rung, the Gaussian process on the rest, is in `gpsim.diagnosis.assessment`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from gpsim.diagnosis.data import cut, held_out_mask
from gpsim.diagnosis.fitting import Candidate, Fit, Hypothesis, Problem, Shooting, fit, unexplained, whiteness
from gpsim.diagnosis.judging import Judgement, Tried, horizon_of, probabilities_of, rivals_among
from gpsim.diagnosis.ladder.account import Account, Quadratic, placed, told
from gpsim.diagnosis.ladder.curves import beside, curved, inputs
from gpsim.diagnosis.ladder.few import few_are_better, few_suffice
from gpsim.diagnosis.ladder.gates import gated, trimmed
from gpsim.diagnosis.ladder.laws import Law, kind_of, laws_of
from gpsim.diagnosis.ladder.own_values import with_own_values
from gpsim.diagnosis.ladder.pushes import without_pushes
from gpsim.diagnosis.ladder.robots import BETTER, STIFF, TIED, Trials, by_inverse_dynamics
from gpsim.diagnosis.ladder.search import FINISH, Search
from gpsim.diagnosis.ladder.twins import swap
from gpsim.diagnosis.setup import PreparedProblem
from gpsim.effects import Measured, closed
from gpsim.findings import MeasuredCurve

FINER = 2  # times as many substeps as the search takes, on which what is left is judged
FINISH_OF_A_ROBOT = 3  # rounds of the last fit, where each is dear
MOST_CUT = 1000  # stretches of what is held out, of which some are simulated
RANKED = 6  # accounts of a robot that are judged on held-out windows, too, beside the leader
ZERO = "joint_offset"
WITHOUT = 4  # rounds of the fit of an account with one law less

Step = Callable[[str, int, str], None]


@dataclass(frozen=True)
class Climbed:
    """What a climb found.

    question: as it was asked in the end; curves: of the account; asked: place and input of every curve that was tried;
    bent: unusual laws that do not follow what they are named for, by family and place.
    """

    question: PreparedProblem
    judgement: Judgement
    curves: Mapping[tuple[str, str, str], MeasuredCurve]
    asked: frozenset[tuple[str, str]]
    bent: frozenset[tuple[str, str]]


def climb(question: PreparedProblem, offers: list[Candidate], step: Step) -> Climbed:
    """All rungs; raises nothing: where nothing pays, nothing is missing."""
    run = question.run
    known, simulator = run.known, question.everything.simulator
    every = laws_of(simulator, offers, run.settings.laws, known)

    step("rung 1", 10, "fitting all usual laws at once")
    search = _usual_machine(question, every)
    pushed = without_pushes(question, search)
    if pushed is not None:
        question = pushed
        search = _usual_machine(question, every)
    step("rung 1", 30, "testing substitutes for each law")
    if not search.only_few:
        swap(search)
    step("rung 2", 45, "looking for what is unusual")
    search.unusual()
    search.drives()
    search.eliminate()
    if search.on_all(question.everything):
        search.unusual()
        search.eliminate()
    gated(search)
    search.in_other_steps(question.recording.integrator)  # type: ignore[arg-type]  # `prepare` has checked it
    search.eliminate()
    _finer(search)
    swap(search)
    search.require()
    search.crumbs()
    search.judge_held_out()
    step("rung 2", 65, "comparing the recordings")
    with_own_values(search)
    laws = search.account
    step("rung 3", 70, "asking for measured curves")
    curves, bends = curved(search, offers)
    step("account", 75, "fitting the account on all windows")
    asked = (
        frozenset(one.of for one in inputs(simulator, offers)) if run.settings.curves.most else frozenset()
    )
    bent = frozenset(law.key[:2] for law in laws.laws if not law.usual and law.candidate.place.on in bends)
    return Climbed(*_finished(question, search, laws), curves, asked, bent)


def _usual_machine(question: PreparedProblem, laws: list[Law]) -> Search:
    """Rung 1."""
    simulator, sized, few, longer = question.everything.simulator, None, None, None
    if dear := closed(simulator) is not None:
        offers = [law.candidate for law in laws if not law.candidate.variant]
        longer = _rollouts(question, offers)
        sized = by_inverse_dynamics(question.everything, question.recording, offers, longer)
        # Forces alone tell a drive that turns with two joints from what either does; to simulate each would be dear.
        told = sized.values if sized else {}
        laws = [
            law
            for law in laws
            if law.free or law.candidate.family not in TIED or law.candidate.identity in told
        ]
    if kind_of(simulator) == "robot" and not (sized and sized.rubs):
        # An encoder's zero is as likely to be off as an amplifier's, where rows do not ask for all of one of them.
        prices = [0.0 if law.candidate.family == ZERO else law.price for law in laws]
        laws = [replace(law, of_row=False, price=p) for law, p in zip(laws, prices, strict=True)]
        few = Search(question.searched, question.held_out, laws)
        few.only_few = few_suffice(few)
        if few.only_few:
            return few
    search = Search(question.searched, question.held_out, laws, longer)
    search.usual(sized)
    if sized and sized.as_believed:
        believed = [law for law in laws if law.free or not law.candidate.place.on.endswith(STIFF)]
        other = Search(question.searched, question.held_out, believed, longer)
        other.usual(sized.as_believed)
        if other.freely(other.account) < BETTER * search.freely(search.account):
            other.say("servos are as stiff as believed", True)
            other.tried.append(search.account)
            search = other
    search.in_other_steps(question.recording.integrator)  # type: ignore[arg-type]  # `prepare` has checked it
    if dear:
        search.through_gauges()
    search.eliminate()
    if few and few_are_better(few, search):
        few.only_few = True
        return few
    return search


def _rollouts(question: PreparedProblem, offers: list[Candidate]) -> Trials | None:
    """Simulations of what is held out, as long as those by which accounts are judged in the end."""
    recording, settings = question.recording, question.run.settings.windows
    windows = cut(recording, settings, horizon_of(question), most=MOST_CUT)
    held = windows.take(held_out_mask(recording, windows))
    return Trials(question.held_out.on(held), offers) if len(held) else None


def _finer(search: Search) -> None:
    """The account on a finer grid: slight laws that made up for coarse steps go."""
    problem = search.shooting.problem
    if closed(problem.simulator) is not None or search.account.hypothesis.scheme != "fine":
        return
    for shooting in (search.shooting, search.held_out):
        shooting.problem = replace(shooting.problem, substeps=FINER * problem.substeps)
    account = search.account
    point = search.shooting.at(account.hypothesis, account.fit.starts)
    search.account = Account(account.laws, search.shooting.fit(point, WITHOUT))
    search.tried.clear()
    search.tell_noise()


def _finished(question: PreparedProblem, search: Search, laws: Account) -> tuple[PreparedProblem, Judgement]:
    """The account on all windows, in the catalogue's words; the base beside it, and what else was tried.

    laws: the account without its curves, which stand on top of them as they are.
    """
    everything = replace(question.everything, substeps=search.shooting.problem.substeps)
    question = replace(
        question, everything=everything, held_out=replace(question.held_out, substeps=everything.substeps)
    )
    hypothesis = trimmed(told(laws), everything)
    begun = None if search.dear else search.account.fit.starts  # all windows were fitted already
    leader = fit(everything, hypothesis, begun, FINISH_OF_A_ROBOT if search.dear else FINISH)
    whole, known = search.account.hypothesis, len(laws.laws)
    for term, declared in zip(whole.terms[known:], whole.declared[known:], strict=True):
        alone = leader.hypothesis.frozen().plus(term, declared)
        leader = beside(leader, fit(everything, alone, leader.starts, WITHOUT, leader.noise), declared)
    hypothesis = leader.hypothesis
    null = fit(everything, Hypothesis(scheme=hypothesis.scheme), rounds=WITHOUT, noise=leader.noise)
    without = _without(everything, leader)
    p_value = whiteness(everything, leader)
    chance = question.run.settings.verdict.chance
    least = chance if hypothesis.terms else chance**2
    left = unexplained(everything, leader)
    search.account = laws
    ranking = _ranking(search, leader.hypothesis)
    rivals = rivals_among(ranking[1:], leader.hypothesis, question.run.settings.verdict)
    fits = tuple(fit(everything, r.hypothesis, leader.starts, WITHOUT, leader.noise) for r in rivals)
    judgement = Judgement(
        leader,
        null,
        tuple(f.hypothesis for f in without),
        tuple(_worth(f, leader, i, ranking) for i, f in enumerate(without)),
        fits,
        probabilities_of(rivals),
        tuple(ranking),
        leader.noise.white,
        p_value,
        p_value < least and left > 0.0,
    )
    return question, judgement


def _without(problem: Problem, leader: Fit) -> tuple[Fit, ...]:
    """The account without each of its terms, the others fitted from where the quadratic says they are.

    A robot's are where it says: only start states are fitted, since each simulation is dear.
    """
    shooting, around = Shooting(problem, leader.noise), Quadratic(Account((), leader))
    rest = [around.without([i]) for i in range(len(leader.hypothesis.terms))]
    adapted = [placed(leader.hypothesis, z) for z in rest]
    if closed(problem.simulator) is not None:
        slopes = shooting.slopes(leader)
        follow = slopes.projected()[2]
        starts = [leader.starts - follow @ (z - leader.z) for z in rest]
        points = [shooting.at(h.without(i), starts[i]) for i, h in enumerate(adapted)]
        return tuple(shooting.starts_alone(point, slopes)[0] for point in points)
    out = []
    for i, h in enumerate(adapted):
        points = [
            shooting.at(_with_held_curves(one.without(i)), leader.starts) for one in (h, leader.hypothesis)
        ]
        out.append(shooting.fit(min(points, key=lambda p: p.cost), WITHOUT))
    return tuple(out)


def _worth(part: Fit, leader: Fit, index: int, ranking: list[Tried]) -> float:
    """Nats that a term is worth: against the account without it, and against the best other account that lacks it."""
    claim = leader.hypothesis.terms[index].identity
    others = [r.behind for r in ranking if claim not in r.hypothesis.claims and not r.refused]
    return min([part.cost - leader.cost, *others])


def _with_held_curves(hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis whose curves stand as they are."""
    both = zip(hypothesis.terms, hypothesis.declared, strict=True)
    return replace(hypothesis, declared=tuple(() if isinstance(t.effect, Measured) else d for t, d in both))


def _ranking(search: Search, leader: Hypothesis) -> list[Tried]:
    """All that was tried on the last grid, the leader first, then the best first, one of the same claims each."""
    own, mine = search.score(search.account), None
    found, checked = {_key(leader): Tried(leader, 0.0)}, RANKED if search.dear else len(search.tried)
    for account in sorted(search.tried, key=search.score):
        hypothesis = told(account)
        key, behind = _key(hypothesis), search.score(account) - own
        if key in found or not hypothesis.terms or (behind < 0 and len(found) > checked):
            continue
        refused = ""
        if behind < search.verdict.tie and len(found) <= checked:
            mine = search.later(search.account) if mine is None else mine
            after = search.later(account) - mine
            behind = max(behind + after, after) if behind + after > 0 else behind
            refused = search.why_not(account) if behind < 0 else ""
            behind = max(behind, 0.0) if not refused else behind
        found[key] = Tried(hypothesis, float(behind), refused)
    first, *others = found.values()
    return [first, *sorted(others, key=lambda t: t.behind)]


def _key(hypothesis: Hypothesis) -> object:
    return hypothesis.scheme, frozenset((t.identity, t.variant, bool(t.gate)) for t in hypothesis.terms)
