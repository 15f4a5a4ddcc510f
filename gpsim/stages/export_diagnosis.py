"""export diagnosis, view: measured, base and corrected motion on one clock, for Foxglove and for Rerun."""

from __future__ import annotations

from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

import numpy as np

from gpsim.artifacts import Artifact, read_artifact, read_timings
from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Settings, read_settings
from gpsim.errors import UsageError
from gpsim.files import disk_errors, written_whole
from gpsim.recordings import Recording
from gpsim.reports.account import account_of
from gpsim.reports.bodies import body_of
from gpsim.reports.scene import Shown
from gpsim.residuals import first_held_out
from gpsim.stages import diagnose
from gpsim.stages.stage import blamed, new_place
from gpsim.traces import Alongside, alongside

NEEDS = {"mcap": ("mcap", "mcap_protobuf", "foxglove_schemas_protobuf"), "rrd": ("rerun",)}
MISSING = {
    "mcap": "export diagnosis: Foxglove's formats are not installed; pip install 'gpsim[foxglove]'",
    "rrd": "view: Rerun is not installed; pip install 'gpsim[rerun]'",
}
"""What is said where a package that a format needs is not there."""


def export_diagnosis(
    folder: Path,
    out: Path | None = None,
    recording: Path | None = None,
    horizon: float | None = None,
    form: Literal["mcap", "rrd"] = "mcap",
) -> tuple[Path, list[str]]:
    """Write a file of the diagnosis at `folder`; where it lies, and sentences about what is in it.

    out: the new file, beside the folder without one. recording: where the recording lies now, which must be the one
    that was diagnosed. horizon: s of every rollout, that of the diagnosis without one. form: for Foxglove, or for
    Rerun. Raises UsageError.
    """
    if any(find_spec(name) is None for name in NEEDS[form]):
        raise UsageError(MISSING[form])
    artifact = read_artifact(folder, "diagnose")
    place = artifact.path if artifact.path.name not in ("", "..") else artifact.path.resolve()
    out = out or place.with_name(f"{place.name}.{form}")
    new_place(out)
    if artifact.path.resolve() in out.resolve().parents:
        raise UsageError(f"{out}: is inside the diagnosis, which is never changed; choose another --out")
    if horizon is not None and not 0 < horizon < np.inf:
        raise UsageError(f"--horizon {horizon:g}: expected a time of more than 0 s")
    found = diagnose.read_diagnosis(folder)
    opened = _opened(artifact, recording)
    plant = diagnose.read_corrected(folder)
    process = found.remainder.gp is None or found.remainder.gp.used
    with_gp = diagnose.read_corrected(folder, gp=True) if process else None
    settings = Settings()  # the usual ones where an earlier version had others
    with suppress(UsageError):
        settings = read_settings(artifact.manifest["config"].get("settings") or {})
    with blamed(plant.simulator.name):
        along = alongside(
            opened, plant, with_gp, horizon or found.fit.rollout.horizon_s, Run(settings=settings)
        )
    facts = {
        "verdict": found.verdict,
        "said": account_of(found).sentence,
        "simulator": plant.simulator.name,
        "horizon_s": f"{along.horizon:g}",
        "diagnosis_sha256": artifact.digest,
    }
    body = body_of(plant.simulator, plant.parameters, _reach(opened))
    shown = Shown(opened, along, body, first_held_out(opened), facts)
    if form == "mcap":
        from gpsim.reports.foxglove_file import write_foxglove as write
    else:
        from gpsim.reports.rerun_file import write_rerun as write
    with disk_errors(out, "--out"), written_whole(out) as made:
        count = write(shown, made)
    return out, _notes(opened, along, found, count, body is not None, plant.simulator.name)


def _opened(artifact: Artifact, recording: Path | None) -> Recording:
    """The recording that was diagnosed, byte for byte."""
    config = artifact.manifest["config"]
    if diagnose.RECORDINGS in config:
        raise UsageError(
            f"{artifact.path}: is about several recordings, but only one can be shown: diagnose that one separately"
        )
    told = read_timings(artifact.path).get(diagnose.RECORDING)  # where nobody wrote it down, none
    place = recording or (Path(told) if isinstance(told, str) else None)
    if place is None:
        raise UsageError(
            f"{artifact.path}: does not contain the path of its recording; name it with --recording PATH"
        )
    if not place.exists():
        raise UsageError(f"{place}: the recording was not found; give its present path with --recording PATH")
    task = diagnose.Task(place, str(config["simulator"]), config.get("episodes"))
    there = diagnose.digests_of(task, place if place.is_dir() else place.parent)
    if sorted(there.values()) != sorted(config["recording"].values()):
        raise UsageError(
            f"{place}: not the recording of {artifact.path}, or changed since; name the right one with --recording "
            "PATH, or diagnose this one"
        )
    return diagnose.open_recording(task)[0]


def _reach(recording: Recording) -> float:
    """How far it travels along its longest channel in metres; 1 where nothing is."""
    columns = [i for i, channel in enumerate(recording.state) if channel.unit == "m"]
    states = np.concatenate([episode.states[:, columns] for episode in recording.episodes])
    return float(np.ptp(states, axis=0).max()) or 1.0 if columns else 1.0


def _notes(
    recording: Recording, along: Alongside, found: Diagnosis, count: int, drawn: bool, simulator: str
) -> list[str]:
    samples = sum(len(e.t) for e in recording.episodes)
    notes = [
        f"{count} messages: {len(recording.episodes)} episode(s), {samples} samples",
        f"/real beside /{', /'.join(along.models)}: rollouts of {along.horizon:g} s from measured states",
    ]
    if along.every > 1:
        notes.append(f"simulated at one sample in {along.every}, as in the diagnosis")
    if not found.effects:
        notes.append(f"no effect was found (verdict {found.verdict}): /corrected is the base")
    if not drawn:
        notes.append(f"numbers only: the shape of {simulator} is unknown, so no body is drawn")
    return notes
