"""Selection: which of the candidates are taken."""

from gpsim.diagnosis.selection.acceptance import Acceptance, Rule, accepts, on_its_grid, pays
from gpsim.diagnosis.selection.beam import Found, Note, beam_search
from gpsim.diagnosis.selection.differences import told_apart, told_apart_to_the_end
from gpsim.diagnosis.selection.elimination import SMALL_ACCOUNT, lean, simplest, whole_robot
from gpsim.diagnosis.selection.grid_check import refine_grid
from gpsim.diagnosis.selection.heavy_tails import without_tails
from gpsim.diagnosis.selection.held_out import held_out_fit, held_out_objective
from gpsim.diagnosis.selection.lack_of_fit import LackOfFit, lack_of_fit, lack_of_memory
from gpsim.diagnosis.selection.outside_acts import without_outside_acts
from gpsim.diagnosis.selection.pruning import prune_on_held_out
from gpsim.diagnosis.selection.refit import Contenders, null_of, refit
from gpsim.diagnosis.selection.required import required_in, without_idle
from gpsim.diagnosis.selection.scaling import inertias
from gpsim.diagnosis.selection.stepwise import stepwise
from gpsim.diagnosis.selection.substitution import left_open, plain_forms
from gpsim.diagnosis.selection.usual import usual_machine
from gpsim.diagnosis.selection.varying import Varying, varying

__all__ = [
    "SMALL_ACCOUNT",
    "Acceptance",
    "Contenders",
    "Found",
    "LackOfFit",
    "Note",
    "Rule",
    "Varying",
    "accepts",
    "beam_search",
    "held_out_fit",
    "held_out_objective",
    "inertias",
    "lack_of_fit",
    "lack_of_memory",
    "lean",
    "left_open",
    "null_of",
    "on_its_grid",
    "pays",
    "plain_forms",
    "prune_on_held_out",
    "refine_grid",
    "refit",
    "required_in",
    "simplest",
    "stepwise",
    "told_apart",
    "told_apart_to_the_end",
    "usual_machine",
    "varying",
    "whole_robot",
    "without_idle",
    "without_outside_acts",
    "without_tails",
]
