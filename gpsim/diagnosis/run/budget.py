"""The budget: how much was simulated, which is the same on every machine, whatever the number of cores.

A search that has used up what it may spend stops at its best so far: seconds would make results depend on the machine.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from gpsim.diagnosis.settings import CostSettings


@dataclass
class Budget:
    """What a diagnosis has spent so far, in simulated rows."""

    spent: float = 0.0
    cost: CostSettings = field(default_factory=CostSettings)

    def spend(self, rows: int, substeps: int, *, channels: int, dry: bool, owned: bool) -> None:
        """Count `substeps` substeps of `rows` states each, of so many channels; owned: the simulator makes them."""
        cost = self.cost
        size = cost.per_row + cost.per_channel * min(channels, cost.most_channels)
        size *= cost.closed_step if owned else cost.dry_friction if dry else 1.0
        self.add(substeps * (cost.overhead + rows) * size)

    def spend_on_commands(self, rows: int, substeps: int, actuators: int) -> None:
        """Count what becomes of `rows` commands in each of `substeps` on their way through so many actuators."""
        self.add(self.cost.per_actuator * actuators * substeps * (self.cost.overhead + rows))

    def spend_on_readings(self, rows: int, substeps: int, sensors: int) -> None:
        """Count what so many sensors that remember make of `rows` states in each of `substeps`."""
        self.add(self.cost.per_sensor * sensors * substeps * (self.cost.overhead + rows))

    def add(self, amount: float) -> None:
        """Count what was spent elsewhere: in a worker process."""
        self.spent += amount
