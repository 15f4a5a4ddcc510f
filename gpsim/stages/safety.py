"""Safe deployment: the monitor that watches a policy on its target, as configured, and what it does on stand-ins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gpsim import evaluation
from gpsim.artifacts import Artifact, read_artifact
from gpsim.channels import Channels, FloatArray
from gpsim.environments import Act, policy_actor
from gpsim.errors import UsageError
from gpsim.evaluation import NEVER, Drives, Limits, Monitor, MonitorSettings, Usual
from gpsim.recordings import Episode, Recording, gaps, read_recording
from gpsim.residuals import either_wraps, first_held_out, holding_out
from gpsim.settings import build, choice, number, positive, truth
from gpsim.simulators import Plant
from gpsim.stages import build_residuals, fit_gp
from gpsim.stages.building import base_plant, make_task, target_plant
from gpsim.stages.diagnose_loop import find_diagnosis
from gpsim.stages.policy_files import read_policy
from gpsim.stages.stage import Request, generator
from gpsim.stages.train_gp_policy import CORRECTIONS, corrected_plant, effects_plant

OF_THE_STAGE = ("safe", "policy", "noise", "limits", "fallback", "change", "change_at", "runs")
"""Settings of `deploy` that say what is driven; the others are the monitor's."""
STOP = "stop"


def safe(request: Request) -> bool:
    """Whether a policy is deployed under a monitor."""
    return truth(request.config["deploy"]["safe"], "deploy.safe")


def settings_of(request: Request) -> MonitorSettings:
    """The monitor's settings."""
    section = request.config["deploy"]
    rest = {key: value for key, value in section.items() if key not in OF_THE_STAGE}
    return build(MonitorSettings, rest, "deploy")


def check(request: Request) -> None:
    """Raise UsageError for settings with which nothing can be deployed."""
    section, state = request.config["deploy"], base_plant(request.config).state
    settings_of(request), limits_of(request), _noise(section["noise"], state)
    positive(section["runs"], "deploy.runs")
    if not number(section["change_at"], "deploy.change_at") >= 0:
        raise UsageError(f"deploy.change_at: expected a time of at least 0 s, got {section['change_at']!r}")
    if section["change"]:
        changed_target(request)
    if section["fallback"] != STOP:
        read_artifact(Path(str(section["fallback"])))


def limits_of(request: Request) -> Limits:
    """The box that the state must not leave."""
    given = _numbers(request.config["deploy"]["limits"], "deploy.limits")
    return Limits.of(given, base_plant(request.config).state)


def changed_target(request: Request) -> Plant:
    """The stand-in with the change that is concealed."""
    change, target = request.config["deploy"]["change"], request.config["target"]
    if not isinstance(change, Mapping):
        raise UsageError(
            f"deploy.change: expected settings of the target, as {{friction: 0.3}}, got {change!r}"
        )
    unknown = [key for key in change if key not in target]
    fixed = [key for key in change if key in ("name", "model")]  # another machine is no change of this one
    if fixed:
        raise UsageError(f"deploy.change: '{fixed[0]}' cannot change; choose another target")
    if unknown:
        raise UsageError(
            f"deploy.change: the target has no setting '{unknown[0]}'; valid settings: {', '.join(target)}"
        )
    return target_plant({**request.config, "target": {**target, **change}})


def predictor(request: Request) -> Plant:
    """The simulator that predicts, by its mean: as `correction` says; null: a given diagnosis, else the GPs."""
    said, mean = request.config["correction"], request.having(prediction="mean")
    if _by_gp(request):
        return corrected_plant(mean, fit_gp.STAGE.need(request).path)
    return effects_plant(mean if said else mean.having(correction="effects"), find_diagnosis(request))


def rests_on(request: Request) -> dict[str, Artifact]:
    """What the predictor is made of."""
    return {"gp": fit_gp.STAGE.need(request)} if _by_gp(request) else {"diagnosis": find_diagnosis(request)}


def _by_gp(request: Request) -> bool:
    said = request.config["correction"]
    if said is not None:
        choice(said, CORRECTIONS, "correction")
    return said == "gp" or (said is None and request.config["diagnosis"] is None)


def judged_episodes(recording: Recording, numbers: list[int]) -> list[Episode]:
    """What is held out of these episodes; whole ones where nothing is held out of them."""
    held, out = first_held_out(recording), []
    for i in numbers:
        e, first = recording.episodes[i], int(held[i])
        first = first if first < len(e.t) else 0
        if first < len(e):
            out.append(replace(e, t=e.t[first:], states=e.states[first:], actions=e.actions[first:]))
    return out


def usual_of(request: Request, plant: Plant) -> Usual:
    """Which errors are usual: on the recording's held-out episodes, on all where nothing is held out."""
    recording = read_recording(build_residuals.recording_folder(request))
    apart = holding_out(recording, build_residuals.check(request))
    first = first_held_out(apart)
    held = judged_episodes(apart, [i for i, e in enumerate(apart.episodes) if first[i] < len(e.t)])
    channels = either_wraps(plant.state, recording.state)
    noise = _noise(request.config["deploy"]["noise"], plant.state)
    rng = generator(request.seed, "deploy/usual")
    return evaluation.usual_errors(
        plant, held or recording.episodes, channels, noise, settings_of(request), rng
    )


def monitor_of(request: Request, purpose: str) -> Monitor:
    """The monitor as configured."""
    plant = predictor(request)
    rng = generator(request.start_seed, f"deploy/{purpose}")
    return Monitor(plant, usual_of(request, plant), settings_of(request), plant.state, rng)


def safe_deployment(request: Request, policy: Artifact) -> dict[str, Any]:
    """What the monitor does on the stand-in: with a change that is concealed, and for its minutes without one."""
    section, target = request.config["deploy"], target_plant(request.config)
    task = make_task(request.config).on_target()
    monitor, limits, settings = monitor_of(request, "monitor"), limits_of(request), settings_of(request)
    fallback: Act | None = None
    act = policy_actor(read_policy(policy.path))
    if section["fallback"] != STOP:
        fallback = policy_actor(read_policy(read_artifact(Path(str(section["fallback"]))).path))
    count, at = int(section["runs"]), round(float(section["change_at"]) / target.dt)
    changed: dict[str, Any] | None = None
    if section["change"]:
        plant = evaluation.ChangingPlant(target, changed_target(request), at)
        found = evaluation.drive(
            plant, task, act, monitor, limits, count=count, steps=task.max_steps, endless=False,
            rng=generator(request.start_seed, "deploy/changed"), fallback=fallback,
        )  # fmt: skip
        changed = _changed(found, at, target.dt)
    steps = round(settings.minutes * 60.0 / target.dt)
    found = evaluation.drive(
        target, task, act, monitor, limits, count=count, steps=steps, endless=True,
        rng=generator(request.start_seed, "deploy/unchanged"),
    )  # fmt: skip
    stops = int((found.stopped != NEVER).sum())
    return {
        "policy": section["policy"],
        "usual_mean_score": monitor.usual.mean,
        "calibrated_on_steps": monitor.usual.steps,
        "stated_false_stops": settings.false_stops,
        "minutes": settings.minutes,
        "changed": changed,
        "unchanged": {  # drives that nothing happened to
            "drives": len(found.stopped),
            "false_stops": stops,
            "share": stops / len(found.stopped),
            "left_limit": int((found.left != NEVER).sum()),
            "minutes_driven": float(found.steps.sum() * target.dt / 60.0),
        },
    }


def _changed(found: Drives, at: int, dt: float) -> dict[str, Any]:
    """Of drives that met the change: stopped before the limit, at the limit first, neither."""
    met = found.steps > at
    late = (found.stopped != NEVER) & met
    too_early = (found.stopped != NEVER) & (found.stopped <= at)
    before = late & ((found.left == NEVER) | (found.stopped < found.left))
    first = (found.left > at) & ~before
    harmed = int(before.sum() + first.sum())
    return {
        "drives": int(met.sum()),
        "stopped_before_limit": int(before.sum()),
        "limit_first": int(first.sum()),
        "went_on": int((met & ~before & ~first).sum()),
        "share_before_limit": float(before.sum() / harmed) if harmed else None,
        "stopped_too_early": int(too_early.sum()),
        "median_seconds_to_stop": float(np.median(found.stopped[before] - at) * dt) if before.any() else None,
        "left_limit_after_stop": int((before & (found.left != NEVER)).sum()),
        "mean_return": float(found.returns.mean()),
    }


def safety_lines(found: Mapping[str, Any]) -> list[str]:
    """What a person wants to know of it."""
    of, lines = found["unchanged"], []
    if (changed := found["changed"]) is not None:
        after = changed["median_seconds_to_stop"]
        lines.append(
            f"monitor, concealed change: {changed['stopped_before_limit']} of {changed['drives']} drives stopped "
            f"before the limit, {changed['limit_first']} reached it first, {changed['went_on']} went on"
            + (f"; {after:.2f} s after the change (median)" if after is not None else "")
        )
    lines.append(
        f"monitor, nothing changed: {of['false_stops']} false stops in {of['drives']} drives of up to "
        f"{found['minutes']:g} minutes ({of['minutes_driven']:.1f} in all); stated: "
        f"{found['stated_false_stops']:g} each"
    )
    return lines


def watched(request: Request, recording: Recording, parts: Sequence[tuple[str, Any]]) -> list[dict[str, Any]]:
    """Of recorded drives where the monitor, or a limit, would have stopped them. parts: their names and episodes."""
    base = base_plant(request.config)
    if recording.state.names != base.state.names or recording.action.names != base.action.names:
        raise UsageError(
            f"the log has {', '.join((recording.state + recording.action).names)}; the simulator predicts "
            f"{', '.join(base.state.names)} from {', '.join(base.action.names)}: map the log to these channels"
        )
    monitor, limits = monitor_of(request, "replay"), limits_of(request)
    monitor.channels = either_wraps(base.state, recording.state)
    return [{"drive": name, **_replayed(monitor, limits, episode)} for name, episode in parts]


def _replayed(monitor: Monitor, limits: Limits, episode: Any) -> dict[str, Any]:
    """When [s], since the drive began, and why it would have been stopped."""
    lost = gaps(episode.t, monitor.plant.dt)
    monitor.begin(episode.states[:1])
    out: dict[str, Any] = {"seconds": float(episode.t[-1] - episode.t[0]), "stopped_at": None, "why": None}
    for k, action in enumerate(episode.actions):
        after = episode.states[k + 1 : k + 2]
        if lost[k] or not np.isfinite(action).all():
            monitor.rejoin(np.ones(1, dtype=np.bool_), after)
            continue
        alarm, outside = monitor.observe(action[None], after)[0], limits.left(after)[0]
        if alarm or outside:
            why = "limit" if outside else "the simulator no longer predicts it"
            return out | {"stopped_at": float(episode.t[k + 1] - episode.t[0]), "why": why}
    return out


def _numbers(given: Any, where: str) -> dict[str, float]:
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise UsageError(f"{where}: expected a mapping of numbers, as {{x: 1.0}}, got {given!r}")
    return {str(name): number(value, f"{where}.{name}") for name, value in given.items()}


def _noise(given: Any, state: Channels) -> FloatArray:
    """(S,): of channels that are not named, 0."""
    named = _numbers(given, "deploy.noise")
    for name, value in named.items():
        if name not in state.names:
            raise UsageError(f"deploy.noise: no channel '{name}'; the state has {', '.join(state.names)}")
        if value < 0.0:
            raise UsageError(f"deploy.noise.{name}: expected a number of at least 0, got {value:g}")
    return np.array([named.get(name, 0.0) for name in state.names])
