"""The budget: how much was simulated, which is the same on every machine, whatever the number of cores.

A search that has used up what it may spend stops at its best so far: seconds would make results depend on the machine.
"""

from __future__ import annotations

from dataclasses import dataclass

SUBSTEP_OVERHEAD = 300.0
"""Rows that a substep costs beside its own, however few these are (timings of one core, roughly)."""
COST_PER_ROW = 0.8  # rows that one counts as, whatever its channels (timings of one core, roughly)
COST_PER_CHANNEL = 0.3  # more for each of its channels [rows] (timings of one core, roughly)
MOST_CHANNELS = 4
"""Channels that are counted, but of a simulator that owns its integration (laws of larger systems take more; beyond
these nobody has measured)."""
DRY_FRICTION_FACTOR = 2.5  # times as much where dry friction acts (timings of one core, roughly)
CLOSED_STEP_FACTOR = 4.0
"""Times as much where the simulator owns its integration (by hand: such a row takes ten to forty times as long, of an
arm of seven joints some ninety, and a robot may take some minutes)."""
COST_PER_ACTUATOR = 0.45
"""Of a row for each actuator that its command passes (timings of one core, roughly)."""
COST_PER_SENSOR = 0.3  # of a row for each sensor that remembers (timings of one core, roughly)


@dataclass
class Budget:
    """What a diagnosis has spent so far, in simulated rows."""

    spent: float = 0.0

    def spend(self, rows: int, substeps: int, *, channels: int, dry: bool, owned: bool) -> None:
        """Count `substeps` substeps of `rows` states each, of so many channels; owned: the simulator makes them."""
        counted = channels if owned else min(channels, MOST_CHANNELS)
        size = COST_PER_ROW + COST_PER_CHANNEL * counted
        size *= CLOSED_STEP_FACTOR if owned else DRY_FRICTION_FACTOR if dry else 1.0
        self.add(substeps * (SUBSTEP_OVERHEAD + rows) * size)

    def spend_on_commands(self, rows: int, substeps: int, actuators: int) -> None:
        """Count what becomes of `rows` commands in each of `substeps` on their way through so many actuators."""
        self.add(COST_PER_ACTUATOR * actuators * substeps * (SUBSTEP_OVERHEAD + rows))

    def spend_on_readings(self, rows: int, substeps: int, sensors: int) -> None:
        """Count what so many sensors that remember make of `rows` states in each of `substeps`."""
        self.add(COST_PER_SENSOR * sensors * substeps * (SUBSTEP_OVERHEAD + rows))

    def add(self, amount: float) -> None:
        """Count what was spent elsewhere: in a worker process."""
        self.spent += amount
