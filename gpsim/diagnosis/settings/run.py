"""Settings of a run: what effort is counted as, and how work is shared. Workers have no say in an answer."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import setting

TIMED = "timings of one core, roughly"  # origin of the weights


@dataclass(frozen=True)
class CostSettings:
    """What a simulation is counted as in the budgets, in simulated rows: seconds would depend on the machine."""

    overhead: float = setting(
        300.0, "rows", "that a substep costs beside its own, however few these are", TIMED
    )
    per_row: float = setting(0.8, "rows", "that one counts as, whatever its channels", TIMED)
    per_channel: float = setting(0.3, "rows", "more for each of its channels", TIMED)
    most_channels: int = setting(
        4,
        "channels",
        "that are counted",
        "laws of larger systems take more; beyond these nobody has measured",
    )
    dry_friction: float = setting(2.5, "1", "times as much where dry friction acts", TIMED)
    closed_step: float = setting(
        4.0,
        "1",
        "times as much where the simulator owns its integration",
        "by hand: such a row takes ten to forty times as long, and a robot may take some minutes",
    )
    per_actuator: float = setting(0.45, "1", "of a row for each actuator that its command passes", TIMED)
    per_sensor: float = setting(0.3, "1", "of a row for each sensor that remembers", TIMED)


@dataclass(frozen=True)
class SharingSettings:
    """How work is cut for several processes, and what is remembered: seconds, no answer."""

    least_rows: int = setting(
        150, "rows", "that a part of a batch has: the overhead of its substeps is not split", least=1
    )
    worth_sending: float = setting(
        5e4, "rows times substeps", "below, a batch is simulated here", "some ten milliseconds of work"
    )
    screened_in_a_row: int = setting(8, "candidates", "that one process screens in a row", least=1)
    compiled: bool = setting(
        True, "yes or no", "simulate by compiled code what has such a form, else by NumPy"
    )
    remembered: int = setting(
        6,
        "answers",
        "to a function's questions that are kept",
        "a leader's is asked for again after a few rivals'",
        least=1,
    )
