"""train-gp-policy: the same training as train-source, in the corrected simulator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from gpsim import corrected
from gpsim.artifacts import Artifact, Recipe
from gpsim.corrected import PREDICTIONS, CorrectedPlant, EffectsPlant, GpCorrection, PosteriorPlant
from gpsim.errors import UsageError
from gpsim.files import Json
from gpsim.gp import DrawnFunctions
from gpsim.mjcf.gym_task import GymTask
from gpsim.policies.training.settings import TRAINING_FORMAT
from gpsim.settings import choice, texts, truth
from gpsim.simulators import Plant, SimulatorPlant
from gpsim.stages import fit_gp, train_source
from gpsim.stages.build_residuals import other_settings
from gpsim.stages.building import base_plant, drivable, make_task
from gpsim.stages.diagnose import read_corrected, read_left_open, why_no_gp
from gpsim.stages.diagnose_loop import find_diagnosis
from gpsim.stages.policy_files import read_filter, read_gp_correction, survival_lines, write_survives
from gpsim.stages.stage import IN_NUMBERS, Request, Stage, generator
from gpsim.stages.train_source import train
from gpsim.tasks import Task

CORRECTIONS = ("gp", "effects", "effects+gp")
ROBUSTNESS = ("none", "posterior")
FUNCTIONS = 64
"""So many functions of the Gaussian process are drawn; every episode has one of them."""


def recipe(request: Request) -> Recipe:
    """The base simulator, what corrects it and how."""
    settled = _settled(request)
    correction = settled.config["correction"]
    keys = ["simulator", "task", "policy", "correction"]
    if robust(settled):
        keys.append("robustness")
    elif correction != "effects":
        keys.append("prediction")
        if choice(request.config["prediction"], PREDICTIONS, "prediction") == "sample":
            keys.append("sample_noise")  # a mean is the same whatever a sample is of
    parents = (
        {"gp": fit_gp.STAGE.need(request)} if correction == "gp" else {"diagnosis": find_diagnosis(request)}
    )
    return Recipe("train-gp-policy", settled.section(*keys), parents, {"seed": request.seed})


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Train and write the policy and its learning curve."""
    request = _settled(request)
    task = make_task(request.config)
    correction, prediction = request.config["correction"], request.config["prediction"]
    of = {"gp": prediction, "effects": "effects", "effects+gp": f"effects+gp/{prediction}"}[str(correction)]
    purpose = f"train-gp-policy/posterior/{correction}" if robust(request) else f"train-gp-policy/{of}"
    events = train_source.events_of(request, recipe, purpose)
    if robust(request):  # in draws of the posterior; beside the policy stands what it was trained to survive
        drawn = posterior_plant(request, recipe.parents["diagnosis"])
        made = train(request, drawn, task, purpose, folder, None, events)
        write_survives(folder, drawn)
        return made

    def plant(request: Request) -> Plant:
        if correction == "gp":
            return corrected_plant(request, recipe.parents["gp"].path)
        return effects_plant(request, recipe.parents["diagnosis"])

    expected = plant(request.having(prediction="mean"))
    return train(request, plant(request), task, purpose, folder, expected, events)


def _settled(request: Request) -> Request:
    """With what corrects: where nothing is said, a diagnosis that is given, else the Gaussian process.

    Where the diagnosis left the Gaussian process out, `effects+gp` is the simulator that `effects` is: one policy.
    """
    said = request.config["correction"]
    if robust(request) and said in (None, "gp"):
        if said == "gp":
            raise UsageError(
                "robustness=posterior draws from a diagnosis; choose correction=effects, or correction=effects+gp "
                "with the Gaussian process"
            )
        request, said = request.having(correction="effects+gp"), "effects+gp"
    if said is None:
        return request.having(correction="gp" if request.config["diagnosis"] is None else "effects")
    choice(said, CORRECTIONS, "correction")
    return request.having(correction="effects") if _left_out(request) else request


def robust(request: Request) -> bool:
    """Whether episodes draw from the posterior; raises UsageError for another word."""
    return choice(request.config["robustness"], ROBUSTNESS, "robustness") == "posterior"


def _left_out(request: Request) -> str | None:
    """Why there is no Gaussian process though one was asked for."""
    return why_no_gp(find_diagnosis(request).path) if request.config["correction"] == "effects+gp" else None


def remarks(request: Request) -> list[str]:
    """Whether a Gaussian process that was asked for was left out, and where event files lie."""
    why = _left_out(request)
    said = [f"no Gaussian process with the effects, as with correction=effects: {why}"] if why else []
    return [*said, *train_source.tracking_remarks(request)]


def corrected_plant(request: Request, gp_folder: Path) -> CorrectedPlant:
    """The base simulator corrected by the GPs, as the request's `prediction` and `sample_noise` say."""
    base = base_plant(request.config)
    prediction = choice(request.config["prediction"], PREDICTIONS, "prediction")
    correction = read_gp_correction(gp_folder, base.state + base.action, prediction, _noise(request))  # type: ignore[arg-type]
    return CorrectedPlant(
        base.simulator, base.parameters, base.integrator, base.dt, correction, read_filter(gp_folder)
    )


def effects_plant(request: Request, diagnosis: Artifact) -> EffectsPlant:
    """The base simulator with the effects that a diagnosis named, and with `effects+gp` a GP on the remainder."""
    plant = read_corrected(diagnosis.path, gp=request.config["correction"] == "effects+gp")
    _check_fits(plant, base_plant(request.config), diagnosis.path)
    if not isinstance(plant.correction, GpCorrection):
        return plant
    prediction = choice(request.config["prediction"], PREDICTIONS, "prediction")
    sampled = replace(plant.correction, prediction=prediction, sample_noise=_noise(request))  # type: ignore[arg-type]
    return replace(plant, correction=sampled)


def posterior_plant(request: Request, diagnosis: Artifact) -> PosteriorPlant:
    """What the diagnosis leaves open, with `effects+gp` a function an episode of the Gaussian process on the rest too.

    It was fitted beside the leading explanation, and goes with that one alone; nor with any where it stands in the
    place of the effects.
    """
    _check_fits(leader := read_corrected(diagnosis.path), base_plant(request.config), diagnosis.path)
    drawn = read_left_open(diagnosis.path).drawn_in(leader, str(diagnosis.path))
    if request.config["correction"] != "effects+gp":
        return drawn
    first, correction = drawn.explanations[0], read_corrected(diagnosis.path, gp=True)
    if not isinstance(correction.correction, GpCorrection) or correction.terms != leader.terms:
        return drawn
    rng = generator(request.seed, "train-gp-policy/functions")
    functions = DrawnFunctions(correction.correction.predictor, FUNCTIONS, rng)
    with_gp = replace(
        first.plant, correction=corrected.FunctionCorrection(functions, correction.correction.features)
    )
    return PosteriorPlant((replace(first, plant=with_gp), *drawn.explanations[1:]))


def simulators_of(request: Request, gp_folder: Path, diagnosis: Artifact | None) -> dict[str, Plant]:
    """The base simulator and what corrects it, by the name of the policy that is trained there."""
    found: dict[str, Plant] = {
        "Source": base_plant(request.config),
        "GP-Mean": corrected_plant(request.having(prediction="mean"), gp_folder),
        "GP-Sample": corrected_plant(request.having(prediction="sample"), gp_folder),
    }
    if diagnosis is not None:
        found["Effects"] = effects_plant(request.having(correction="effects"), diagnosis)
    return found


def _check_fits(plant: EffectsPlant, base: SimulatorPlant, where: Path) -> None:
    """What a diagnosis corrects must be the experiment's simulator, at its pace and with its parameters."""
    theirs, ours = plant.simulator, base.simulator
    if (theirs.state.units, theirs.action.units, theirs.name.rpartition(":")[2]) != (
        ours.state.units, ours.action.units, ours.name.rpartition(":")[2],
    ):  # fmt: skip
        raise UsageError(
            f"diagnosis={where} corrects the simulator {theirs.name}, this experiment's is {ours.name}; "
            f"choose a diagnosis of {ours.name}, or an experiment with that simulator"
        )
    wanted = other_settings(base, plant.dt, plant.parameters)
    if wanted:
        raise UsageError(
            f"diagnosis={where} corrects another simulator than this experiment's: choose {' '.join(wanted)}, or "
            "diagnose a recording with the same time step and parameters"
        )


def _noise(request: Request) -> bool:
    return truth(request.config["sample_noise"], "sample_noise")


STAGE = Stage(
    "train-gp-policy",
    recipe,
    write,
    lambda artifact: survival_lines(artifact.path),
    remarks=remarks,
    format=TRAINING_FORMAT,
    code=IN_NUMBERS,
)


TRAINED_BY: Mapping[str, tuple[Stage, dict[str, str]]] = {
    "Source": (train_source.STAGE, {"variant": "source"}),
    "Domain randomisation": (train_source.STAGE, {"variant": "randomised"}),
    "GP-Mean": (STAGE, {"correction": "gp", "prediction": "mean"}),
    "GP-Sample": (STAGE, {"correction": "gp", "prediction": "sample"}),
    "Effects": (STAGE, {"correction": "effects"}),
    "Posterior": (STAGE, {"correction": "effects+gp", "robustness": "posterior"}),
    "Target": (train_source.STAGE, {"variant": "target"}),
}
"""The policies of Table 4.4, the one of the named effects, and the stage that trains each."""
DIAGNOSED = ("Effects", "Posterior")
"""Policies that need a diagnosis."""


def full_return(task: Task) -> int | None:
    """The return that means that a start is solved; None of a task whose rewards are its own affair."""
    return None if isinstance(task, GymTask) else task.max_steps


def policy_names(request: Request) -> tuple[str, ...]:
    """The policies to compare."""
    names = texts(request.config["evaluate"]["policies"], "evaluate.policies")
    unknown = [name for name in names if name not in TRAINED_BY]
    if unknown or not names:
        raise UsageError(
            f"evaluate.policies: '{(unknown or ['nothing'])[0]}' is not one of {', '.join(TRAINED_BY)}"
        )
    return tuple(name for name in dict.fromkeys(names) if name != "Target" or drivable(request.config))


def needs_diagnosis(request: Request) -> bool:
    """Whether a policy that is compared was trained in what a diagnosis found."""
    return not set(DIAGNOSED).isdisjoint(policy_names(request))
