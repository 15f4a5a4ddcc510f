"""Sixty simulated machines where a regression on a library can play: gpsim's own blind test draws them.

The worlds are those of `gpsim prove --seed 7100` in which every true effect is a term of the peers' library
(gpsim.trials.sindy) and acts everywhere: the first thirty with effects and the first thirty with nothing missing. The
peers are given what gpsim has to find out: which force the base simulator lacks, computed from one-step accelerations,
and a library that holds the truth; mujoco.sysid is given the machine as MJCF (`worlds_sysid`). A world is right where
the set of (family, place) is the true one.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peer_grounds.contract import Answer, Ground, Peer, Score, Task

SEED, EACH = 7100, 30
MOST = 3000  # numbers that are looked at
NEAR = 0.05  # of a true size, that a size may be off to be right
THRESHOLDS = tuple(np.geomspace(0.1, 0.6, 10))
Floats = NDArray[np.float64]
Claim = frozenset[tuple[str, str]]
Namer = Callable[[Any], tuple[Claim, dict[tuple[str, str], Any]]]
"""From a recording, what is claimed, and the sizes of each claim."""


def worlds(folder: Path) -> list[dict[str, Any]]:
    """The worlds, drawn once into a folder that all peers of the ground share: number, effects, path."""
    listing = folder / "worlds.json"
    if not listing.is_file():
        from gpsim.files import write_json
        from gpsim.trials.blinding import publish_hashes, trial_name, write_trial

        folder.mkdir(parents=True, exist_ok=True)
        numbers = list(chosen())
        publish_hashes(folder, {trial_name(n): write_trial(folder, SEED, n) for n in numbers})
        write_json(listing, numbers)
    found = []
    for number in json.loads(listing.read_text(encoding="utf-8")):
        path = folder / "private" / f"{number:04d}" / "answer.json"
        content = json.loads(path.read_text(encoding="utf-8"))
        found.append(
            {"number": number, "effects": content["effects"], "path": folder / "public" / f"{number:04d}"}
        )
    return found


def chosen() -> Iterator[int]:
    """Numbers of the first thirty worlds with effects and the first thirty without, where a library can play."""
    from gpsim.trials.drawing import draw, stratum_of
    from gpsim.trials.sindy import applies
    from gpsim.trials.worlds import effect_json

    counts = {True: 0, False: 0}
    for number in range(1, MOST):
        stratum, long, _ = stratum_of(number)
        lacks = stratum != "none"
        if long or stratum == "unknown" or counts[lacks] >= EACH:
            continue
        world = draw(SEED, number)
        content = {"world": {"system": world.system}, "effects": [effect_json(e) for e in world.effects]}
        if applies(content):
            counts[lacks] += 1
            yield number
        if min(counts.values()) >= EACH:
            return


# What the regressions are given


def lacking(recording: Any) -> Iterator[tuple[str, list[str], Floats, Floats, str]]:
    """Of each coordinate: its name, the terms, their columns (N, T), the force that lacks (N,), the command's name.

    Nothing where the force that lacks is less than a hundredth of what moves: there the integrator's error is named.
    """
    from gpsim.trials.sindy import LIBRARY, NEGLIGIBLE
    from gpsim.trials.worlds import SYSTEMS, dynamics

    system = SYSTEMS[recording.system]
    before = np.concatenate([e.states[:-1] for e in recording.episodes])
    after = np.concatenate([e.states[1:] for e in recording.episodes])
    action = np.concatenate([e.actions for e in recording.episodes])
    middle = (before + after) / 2
    inverse, force = dynamics(system.name, recording.parameters, middle, action)
    moving = (np.linalg.inv(inverse) * ((after - before)[:, 1::2] / recording.dt)[:, None, :]).sum(axis=2)
    left = moving - force
    for c, coordinate in enumerate(system.coordinates):
        if np.mean(left[:, c] ** 2) < NEGLIGIBLE**2 * np.mean(moving[:, c] ** 2):
            continue
        swings = system.name == "pendulum" or (system.name == "cartpole" and c == 1)
        terms = [
            t for t in LIBRARY if (c == 0 or not t.startswith("actuator")) and (swings or t != "gravity")
        ]
        columns = [LIBRARY[t](middle[:, 2 * c], middle[:, 2 * c + 1], action[:, 0]) for t in terms]
        yield coordinate, terms, np.stack(columns, axis=1), left[:, c], next(iter(system.action))


def by_regression(select: Callable[[Floats, Floats], Sequence[bool]]) -> Namer:
    """A namer that selects columns (N, T) for a force (N,); sizes by least squares on those it selects."""
    alone = {"spring": "constant_force", "actuator_asymmetry": "actuator_gain"}

    def name(recording: Any) -> tuple[Claim, dict[tuple[str, str], list[float]]]:
        claims: dict[tuple[str, str], list[float]] = {}
        for coordinate, terms, columns, force, command in lacking(recording):
            kept = np.flatnonzero(np.asarray(select(columns, force)))
            if not len(kept):
                continue
            weights = dict(
                zip(
                    [terms[k] for k in kept],
                    np.linalg.lstsq(columns[:, kept], force, rcond=None)[0],
                    strict=True,
                )
            )
            brought = {alone[t] for t in weights if t in alone}
            for term, weight in weights.items():
                if term in brought:
                    continue
                place = (
                    ("parameter_offset", "gravity")
                    if term == "gravity"
                    else (term, command if term.startswith("actuator") else coordinate)
                )
                claims[place] = sizes(term, float(weight), {t: float(w) for t, w in weights.items()})
        return frozenset(claims), claims

    return name


def sizes(term: str, weight: float, weights: dict[str, float]) -> list[float]:
    """The numbers of a family, in the catalogue's order, by its column's weight; nothing where a model is needed."""
    if term in ("viscous_friction", "quadratic_drag", "coulomb_friction"):
        return [-weight]
    if term == "constant_force":
        return [weight]
    if term == "actuator_gain":
        return [1.0 + weight]
    if term == "actuator_asymmetry":
        middle = 1.0 + weights.get("actuator_gain", 0.0)
        return [middle + weight, middle - weight]
    return []


def pysindy_select(columns: Floats, force: Floats) -> Sequence[bool]:
    """STLSQ on normalised columns, its threshold by BIC."""
    import pysindy

    size = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    x, y = columns / size, force / np.sqrt(np.mean(force**2))
    best, kept = len(y) * np.log(np.mean(y**2)), np.zeros(x.shape[1], dtype=bool)
    for threshold in THRESHOLDS:
        mask = np.abs(pysindy.STLSQ(threshold=threshold, alpha=1e-6).fit(x, y[:, None]).coef_.ravel()) > 0
        if not mask.any():
            continue
        left = y - x[:, mask] @ np.linalg.lstsq(x[:, mask], y, rcond=None)[0]
        bic = len(y) * np.log(max(float(np.mean(left**2)), 1e-300)) + mask.sum() * np.log(len(y))
        if bic < best:
            best, kept = bic, mask
    return [bool(k) for k in kept]


def frols_select(columns: Floats, force: Floats) -> Sequence[bool]:
    """Forward regression orthogonal least squares of SysIdentPy: the columns as inputs, the number of terms by BIC."""
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    size = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    x = np.vstack([columns[1:], columns[-1:]]) / size  # its inputs act one sample later
    y = force / np.sqrt(np.mean(force**2))
    model = FROLS(
        ylag=1, xlag=[[1]] * x.shape[1], basis_function=Polynomial(degree=1), model_type="NFIR", info_criteria="bic",
        estimator=LeastSquares(), n_info_values=x.shape[1],
    )  # fmt: skip
    model.fit(X=x, y=y[:, None])
    chosen = {int(code) // 1000 - 2 for row in np.atleast_2d(model.final_model) for code in np.ravel(row)}
    constant = 0 in {int(code) for row in np.atleast_2d(model.final_model) for code in np.ravel(row)}
    return [k in chosen or (k == 0 and constant) for k in range(x.shape[1])]


def pysr_select(columns: Floats, force: Floats) -> Sequence[bool]:
    """Symbolic regression of PySR on the same columns: the terms that its best equation uses."""
    from pysr import PySRRegressor

    size = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    rows = np.linspace(0, len(force) - 1, min(len(force), 1000)).astype(int)
    model = PySRRegressor(
        binary_operators=["+", "*"], niterations=20, maxsize=15, progress=False, verbosity=0
    )
    model.fit((columns / size)[rows], (force / np.sqrt(np.mean(force**2)))[rows])
    used = {str(symbol) for symbol in model.sympy().free_symbols}
    return [f"x{k}" in used for k in range(columns.shape[1])]


def by_sysid(recording: Any) -> tuple[Claim, dict[tuple[str, str], Any]]:
    """mujoco.sysid, whose package may be absent."""
    from peer_grounds.worlds_sysid import by_sysid as told

    return told(recording)


# Playing and scoring


def told_by_gpsim(folder: Path, number: int) -> tuple[Claim, dict[tuple[str, str], Any]]:
    """What a blind diagnosis claims; what is slight counts, too."""
    from gpsim.trials.blinding import diagnose_blind, trial_name
    from gpsim.trials.claims import identity

    diagnose_blind(folder, trial_name(number))
    report = next((folder / "diagnoses" / trial_name(number)).rglob("diagnosis.json"), None)
    if report is None:
        return frozenset({("failed", "")}), {}
    effects = json.loads(report.read_text(encoding="utf-8"))["effects"]
    claims = {identity(e): {name: p["value"] for name, p in e["parameters"].items()} for e in effects}
    return frozenset(claims), claims


def play(task: Task, namer: Namer | None, tuned: str) -> Answer:
    """Every world, one after another; what was answered is kept in the folder."""
    from gpsim.recordings import read_recording

    shared = task.folder.parent / "worlds"
    lines = []
    for world in worlds(shared):
        path = task.folder / f"{world['number']:04d}.json"
        if not path.is_file():
            try:
                said, found = (
                    told_by_gpsim(shared, world["number"])
                    if namer is None
                    else namer(read_recording(world["path"]))
                )
                line = {
                    "said": sorted(map(list, said)),
                    "sizes": [[*k, v] for k, v in sorted(found.items())],
                    "why": "",
                }
            except Exception as error:
                line = {
                    "said": [["failed", ""]],
                    "sizes": [],
                    "why": f"{type(error).__name__}: {error}"[:200],
                }
            if not line["why"]:  # what crashed is tried again
                path.write_text(json.dumps(line), encoding="utf-8")
        else:
            line = json.loads(path.read_text(encoding="utf-8"))
        lines.append((world, line))
        print(world["number"], lines[-1][1]["said"], flush=True)
    failed = [line["why"] for _, line in lines if line["why"]]
    if sum(bool(line["why"]) for world, line in lines if world["effects"]) >= EACH // 2:
        raise RuntimeError(failed[0])
    return scored(lines, tuned, f"{len(failed)} worlds crashed, first: {failed[0]}" if failed else "")


def share(hits: int, of: int) -> Score:
    """Per cent with Wilson's 90 % interval."""
    if not of:
        return Score(None, "%")
    z, p = 1.645, hits / of
    middle, half = p + z * z / (2 * of), z * np.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    low, high = ((middle + sign * half) / (1 + z * z / of) for sign in (-1, 1))
    return Score(100.0 * p, "%", float(100.0 * low), float(100.0 * high))


def scored(lines: Sequence[tuple[dict[str, Any], dict[str, Any]]], tuned: str, notes: str) -> Answer:
    """Right names, sizes and false alarms."""
    hits = {"lacking": [], "quiet": []}
    errors = []
    for world, line in lines:
        truth = frozenset((e["family"], e["on"]) for e in world["effects"])
        said = frozenset((family, place) for family, place in line["said"])
        hits["lacking" if truth else "quiet"].append(said == truth)
        given = {(family, place): values for family, place, values in line["sizes"]}
        for effect in world["effects"]:
            values = given.get((effect["family"], effect["on"]), [])
            true = list(effect["parameters"].values())
            if isinstance(values, dict):
                values = [values[name] for name in effect["parameters"] if name in values]
            elif "coefficient" in effect["parameters"]:
                continue  # a regression tells a force, which is no coefficient
            if len(values) == len(true):
                errors += [abs(v - t) / max(abs(t), 1e-12) for v, t in zip(values, true, strict=True)]
    lack, quiet = hits["lacking"], hits["quiet"]
    return Answer(
        scores={
            "right name": share(sum(lack), len(lack)),
            "false alarms": share(len(quiet) - sum(quiet), len(quiet)),
            "sizes within 5 %": share(sum(e < NEAR for e in errors), len(errors)),
            "size, median error": Score(100.0 * float(np.median(errors)) if errors else None, "%"),
        },
        tuned=tuned, notes=notes,
        details={
            "wrong": [
                w["number"] for w, h in lines if h["said"] != sorted([e["family"], e["on"]] for e in w["effects"])
            ]
        },
    )  # fmt: skip


def peer(name: str, title: str, namer: Namer | None, kind: str, needs: tuple[str, ...], tuned: str) -> Peer:
    """One who names."""
    return Peer(name, title, lambda task: play(task, namer, tuned), kind, needs, limit_s=4 * 3600.0)


REMARKS = """
MuJoCo has no word for quadratic drag and for a motor whose gain depends on the sign, which six of the thirty machines
have; mujoco.sysid is right for 11 of the other 24. Its windows begin in the measured state, and most of its false
alarms are gains that are a few per cent off.
"""
GROUNDS = (
    Ground(
        "worlds", "Sixty simulated machines",
        "thirty machines with one to three effects and thirty without defects, drawn with seed 7100; "
        "nothing was tuned on them",
        "right name", ("right name", "false alarms", "sizes within 5 %", "size, median error"),
        (
            peer("gpsim", "gpsim", None, "gpsim", (), "default settings, blind"),
            peer("pysindy", "PySINDy", by_regression(pysindy_select), "parameters", ("pysindy",),
                "is given the missing force and a library with the truth; the threshold is the best of ten by BIC"),
            peer("sysidentpy", "SysIdentPy, FROLS", by_regression(frols_select), "parameters", ("sysidentpy",),
                "is given the same; the number of terms by BIC"),
            peer("mujoco-sysid", "mujoco.sysid", by_sysid, "parameters", ("mujoco", "absl"),
                "is given the machine as MJCF; everything free that MuJoCo has a word for, as many as BIC asks for"),
            peer("pysr", "PySR", by_regression(pysr_select), "parameters", ("pysr",),
                "is given the same; 20 iterations, sums and products of the library's terms"),
        ),
        more_is_better=True, remarks=lambda cells: REMARKS,
    ),
)  # fmt: skip
