"""Planning: the commands to play next, so that explanations which a recording left open separate, and safely."""

from gpsim.planning.limits import STATED, Limits, PlanSettings, limits_of
from gpsim.planning.models import Around, Machine, Steer
from gpsim.planning.plan import Apart, Piece, Plan, Safety, make_plan
from gpsim.planning.signals import FIXED
