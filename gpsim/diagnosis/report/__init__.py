"""The result of a diagnosis as typed, frozen objects, and the file they are read from and written to."""

from gpsim.diagnosis.report.diagnosis import (
    SCHEMA,
    Concentration,
    Diagnosis,
    Location,
    MissingLaw,
    Remainder,
    RemainderGp,
    Verdict,
    schema,
)
from gpsim.diagnosis.report.effects import Alternative, Claims, Estimate, NamedEffect, Odds, RankedHypothesis
from gpsim.diagnosis.report.facts import Discrimination, Excitation, NoGp, Separation, Shape
from gpsim.diagnosis.report.fit import (
    HeldOutFit,
    Kind,
    ModelErrors,
    OverBefore,
    Ratio,
    Rollout,
    RolloutErrors,
    RolloutModelErrors,
    StepErrors,
)

__all__ = [
    "SCHEMA",
    "Alternative",
    "Claims",
    "Concentration",
    "Diagnosis",
    "Discrimination",
    "Estimate",
    "Excitation",
    "HeldOutFit",
    "Kind",
    "Location",
    "MissingLaw",
    "ModelErrors",
    "NamedEffect",
    "NoGp",
    "Odds",
    "OverBefore",
    "RankedHypothesis",
    "Ratio",
    "Remainder",
    "RemainderGp",
    "Rollout",
    "RolloutErrors",
    "RolloutModelErrors",
    "Separation",
    "Shape",
    "StepErrors",
    "Verdict",
    "schema",
]
