"""The blind protocol: conceal worlds, diagnose their recordings without the answers, reveal the answers.

Whoever conceals publishes the recordings and the answers' hashes; a diagnosis runs in a process and a folder of its own
that hold nothing but one recording; an answer counts only if its hash is the one that was published.
"""

from gpsim.trials.blinding.answers import Answer, reveal
from gpsim.trials.blinding.blind_diagnosis import (
    DIAGNOSES,
    DIAGNOSIS,
    OUTCOME,
    PLAN,
    diagnose_blind,
    diagnosis_digest,
    read_outcome,
    read_report,
)
from gpsim.trials.blinding.concealment import answer_of, conceal
from gpsim.trials.blinding.logs import even_recording
from gpsim.trials.blinding.plan_worlds import MINUTES, conceal_plan, played
from gpsim.trials.blinding.trial_files import (
    ANSWER,
    HASHES,
    NAME,
    PRIVATE,
    PUBLIC,
    publish_hashes,
    published,
    recording_folders,
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
    "answer_of",
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
