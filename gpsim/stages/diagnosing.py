"""How a recording is diagnosed and corrected, whoever asks: a stage, with folders, or Python, in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from gpsim.channels import Channels
from gpsim.corrected import EffectsPlant, Features, GpCorrection, ages_of, describe, plant_from
from gpsim.diagnosis import Diagnosis, Outcome, diagnose
from gpsim.diagnosis.run import Run, cores
from gpsim.diagnosis.settings import Known, Settings
from gpsim.diagnosis.setup import look
from gpsim.errors import UsageError
from gpsim.files import Json
from gpsim.gp import Predictor
from gpsim.recordings import Recording
from gpsim.residuals import check_each_holds_out, check_rates
from gpsim.simulators import Simulator, wrapping
from gpsim.stages.stage import Progress, generator, silent
from gpsim.stages.users_code import blamed

Process = Callable[[Channels], tuple[Predictor, Features]]
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
        parameters = simulator.defaults(recording.parameters)
        sight = look(recording, simulator)
        _check_names(simulator)
        check_each_holds_out(recording)
        check_rates(sight.completed(recording), sight.simulator, parameters)
        rng = generator(question.seed, "diagnose")
        with cores(question.cores) as workers:
            run = Run(workers, question.settings, known=question.known)
            return diagnose(recording, simulator, parameters, rng, question.progress, run)


def _check_names(simulator: Simulator) -> None:
    """diagnosis.json has one key of its own beside the state channels (`fit.rollout`)."""
    if "horizon_s" in simulator.state.names:
        raise UsageError(
            "a state called 'horizon_s': diagnosis.json says there how far rollouts go; call the channel otherwise"
        )


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
    if gp is not None and gp.beside == "base":
        content["with_gp"] = {"terms": [], "scheme": found.question.recording.integrator}
    return content


def plant_of(content: Json, simulator: Simulator, process: Process | None = None) -> EffectsPlant:
    """The corrected simulator of a corrected.json; process: the Gaussian process beside the effects, if it is wanted.

    It may stand in the effects' place.
    """
    simulator = wrapping(simulator, _wrapped(simulator.state, content.get("wraps", ())))
    if process is None or not content["gp"]:
        return plant_from(content, simulator)
    correction = GpCorrection(*process(simulator.state + simulator.action), "mean", sample_noise=False)
    return plant_from(content | content.get("with_gp", {}), simulator, correction)


def _wrapped(state: Channels, too: Iterable[str]) -> Channels:
    """A simulator's state channels, wrapping where they do and where their recording said so."""
    return Channels.of(state.units, wraps=(*(c.name for c in state if c.wraps), *too))
