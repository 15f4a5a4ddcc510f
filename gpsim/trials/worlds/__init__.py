"""What a concealed world is, as plain data: its system, its effects, how it is driven, how large things are in it.

Nothing here knows a law. `World` and `TrueEffect` decide a recording, `SYSTEMS` has the four systems, `drive` and
`starts` say how a world is driven, `Run` is what came of it, `Scales` and `Dial` are what strengths are drawn with.
"""

from gpsim.trials.worlds.closed_loop import FREE, REFERENCES
from gpsim.trials.worlds.closed_loop import SIGNALS as CLOSED_LOOP
from gpsim.trials.worlds.excitation import (
    BODY_SIGNALS,
    GRADED_SIGNALS,
    PLAYED,
    VEHICLE_SIGNALS,
    Driving,
    drive,
    sound,
    starts,
)
from gpsim.trials.worlds.systems import (
    SYSTEMS,
    Dial,
    Scales,
    System,
    dynamics,
    load_on_track,
    rounded,
    waves,
)
from gpsim.trials.worlds.world import (
    STRATA,
    Machine,
    Rough,
    Run,
    Session,
    Stratum,
    TrueEffect,
    Values,
    World,
    effect_json,
    world_from_json,
    world_json,
)

__all__ = [
    "BODY_SIGNALS",
    "CLOSED_LOOP",
    "FREE",
    "GRADED_SIGNALS",
    "PLAYED",
    "REFERENCES",
    "STRATA",
    "SYSTEMS",
    "VEHICLE_SIGNALS",
    "Dial",
    "Driving",
    "Machine",
    "Rough",
    "Run",
    "Scales",
    "Session",
    "Stratum",
    "System",
    "TrueEffect",
    "Values",
    "World",
    "drive",
    "dynamics",
    "effect_json",
    "load_on_track",
    "rounded",
    "sound",
    "starts",
    "waves",
    "world_from_json",
    "world_json",
]
