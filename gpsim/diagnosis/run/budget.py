"""The budget: how much was simulated, which is the same on every machine, whatever the number of cores.

A search that has used up what it may spend stops at its best so far: seconds would make results depend on the machine.
"""

from __future__ import annotations

from dataclasses import dataclass

CALL = 300.0  # simulated rows that the overhead of one substep is worth
A_STEP, A_CHANNEL = 0.8, 0.3  # of a row, whatever its channels, and of each of them
MOST_CHANNELS = 4  # laws of the larger systems that come along take more calls; beyond, nobody has measured
DRY = 2.5  # times as much where dry friction acts

COMMAND = 0.45  # times as much for each actuator that a command passes
READING = 0.3  # times as much for each sensor that remembers


@dataclass
class Budget:
    """What a diagnosis has spent so far, in simulated rows."""

    spent: float = 0.0

    def spend(self, rows: int, substeps: int, *, channels: int, dry: bool) -> None:
        """Count `substeps` substeps of `rows` states each, of so many channels."""
        size = A_STEP + A_CHANNEL * min(channels, MOST_CHANNELS)
        self.add(substeps * (CALL + rows) * size * (DRY if dry else 1.0))

    def spend_on_commands(self, rows: int, substeps: int, actuators: int) -> None:
        """Count what becomes of `rows` commands in each of `substeps` on their way through so many actuators."""
        self.add(COMMAND * actuators * substeps * (CALL + rows))

    def spend_on_readings(self, rows: int, substeps: int, sensors: int) -> None:
        """Count what so many sensors that remember make of `rows` states in each of `substeps`."""
        self.add(READING * sensors * substeps * (CALL + rows))

    def add(self, amount: float) -> None:
        """Count what was spent elsewhere: in a worker process."""
        self.spent += amount
