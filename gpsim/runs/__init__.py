"""What is in runs/: every artifact, what rests on what, how two differ, and what may go."""

from gpsim.runs.catalogue import Catalogue, Entry, entry_at, read_catalogue, size_of
from gpsim.runs.comparison import (
    ABSENT,
    Difference,
    Making,
    asked_of,
    compared,
    figures_of,
    made_from,
    nearest,
)
from gpsim.runs.lineage import (
    Removal,
    children,
    collect_garbage,
    dependents,
    garbage,
    named,
    parents,
    removal_of,
    remove,
)
from gpsim.runs.told import Beside, Compared, Listed, Listing, LoopStatus, Parent, Removed, Shown, Standing
