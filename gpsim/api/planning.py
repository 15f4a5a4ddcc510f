"""plan and watch: the next recording, and later ones against an account."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from gpsim.api.diagnosis import Diagnosis
from gpsim.api.recordings import taken_of
from gpsim.corrected import EffectsPlant
from gpsim.errors import UsageError
from gpsim.planning import Account, Alarm, Monitor, Plan, WatchSettings, looked_at
from gpsim.recordings import Recording
from gpsim.settings import build, number, whole
from gpsim.stages.stage import silent


def plan(
    diagnosis: Diagnosis,
    minutes: float = 2.0,
    *,
    commands: Mapping[str, Sequence[float]] | None = None,
    rates: Mapping[str, float] | None = None,
    box: Mapping[str, Sequence[float]] | None = None,
    rest: Mapping[str, float] | None = None,
    rest_commands: Mapping[str, float] | None = None,
    settings: Mapping[str, Any] | None = None,
    anew: bool = False,
    policy: str | Path | None = None,
    seed: int = 0,
    progress: Callable[[int, int, str], None] | None = None,
) -> Plan:
    """Commands to play next, under which the explanations that a diagnosis left open differ most, and which are safe.

    Args:
        diagnosis: what left something open.
        minutes: how long the plan may take.
        commands: action: [low, high]; as large as in the recording by default, as all other limits.
        rates: action: its largest change per second.
        box: state: [low, high], which it must not leave.
        rest: state: where the machine rests, and begins.
        rest_commands: action: the command at rest.
        settings: as in conf/plan/default.yaml: `{"piece": 4.0}`.
        anew: somebody puts the machine back to rest before each piece.
        policy: folder of a finished policy that steers the machine meanwhile; `commands` are then added to its own.
        seed: of the search.
        progress: called as progress(done, total, note).

    Returns:
        `commands` (K, A), one every `dt` s, `episode` (K,), what each of the `pairs` of explanations differs by, and
        how safe it is.

    Raises:
        UsageError: limits that exclude the rest position, a box that the first state is out of, nothing to plan for, or
            no commands that are safe.

    Example:
        >>> import gpsim
        >>> diagnosis = gpsim.Diagnosis.load("found")
        >>> plan = gpsim.plan(diagnosis, 0.05, anew=True, settings={"piece": 2.0, "candidates": 8})
        >>> plan.commands.shape, plan.safety.left
        ((150, 1), 0)
    """
    from gpsim.stages.plan import Asked, planned  # with pages, which take a second to load

    if diagnosis.verdict == "none":
        raise UsageError("the verdict is none: nothing is missing, so there is nothing to plan")
    if not number(minutes, "minutes") > 0.0:
        raise UsageError(f"minutes: expected more than 0, got {minutes:g}")
    stated = {
        "commands": commands, "rates": rates, "box": box, "rest": rest, "rest_commands": rest_commands,
    }  # fmt: skip
    given = {key: dict(value) for key, value in stated.items() if value is not None}
    steering = None if policy is None else Path(policy)
    asked = Asked(minutes, anew, steering, whole(seed, "seed"), progress or silent)
    return planned(diagnosis.left_open, _plant(diagnosis), {**(settings or {}), **given}, asked)[0]


def _plant(diagnosis: Diagnosis) -> EffectsPlant:
    """The corrected simulator, without a Gaussian process."""
    plant = diagnosis.corrected().plant
    assert isinstance(plant, EffectsPlant)
    return plant


class Watcher:
    """Later recordings of a machine against an old account, in the order in which they are shown.

    Attributes:
        holds: whether the account holds after all that was seen.

    Example:
        >>> import gpsim
        >>> watcher = gpsim.Watcher(gpsim.Diagnosis.load("found"), {"stretch": 3.0})
        >>> watcher.see("slider.csv"), watcher.holds
        ([], True)
    """

    def __init__(self, diagnosis: Diagnosis, settings: Mapping[str, Any] | None = None) -> None:
        """settings: as in conf/watch/default.yaml."""
        plant = _plant(diagnosis)
        self._account = Account(plant, diagnosis.left_open)
        if not self._account.hypothesis.terms:
            raise UsageError("the diagnosis names no effect: there is no account to watch")
        self._settings = build(WatchSettings, settings or {}, "watch")
        self._monitor = Monitor(self._account, self._settings)
        self._simulator = diagnosis.simulator
        self.holds = True

    def see(self, recording: Recording | str | Path) -> list[Alarm]:
        """What no longer holds: `what`, `was`, `now` and since when; nothing where the account holds.

        Raises:
            UsageError: recording and simulator do not go together, or nothing moves.
        """
        taken = taken_of(recording, self._simulator)
        name = str(recording) if isinstance(recording, str | Path) else "recording"
        for stretch in looked_at(self._account, taken, self._settings.stretch):
            if alarms := self._monitor.see(name, stretch):
                self.holds = False
                return alarms
        return []
