"""Planning: the commands to play next, so that explanations which a recording left open separate, and safely.

And watching: later recordings of a machine against an old account, stretch by stretch, by a sequential test.
"""

from gpsim.planning.limits import STATED, Limits, PlanSettings, limits_of
from gpsim.planning.models import Around, Machine, Steer
from gpsim.planning.plan import Plan, make_plan
from gpsim.planning.signals import FIXED
from gpsim.planning.watching import Account, Alarm, Monitor, Stretch, WatchSettings, looked_at
