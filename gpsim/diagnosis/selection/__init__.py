"""Selection: which of the candidates are taken."""

from gpsim.diagnosis.selection.beam import LEAST_SHARE, STRUCTURED, Found, Note, on_its_grid, pays, search
from gpsim.diagnosis.selection.elimination import lean, simplest, without_a_term
from gpsim.diagnosis.selection.grid_check import simplest_on_fine_grid
from gpsim.diagnosis.selection.lack_of_fit import SIGNIFICANT, LackOfFit, lack_of_fit, lack_of_memory
from gpsim.diagnosis.selection.stepwise import improved
from gpsim.diagnosis.selection.substitution import left_open

__all__ = [
    "LEAST_SHARE",
    "SIGNIFICANT",
    "STRUCTURED",
    "Found",
    "LackOfFit",
    "Note",
    "improved",
    "lack_of_fit",
    "lack_of_memory",
    "lean",
    "left_open",
    "on_its_grid",
    "pays",
    "search",
    "simplest",
    "simplest_on_fine_grid",
    "without_a_term",
]
