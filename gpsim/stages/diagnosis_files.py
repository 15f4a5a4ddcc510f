"""What a diagnosis leaves in its folder: the result first, then what shows it, of which any part may fail."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gpsim.artifacts import WarningLog
from gpsim.channels import Channels
from gpsim.corrected import EffectsPlant, Features, GpCorrection, ages_of, describe, plant_from
from gpsim.diagnosis import Diagnosis, Outcome, diagnose
from gpsim.diagnosis.run import Decision, Run
from gpsim.diagnosis.settings import Known, Settings
from gpsim.diagnosis.setup import look
from gpsim.errors import UsageError
from gpsim.files import Json, plain, write_json
from gpsim.findings import Estimate, Kinematics, NamedEffect, NoGp, RemainderGp
from gpsim.mjcf import Correction, MjcfSimulator, Moved, Place, planned
from gpsim.posterior import left_open_data, posterior_of
from gpsim.recordings import Recording, without_poses
from gpsim.reports.account_effects import claim_name
from gpsim.reports.diagnosis_text import place_name
from gpsim.reports.wording import worded
from gpsim.residuals import check_each_holds_out, check_rates
from gpsim.simulators import Simulator, wrapping
from gpsim.stages.policy_files import write_gp
from gpsim.stages.stage import Progress, blamed, generator, silent
from gpsim.traces import Course, Response, Traces, course, frequency, traces

if TYPE_CHECKING:
    from gpsim.gp import Predictor
    from gpsim.reports.diagnosis_figures import Picture


DIGITS, STEP = 4, 12
"""Of what is told, and of a control step that was taken from a log's stamps."""


def correction_of(plant: EffectsPlant, simulator: MjcfSimulator) -> Correction:
    """The corrected simulator as a change of its model."""
    dt = float(f"{plant.dt:.{STEP}g}")
    return Correction(simulator, plant.parameters, plant.terms, dt, plant.substeps, plant.youngest)


def where_effects_go(plant: EffectsPlant, effects: Iterable[NamedEffect]) -> list[str]:
    """A line an effect, if the simulator is a MuJoCo model; none of any other."""
    if not isinstance(plant.simulator, MjcfSimulator) or not plant.terms:
        return []
    return [went(e) for e in planned(correction_of(plant, plant.simulator), sentences(effects))]


def sentences(effects: Iterable[NamedEffect]) -> dict[tuple[str, str], str]:
    """Of each effect, by family and place, its numbers and their intervals, for a comment."""
    said = {}
    for effect in effects:
        numbers = (f"{name} {_estimate(estimate)}" for name, estimate in effect.parameters.items())
        said[effect.family, effect.place] = f"{claim_name(effect.family, effect.place)}: {', '.join(numbers)}"
    return said


def moved_sentences(found: Kinematics | None) -> dict[Place, str]:
    """Of each number of the robot's geometry that is off its size and interval, for a comment."""
    said = {}
    for f in found.found if found is not None else ():
        if f.model and f.place.kind != "delay":
            place = Place(f.place.kind, f.place.on, f.place.axis, f.size.unit)
            said[place] = f"{place_name(f.place)} is off by {_estimate(f.size)}"
    return said


def went(effect: Mapping[str, Any]) -> str:
    """An effect of patch.json, and the attributes it went to."""
    there = "; ".join(effect["attributes"]) or "wrapper"
    if effect["where"] == "attribute and wrapper":
        there += "; wrapper"
    reason = f" ({effect['why']})" if effect["why"] else ""
    return f"{effect['said']} -> {'left out' if effect['where'] == 'left out' else there}{reason}"


def _estimate(estimate: Estimate) -> str:
    value = f"{estimate.value:.{DIGITS}g} {estimate.unit}".removesuffix(" 1")
    if estimate.low is None or estimate.high is None:
        return value
    return f"{value} ({estimate.low:.{DIGITS}g} to {estimate.high:.{DIGITS}g})"


TRACE, FIGURES, POSTERIOR = "trace.jsonl", "figures", "posterior.json"


def write_diagnosis(folder: Path, found: Outcome, simulator: Simulator, title: str) -> list[str]:
    """The result (two JSON files), then what it leaves open, the Gaussian process, pictures, page; what went wrong."""
    from gpsim.reports.diagnosis_page import page  # here, as in `drawn`: it draws

    mishaps = WarningLog(found.comparison.mishaps)
    diagnosis = worded(found.diagnosis)
    _write_result(folder, found, diagnosis, simulator)
    lines = [json.dumps(plain(asdict(decision))) for decision in found.decisions]
    (folder / TRACE).write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    with mishaps.contained(
        f"{POSTERIOR} is left out: nothing can be planned, watched or drawn with this diagnosis"
    ):
        write_json(folder / POSTERIOR, left_open_data(posterior_of(found)))
    before, there = len(mishaps.lines), set(folder.iterdir())
    with mishaps.contained("the Gaussian process on the remainder is left out"):
        write_process(folder, found)
    if len(mishaps.lines) > before:
        for half in set(folder.iterdir()) - there:
            half.unlink()
        gp = RemainderGp(used=False, beside=None, why_not=None, refused=NoGp("not written"))
        diagnosis = worded(replace(diagnosis, remainder=replace(diagnosis.remainder, gp=gp)))
        _write_result(folder, found, diagnosis, simulator)
    pictures = drawn(diagnosis, found, mishaps)
    (folder / FIGURES).mkdir()
    for name, picture in pictures.items():
        (folder / FIGURES / f"{name}.png").write_bytes(picture.png)
    model: Sequence[str] = ()
    with mishaps.contained("where effects go in the model is left out"):
        plant = replace(found.plant, ages=ages_of(found.question.recording))
        model = where_effects_go(plant, diagnosis.effects)
    with mishaps.contained("report.html is left out"):
        text = page(diagnosis, pictures, title, mishaps.lines, found.decisions, simulator.name, model)
        (folder / "report.html").write_text(text, encoding="utf-8")
    mishaps.write(folder)
    return mishaps.lines


def _write_result(folder: Path, found: Outcome, diagnosis: Diagnosis, simulator: Simulator) -> None:
    write_json(folder / "diagnosis.json", diagnosis.to_dict())
    write_json(folder / "corrected.json", described(found, diagnosis, simulator.state))


def write_process(folder: Path, found: Outcome) -> None:
    """The Gaussian process on the remainder, where there is one."""
    if (corrected := found.comparison.corrected) is not None:
        write_gp(folder, corrected.learnt.predictor, corrected.learnt.features)


def read_trace(folder: Path) -> list[Decision]:
    """The decisions of a finished diagnosis; none of one by an earlier version."""
    path = folder / TRACE
    if not path.is_file():
        return []
    rows: list[Json] = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return [
        Decision(**row | {"candidate": tuple(row["candidate"]), "over": tuple(row["over"])}) for row in rows
    ]


def drawn(diagnosis: Diagnosis, found: Outcome, mishaps: WarningLog) -> Mapping[str, Picture]:
    """Name -> picture, of those that can be drawn."""
    # Here: who calls from Python and draws nothing need not wait a second for Matplotlib.
    from gpsim.reports.diagnosis_figures import account_figures, figures
    from gpsim.reports.robot_figure import ROBOT, robot_figure

    leader, horizon = found.judgement.leader.hypothesis, found.comparison.rollout.horizon_s
    shown: Traces | None = None
    past: Course | None = None
    answered: Response | None = None
    pictures: dict[str, Picture] = {}

    def contained(name: str) -> AbstractContextManager[None]:
        return mishaps.contained(f"figure {name} is left out")

    with contained("traces"):
        shown = traces(found.question, leader, horizon)
    with contained("residual_time"):
        past = course(found.question, leader)
    with contained("frequency_response"):
        answered = frequency(found.question, leader)
    with mishaps.contained("figures are left out"):
        pictures = account_figures(diagnosis, found.question.everything.simulator.state, shown, contained)
        pictures |= figures(found, shown, past, contained, answered)
    simulator = found.question.everything.simulator
    if isinstance(simulator, MjcfSimulator):
        with contained(ROBOT):
            states = np.concatenate([episode.states for episode in found.question.recording.episodes])
            if (robot := robot_figure(diagnosis, simulator, states)) is not None:
                pictures[ROBOT] = robot
    return pictures


Process = Callable[[Channels], "tuple[Predictor, Features]"]
"""process(channels of state and action): a Gaussian process and its inputs."""


@dataclass(frozen=True)
class Question:
    """What is asked beside the recording: settings, what the user knows, seed, processes, and who hears of progress."""

    settings: Settings
    known: Known
    seed: int
    cores: int = 1
    progress: Progress = silent


def answer(recording: Recording, simulator: Simulator, question: Question) -> Outcome:
    """Diagnose; raises UsageError where recording and simulator do not go together, or nothing can be said."""
    with blamed(simulator.name):
        seen = None
        if isinstance(simulator, MjcfSimulator) and len(recording.poses):
            from gpsim.kinematics import calibrate  # SciPy's splines: few recordings need them

            question.progress(0, 100, "where the motion capture saw its sites")
            seen = calibrate(recording, simulator)
            simulator = simulator.in_geometry(seen.moved) if seen else simulator
        recording = without_poses(recording)
        parameters = simulator.defaults(recording.parameters)
        sight = look(recording, simulator)
        if "horizon_s" in simulator.state.names:  # the one key beside the state channels in `fit.rollout`
            raise UsageError(
                "a state must not be called 'horizon_s', which is a key of diagnosis.json; rename the channel"
            )
        check_each_holds_out(recording)
        check_rates(sight.completed(recording), sight.simulator, parameters)
        rng = generator(question.seed, "diagnose")
        run = Run(question.settings, question.known, question.cores)
        found = diagnose(recording, simulator, parameters, rng, question.progress, run)
    return found if seen is None else replace(found, diagnosis=replace(found.diagnosis, kinematics=seen.told))


def title_of(recording: Recording) -> str:
    """What its page is called. Not the folder's name: the same recording elsewhere makes the same page."""
    of = f" of {len(recording.sources)} recordings" if recording.sources else ""
    return f"{recording.system}, {recording.transition_count} transitions{of}"


def described(found: Outcome, diagnosis: Diagnosis, own: Channels) -> Json:
    """corrected.json, and which channels wrap though the simulator's `own` state channels do not."""
    plant = replace(found.plant, ages=ages_of(found.question.recording))
    gp = diagnosis.remainder.gp
    wraps = [c.name for c, known in zip(plant.state, own, strict=True) if c.wraps and not known.wraps]
    content = describe(plant, gp=gp is not None and gp.used) | ({"wraps": wraps} if wraps else {})
    if isinstance(plant.simulator, MjcfSimulator) and plant.simulator.geometry:
        content["geometry"] = [{**asdict(m.place), "value": m.value} for m in plant.simulator.geometry]
    if gp is not None and gp.beside == "base":
        content["with_gp"] = {"terms": [], "scheme": found.question.recording.integrator}
    return content


def plant_of(content: Json, simulator: Simulator, process: Process | None = None) -> EffectsPlant:
    """The corrected simulator of a corrected.json; process: the Gaussian process beside the effects, if it is wanted.

    It may stand in the effects' place.
    """
    if isinstance(simulator, MjcfSimulator) and content.get("geometry"):
        simulator = simulator.in_geometry([_moved(each) for each in content["geometry"]])
    state = simulator.state  # which wraps where it does and where its recording said so
    wraps = (*(c.name for c in state if c.wraps), *content.get("wraps", ()))
    simulator = wrapping(simulator, Channels.of(state.units, wraps=wraps))
    if process is None or not content["gp"]:
        return plant_from(content, simulator)
    correction = GpCorrection(*process(simulator.state + simulator.action), "mean", sample_noise=False)
    return plant_from(content | content.get("with_gp", {}), simulator, correction)


def _moved(content: Json) -> Moved:
    try:
        return Moved(
            Place(**{k: content[k] for k in ("kind", "on", "axis", "unit")}), float(content["value"])
        )
    except (KeyError, TypeError, ValueError) as error:
        raise UsageError(f"corrected.json: geometry: not what this version can read ({error!r})") from error
