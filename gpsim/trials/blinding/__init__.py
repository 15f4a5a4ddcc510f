"""The blind protocol: conceal worlds, diagnose their recordings without the answers, reveal the answers.

Whoever conceals publishes the recordings and the answers' hashes; a diagnosis runs in a process and a folder of its own
that hold nothing but one recording; an answer counts only if its hash is the one that was published.
"""

from gpsim.trials.blinding.blind_diagnosis import (
    DIAGNOSIS,
    PLAN,
    diagnose_blind,
    diagnosis_digest,
    read_report,
)
from gpsim.trials.blinding.concealment import conceal
from gpsim.trials.blinding.logs import even_recording
from gpsim.trials.blinding.machine_worlds import MINUTES, conceal_plan, played
from gpsim.trials.blinding.trial_files import (
    ANSWER,
    DIAGNOSES,
    HASHES,
    NAME,
    OUTCOME,
    PRIVATE,
    PUBLIC,
    Answer,
    publish_hashes,
    published,
    read_outcome,
    recording_folders,
    reveal,
    trial_name,
    write_trial,
)

__all__ = [
    "ANSWER",
    "DIAGNOSES",
    "DIAGNOSIS",
    "HASHES",
    "MINUTES",
    "NAME",
    "OUTCOME",
    "PLAN",
    "PRIVATE",
    "PUBLIC",
    "Answer",
    "conceal",
    "conceal_plan",
    "diagnose_blind",
    "diagnosis_digest",
    "even_recording",
    "played",
    "publish_hashes",
    "published",
    "read_outcome",
    "read_report",
    "recording_folders",
    "reveal",
    "trial_name",
    "write_trial",
]
