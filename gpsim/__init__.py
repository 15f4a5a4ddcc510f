"""gpsim: close the gap between a simple simulator and a real robot, and say which physics was missing.

    import gpsim

    recording = gpsim.read_recording("run.csv", "pendulum")
    diagnosis = gpsim.diagnose(recording)
    print(diagnosis)
    env = gpsim.make_env(diagnosis, reward=lambda state, action, next_state: -next_state["theta"] ** 2)

What `__all__` lists is public and keeps its meaning within a major version; everything else, also whatever begins with
an underscore, may change with any release. Names load when they are first asked for: this file needs nothing.
"""

from typing import TYPE_CHECKING

from gpsim.api.registration import register_environments as _register_environments
from gpsim.doors import opened as _opened

__version__ = "0.2.0"

__all__ = [
    "CorrectedSimulator",
    "Diagnosis",
    "Evaluation",
    "Recording",
    "Settings",
    "UsageError",
    "Watcher",
    "__version__",
    "diagnose",
    "effects",
    "errors",
    "evaluate",
    "fit_gp",
    "load_simulator",
    "make_env",
    "plan",
    "read_recording",
    "recording_from_frame",
]

if TYPE_CHECKING:
    from gpsim import effects, errors
    from gpsim.api.corrected import CorrectedSimulator
    from gpsim.api.diagnosis import Diagnosis, diagnose
    from gpsim.api.environment import make_env
    from gpsim.api.evaluation import Evaluation, evaluate
    from gpsim.api.planning import Watcher, plan
    from gpsim.api.processes import fit_gp
    from gpsim.api.recordings import read_recording, recording_from_frame
    from gpsim.api.simulators import load_simulator
    from gpsim.diagnosis.settings import Settings
    from gpsim.errors import UsageError
    from gpsim.recordings import Recording
else:
    __getattr__ = _opened(__name__)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


_register_environments()
