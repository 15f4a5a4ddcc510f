"""Every task as soon as what it waits for is done, in the order of the plan, on whichever executor."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence

from gpsim.errors import UsageError
from gpsim.launchers.launcher import Launcher
from gpsim.launchers.opening import opened
from gpsim.launchers.tasks import Executor, Outcome, Task, Update


def run_tasks(
    launcher: Launcher, tasks: Sequence[Task], update: Update, *, keep_going: bool = False
) -> Iterator[Outcome]:
    """How each task ended, as they end.

    The first failure stops the rest and is raised; with `keep_going` it is an outcome like others, and those that wait
    for it fail with it. Nothing is started where there is nothing to do.
    """
    if tasks:
        with opened(launcher) as executor:
            yield from _run(executor, tasks, update, keep_going)


def _run(executor: Executor, tasks: Sequence[Task], update: Update, keep_going: bool) -> Iterator[Outcome]:
    plan = _Plan(tasks)
    while plan.unfinished:
        executor.expect(plan.unfinished)
        for _ in range(executor.free()):
            if (task := plan.next()) is None:
                break
            executor.start(task)
        outcomes = executor.ended(update)
        if not keep_going:  # a failure comes first, and nothing is begun behind it
            for outcome in outcomes:
                if outcome.error is not None:
                    raise outcome.error
        for outcome in outcomes:
            yield outcome
            yield from plan.ended(outcome)


class _Plan:
    """Which task may begin. Each is looked at once a dependency, however many there are."""

    def __init__(self, tasks: Sequence[Task]) -> None:
        self._tasks = tasks
        places = {task.label: i for i, task in enumerate(tasks)}
        self._blocked = [{label for label in task.after if label in places} for task in tasks]
        self._behind: dict[str, list[int]] = {}
        for i, labels in enumerate(self._blocked):
            for label in labels:
                self._behind.setdefault(label, []).append(i)
        self._ready = [i for i, labels in enumerate(self._blocked) if not labels]
        self._done: set[str] = set()

    @property
    def unfinished(self) -> int:
        return len(self._tasks) - len(self._done)

    def next(self) -> Task | None:
        """The first of those that may begin; it is handed out once."""
        return self._tasks[heapq.heappop(self._ready)] if self._ready else None

    def ended(self, outcome: Outcome) -> Iterator[Outcome]:
        """Free those that waited for it; where it failed, they fail too."""
        self._done.add(outcome.label)
        for i in self._behind.get(outcome.label, ()):
            task = self._tasks[i]
            if outcome.error is not None and task.label not in self._done:
                lost = Outcome(task.label, error=UsageError(f"not made, as {outcome.label} failed"))
                yield lost
                yield from self.ended(lost)
            self._blocked[i].discard(outcome.label)
            if not self._blocked[i] and task.label not in self._done:
                heapq.heappush(self._ready, i)
