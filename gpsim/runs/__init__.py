"""What is in runs/: every artifact, what rests on what, how two differ, and what may go."""

from gpsim.runs.catalogue import Catalogue, Entry, entry_at, read_catalogue, size_of
from gpsim.runs.comparison import ABSENT, Difference, Making, compared, nearest
from gpsim.runs.figures import figures_of
from gpsim.runs.lineage import children, dependents, missing_parents, parents
from gpsim.runs.naming import named
from gpsim.runs.removing import Removal, collect_garbage, garbage, removal_of, remove
from gpsim.runs.standing import LoopStatus, Standing
from gpsim.runs.told import Beside, Compared, Listed, Listing, Parent, Removed, Shown

__all__ = [
    "ABSENT",
    "Beside",
    "Catalogue",
    "Compared",
    "Difference",
    "Entry",
    "Listed",
    "Listing",
    "LoopStatus",
    "Making",
    "Parent",
    "Removal",
    "Removed",
    "Shown",
    "Standing",
    "children",
    "collect_garbage",
    "compared",
    "dependents",
    "entry_at",
    "figures_of",
    "garbage",
    "missing_parents",
    "named",
    "nearest",
    "parents",
    "read_catalogue",
    "removal_of",
    "remove",
    "size_of",
]
