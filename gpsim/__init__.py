"""gpsim: close the gap between a simple simulator and a real robot, and say which physics was missing.

    import gpsim

    recording = gpsim.read_recording("run.csv", "pendulum")
    diagnosis = gpsim.diagnose(recording)
    print(diagnosis)
    env = gpsim.make_env(diagnosis, reward=lambda state, action, next_state: -next_state["theta"] ** 2)

What `__all__` lists is public and keeps its meaning within a major version; everything else, also whatever begins with
an underscore, may change with any release. Names load when they are first asked for: this file needs nothing.
"""

import importlib
from typing import TYPE_CHECKING, Any

from gpsim.face.registration import register_environments as _register_environments

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

_PLACES = {
    "CorrectedSimulator": "gpsim.face.corrected",
    "Diagnosis": "gpsim.face.diagnosis",
    "Evaluation": "gpsim.face.evaluation",
    "Recording": "gpsim.recordings",
    "Settings": "gpsim.diagnosis.settings",
    "UsageError": "gpsim.errors",
    "Watcher": "gpsim.face.planning",
    "diagnose": "gpsim.face.diagnosis",
    "evaluate": "gpsim.face.evaluation",
    "fit_gp": "gpsim.face.processes",
    "load_simulator": "gpsim.face.simulators",
    "make_env": "gpsim.face.environment",
    "plan": "gpsim.face.planning",
    "read_recording": "gpsim.face.recordings",
    "recording_from_frame": "gpsim.face.recordings",
}
"""Name -> the module that has it (PEP 562)."""
_ROOMS = ("effects", "errors")
"""Public modules."""

if TYPE_CHECKING:
    from gpsim import effects, errors
    from gpsim.diagnosis.settings import Settings
    from gpsim.errors import UsageError
    from gpsim.face.corrected import CorrectedSimulator
    from gpsim.face.diagnosis import Diagnosis, diagnose
    from gpsim.face.environment import make_env
    from gpsim.face.evaluation import Evaluation, evaluate
    from gpsim.face.planning import Watcher, plan
    from gpsim.face.processes import fit_gp
    from gpsim.face.recordings import read_recording, recording_from_frame
    from gpsim.face.simulators import load_simulator
    from gpsim.recordings import Recording


def __getattr__(name: str) -> Any:
    if name in _ROOMS:
        return importlib.import_module(f"gpsim.{name}")
    if name not in _PLACES:
        raise AttributeError(f"module 'gpsim' has no attribute '{name}'")
    value = getattr(importlib.import_module(_PLACES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


_register_environments()
