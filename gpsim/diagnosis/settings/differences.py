"""Settings of what is looked for between several recordings of one machine."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import setting


@dataclass(frozen=True)
class DifferenceSettings:
    """What differs between recordings, asked when what they share has been searched to its end."""

    most: int = setting(
        6, "1", "values of a recording's own that are taken, before what they share is asked again"
    )
    rounds: int = setting(2, "1", "times that what they share is searched again with them")
    fitted: int = setting(9, "1", "of those screened, that are fitted, the most promising first", least=1)
    moved: float = setting(
        0.2, "1", "of what a shared effect does, by which its values are moved in one recording, to screen it"
    )
    budget: float = setting(
        1e8,
        "simulated rows",
        "effort of each round after which nothing more is asked",
        "as `stepwise.budget`",
    )
