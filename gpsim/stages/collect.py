"""collect: drive the target and record what happens, or import what was recorded of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from gpsim.artifacts import Recipe
from gpsim.corrected import CorrectedPlant, Features, GpCorrection
from gpsim.environments import (
    Act,
    ActiveSettings,
    Model,
    as_sensed,
    collect_actively,
    collect_episodes,
    dithered_actor,
    first_of,
    policy_actor,
    random_actor,
)
from gpsim.errors import UsageError
from gpsim.files import Json
from gpsim.gp import Predictor, fit_outputs
from gpsim.recordings import Episode, write_recording
from gpsim.settings import build, choice, number, positive
from gpsim.stages import building, train_source
from gpsim.stages.building import base_plant, make_task, recording_of, residuals_of, target_plant
from gpsim.stages.import_log import (
    changes_of,
    logs_of,
    read_configured,
    read_mapping,
    salvages,
    source_digests,
    write_import,
)
from gpsim.stages.policy_files import read_policy
from gpsim.stages.stage import Request, Stage, generator
from gpsim.stages.sweep import check_sweep, run_sweep, sweep_mapping

ACTIVE = "active"
ON_THE_WAY = 60  # iterations of a fit


def active(request: Request) -> bool:
    """Whether uncertainty drives; raises UsageError for another word."""
    said = request.config["strategy"]
    return said is not None and choice(said, (ACTIVE,), "strategy") == ACTIVE


def active_settings(request: Request) -> ActiveSettings:
    """How it is driven."""
    return build(ActiveSettings, request.config["active"], "active")


def _fitted(request: Request, settings: ActiveSettings, episodes: Sequence[Episode]) -> Model:
    """The corrected simulator of what was recorded so far, of a part of it drawn by seed."""
    base = base_plant(request.config)
    residuals = residuals_of(base, episodes, generator(request.seed, "collect/active/order"))
    features = Features.of(building.input_names(request), residuals.channels)
    rows, fit = residuals.training_rows(settings.n_train), building.fit_settings(request)
    # A fit on the way says where to drive next; the one that counts is fit-gp's.
    most = min(fit.max_iterations, ON_THE_WAY)
    quick = replace(fit, restarts=min(fit.restarts, 1), max_iterations=most)
    try:
        gps = fit_outputs(
            features(residuals.inputs[rows]),
            residuals.values[rows],
            quick,
            generator(request.seed, "collect/active/fit"),
        )
    except ValueError as error:
        raise UsageError(f"strategy=active: no Gaussian process fits what was recorded ({error})") from error
    predictor = Predictor(gps)
    correction = GpCorrection(predictor, features, "mean", sample_noise=False)
    plant = CorrectedPlant(base.simulator, base.parameters, base.integrator, base.dt, correction)
    return Model(plant, predictor, features)


DRIVERS = ("source", "random", "dithered", "sweep")


def recipe(request: Request) -> Recipe:
    """The target, the task and who drives; or the logs and how they are read."""
    section = request.config["collect"]
    if section["source"] is not None:
        mapping, changes = _mapping(request), changes_of(section)
        read = {
            "mapping": read_mapping(mapping) if mapping is not None else None,
            "salvage": salvages(section),
            "changes": changes,
            "sources": source_digests(_sources(request), mapping, changes),
        }
        return Recipe("collect", {"import": read}, {}, {})
    check(request)
    driver = section["policy"]
    by_policy = driver not in ("random", "sweep") and not active(request)
    parents = {"policy": train_source.STAGE.need(request.having(variant="source"))} if by_policy else {}
    config = request.section("simulator", "target", "task", "collect")
    if active(request):
        config |= request.section("strategy", "active", "gp")
        return Recipe("collect", config, {}, {"seed": request.seed})
    if driver == "sweep":  # which reads what it logged through the mapping
        config["mapping"] = read_mapping(sweep_mapping(request.config))
    return Recipe("collect", config, parents, {"seed": request.seed})


def waits_for_policy(request: Request) -> bool:
    """Whether the configuration's `collect` is driven by the source policy."""
    section = request.config["collect"]
    if active(request):
        return False
    return section["source"] is None and section["policy"] in ("source", "dithered")


def check(request: Request) -> None:
    """Raise UsageError for settings with which nothing can be recorded."""
    section = request.config["collect"]
    changes_of(section), salvages(section)
    if section["source"] is not None:
        _check_logs(request)
        return
    target_plant(request.config)
    if section["transitions"] is not None:
        positive(section["transitions"], "collect.transitions")
    if not number(section["noise"], "collect.noise") >= 0:
        raise UsageError(f"collect.noise: expected a number of at least 0, got {section['noise']!r}")
    if not 0 <= number(section["missing"], "collect.missing") < 1:
        raise UsageError(f"collect.missing: expected a number in [0, 1), got {section['missing']!r}")
    if active(request):
        active_settings(request)
        building.check_gp(request)
    elif choice(section["policy"], DRIVERS, "collect.policy") == "sweep":
        check_sweep(request.config)
    else:
        positive(section["episodes"], "collect.episodes")
        if not 0 <= number(section["dither"], "collect.dither") <= 1:
            raise UsageError(f"collect.dither: expected a number in [0, 1], got {section['dither']!r}")


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Run the episodes, or read the logs, and write a Recording."""
    if request.config["collect"]["source"] is not None:
        recording, report, _ = read_configured(request.config["collect"], _sources(request))
        write_import(recording, report, folder)
        return {"transitions": recording.transition_count}
    section: dict[str, Any] = request.config["collect"]
    if section["policy"] == "sweep" and not active(request):
        return run_sweep(request, folder)
    base, driver = base_plant(request.config), ACTIVE if active(request) else section["policy"]
    episodes = _driven(request, recipe)
    sensed, noise = as_sensed(
        first_of(episodes, section["transitions"]),
        base.state,
        float(section["noise"]),
        float(section["missing"]),
        generator(request.seed, "collect/sensors"),
    )
    recording = recording_of(base, sensed, driver, request.seed, noise)
    write_recording(recording, folder)
    return {"transitions": recording.transition_count}


def _driven(request: Request, recipe: Recipe) -> tuple[Episode, ...]:
    """The episodes, as they truly were."""
    if active(request):  # to where the Gaussian processes of `gp` are least sure
        settings = active_settings(request)
        return collect_actively(
            target_plant(request.config),
            make_task(request.config).on_target(),
            lambda episodes: _fitted(request, settings, episodes),
            settings,
            generator(request.seed, "collect/active"),
            request.progress,
        )
    section = request.config["collect"]
    return collect_episodes(
        target_plant(request.config),
        make_task(request.config).on_target(),
        _driver(request, recipe, section),
        positive(section["episodes"], "collect.episodes"),
        generator(request.seed, "collect/episodes"),
    )


def _check_logs(request: Request) -> None:
    mapping = _mapping(request)
    if mapping is not None:
        read_mapping(mapping)
    for source in _sources(request):
        try:
            source.stat()
        except OSError as error:
            raise UsageError(f"collect.source: {source}: cannot be read ({error.strerror})") from error


def _sources(request: Request) -> list[Path]:
    return logs_of(request.config["collect"]["source"], "collect.source")


def _mapping(request: Request) -> str | None:
    given = request.config["collect"]["mapping"]
    return None if given is None else str(given)


def _driver(request: Request, recipe: Recipe, section: dict[str, Any]) -> Act:
    task, rng = make_task(request.config), generator(request.seed, "collect/driver")
    if section["policy"] == "random":
        return random_actor(task, rng)
    # The policy's own distribution, not its most probable action: exploration is what a recording is for.
    actor = policy_actor(read_policy(recipe.parents["policy"].path), rng)
    if section["policy"] == "source":
        return actor
    return dithered_actor(actor, task, float(section["dither"]), rng)


STAGE = Stage("collect", recipe, write, format=1)
