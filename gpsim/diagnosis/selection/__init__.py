"""Selection: which of the candidates are taken."""

from gpsim.diagnosis.selection.acceptance import Acceptance, Rule, accepts, on_its_grid, pays
from gpsim.diagnosis.selection.beam import Found, Note, search
from gpsim.diagnosis.selection.elimination import lean, simplest, without_a_term
from gpsim.diagnosis.selection.grid_check import simplest_on_fine_grid
from gpsim.diagnosis.selection.lack_of_fit import LackOfFit, lack_of_fit, lack_of_memory
from gpsim.diagnosis.selection.stepwise import improved
from gpsim.diagnosis.selection.substitution import left_open

__all__ = [
    "Acceptance",
    "Found",
    "LackOfFit",
    "Note",
    "Rule",
    "accepts",
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
