"""Settings of fits: how far they are taken, by the purpose that they have."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import setting


@dataclass(frozen=True)
class ScheduleSettings:
    """How far fits are taken: most Gauss-Newton steps, and the gain of a step that is the last.

    A schedule is one of each: many hypotheses are glanced at roughly, the better ones settle, what is compared with the
    leader is refitted, and what leads is finished (successive halving).
    """

    glance: int = setting(5, "1", "steps of a first look at many hypotheses, and where little moves", least=1)
    trial: int = setting(
        6, "1", "steps of a first look at what has one term less, or one behind a gate", least=1
    )
    settle: int = setting(
        8, "1", "steps more of those that promise most, and where one thing changes", least=1
    )
    thresholds: int = setting(9, "1", "steps where thresholds of jumping laws are looked for anew", least=1)
    refit: int = setting(12, "1", "steps of a fit that is compared with the leader", least=1)
    finish: int = setting(17, "1", "steps more of what leads", least=1)
    rough: float = setting(0.5, "nats", "gain of the last step where hypotheses are ranked")
    edge: float = setting(0.2, "nats", "gain of the last step where the edges of a gate move")
    close: float = setting(0.1, "nats", "gain of the last step where a term may not be needed")
    final: float = setting(0.02, "nats", "gain of the last step of what leads")
