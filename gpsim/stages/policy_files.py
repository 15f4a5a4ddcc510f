"""Policies, learning curves and Gaussian processes on disk: safetensors, JSON and CSV; no pickle."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gpsim.artifacts import Artifact, read_artifact
from gpsim.channels import Channels
from gpsim.corrected import CommandFilter, Feature, Features, FunctionCorrection, GpCorrection, Prediction
from gpsim.errors import UsageError
from gpsim.files import plain, read_object, write_json

if TYPE_CHECKING:
    from gpsim.corrected import Drawable, PosteriorPlant
    from gpsim.gp import Predictor
    from gpsim.policies import Policy
    from gpsim.policies.training.settings import Checkpoints, LearningCurve

SURVIVES, PAGE = "survives.json", "survives.md"


def write_survives(folder: Path, drawn: PosteriorPlant) -> None:
    """survives.json and survives.md: the explanations that episodes were drawn from, and their sizes' intervals."""
    total = sum(explanation.probability for explanation in drawn.explanations)
    content = {
        "drawn": "every episode",
        "explanations": [_facts(explanation, total) for explanation in drawn.explanations],
    }
    write_json(folder / SURVIVES, plain(content))
    lines = ["# What this policy was trained for", "", *survival_lines(folder), ""]
    lines += [
        "Each training episode drew one of these explanations, and its sizes with their correlations.",
        "Nothing outside these ranges was tested. The policy may fail on a machine outside them.",
        "",
    ]
    (folder / PAGE).write_text("\n".join(lines), encoding="utf-8")


def survival_lines(folder: Path) -> list[str]:
    """A line an explanation; none of a policy that was trained in one simulator."""
    if not (folder / SURVIVES).is_file():
        return []
    lines = []
    for entry in read_object(folder / SURVIVES)["explanations"]:
        sizes = [f"{s['name']} of {s['of']} {s['low']:.4g} to {s['high']:.4g}" for s in entry["sizes"]]
        said = "; ".join(sizes) or ", ".join(entry["effects"]) or "the base simulator as it is"
        rest = "; a function of the Gaussian process on the rest" if entry["function_of_the_rest"] else ""
        interval = f" ({100 * entry['level']:g} % intervals)" if sizes else ""
        share = f"{100 * entry['share_of_episodes']:.0f} %"
        lines.append(f"survives, in {share} of its episodes: {said}{rest}{interval}")
    return lines


def _facts(explanation: Drawable, total: float) -> dict[str, Any]:
    effects, sizes = (
        [f"{term.family} on {term.on}" for term in explanation.plant.terms],
        explanation.spread.sizes,
    )
    return {
        "share_of_episodes": explanation.probability / total,
        "effects": effects,
        "level": explanation.spread.level,
        "sizes": [{"of": effects[s.term], "name": s.name, "low": s.low, "high": s.high} for s in sizes],
        "function_of_the_rest": isinstance(explanation.plant.correction, FunctionCorrection),
    }


def write_policy(folder: Path, policy: Policy) -> None:
    """policy.safetensors and policy.json."""
    _write(folder, "policy", *policy.to_arrays())


def policy_artifact(folder: Path) -> Artifact:
    """A finished policy; raises UsageError for another artifact."""
    artifact = read_artifact(folder)
    if artifact.stage not in ("train-source", "train-gp-policy"):
        raise UsageError(
            f"{folder}: made by '{artifact.stage}', expected a policy of train-source or train-gp-policy"
        )
    return artifact


def read_policy(folder: Path) -> Policy:
    """The inverse of `write_policy`."""
    from gpsim.policies import Policy  # here, as what else not every file needs: it takes a while to load

    arrays, metadata = _read(folder, "policy")
    with _readable(folder, "policy"):
        return Policy.from_arrays(arrays, metadata)


def write_gp(
    folder: Path,
    predictor: Predictor,
    features: Features,
    command_filter: CommandFilter | None = None,
    *,
    wraps: tuple[bool, ...] = (),
) -> None:
    """gp.safetensors and gp.json, with the inputs and the filter before them, if there is one.

    `inputs` says for people what `features` says for programs: a channel may be called as a function of another one is
    written. wraps: input by input, whether its angle was taken between -pi and pi; written where one was.
    """
    from gpsim.gp import to_arrays

    arrays, metadata = to_arrays(predictor)
    written = [item.to_json() for item in features.items]
    metadata = {**metadata, "inputs": list(features.names), "features": written}
    if any(wraps):
        metadata["wraps"] = list(wraps)
    if command_filter is not None:
        metadata["filter"] = command_filter.to_json()
    _write(folder, "gp", arrays, metadata)


def read_gp(folder: Path, channels: Channels) -> tuple[Predictor, Features]:
    """The inverse of `write_gp` for a simulator with these channels of state and action."""
    from gpsim.gp import from_arrays

    arrays, metadata = _read(folder, "gp")
    with _readable(folder, "Gaussian process"):
        predictor, inputs = from_arrays(arrays, metadata), metadata["inputs"]
    if "features" in metadata:  # earlier versions wrote texts alone
        inputs = [Feature.from_json(item) for item in metadata["features"]]
    return predictor, Features.of(inputs, channels)


def read_filter(folder: Path) -> CommandFilter | None:
    """The filter before the Gaussian processes in `folder`, if there is one."""
    _, metadata = _read(folder, "gp")
    return CommandFilter.from_json(metadata["filter"]) if "filter" in metadata else None


def read_gp_correction(
    folder: Path, channels: Channels, prediction: Prediction, sample_noise: bool
) -> GpCorrection:
    """The correction that the Gaussian processes of `fit-gp` in `folder` make to a simulator with these channels.

    An angle wraps where it did in the fit: what the recording says of it counts, not the simulator.
    """
    predictor, features = read_gp(folder, channels)
    _, metadata = _read(folder, "gp")
    wraps = tuple(bool(flag) for flag in metadata.get("wraps", [False] * len(features.items)))
    return GpCorrection(predictor, dataclasses.replace(features, wraps=wraps), prediction, sample_noise)


@contextmanager
def _readable(folder: Path, what: str) -> Iterator[None]:
    """Within it what the files do not hold, or hold otherwise, is one line."""
    try:
        yield
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        said = f"{type(error).__name__}: {error}"
        raise UsageError(f"{folder}: not a {what} that this version can read: {said}") from error


def write_curve(folder: Path, curve: LearningCurve) -> None:
    """learning_curve.csv."""
    rows = {"steps": curve.steps, "mean_return": curve.mean_return, "episodes": curve.episodes}
    _write_table(folder / "learning_curve.csv", rows)


def write_checkpoints(folder: Path, checkpoints: Checkpoints) -> None:
    """checkpoints.csv."""
    _write_table(folder / "checkpoints.csv", dataclasses.asdict(checkpoints))


def _write_table(path: Path, columns: Mapping[str, Any]) -> None:
    import pandas as pd

    pd.DataFrame(columns).to_csv(path, index=False, lineterminator="\n")


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """A safetensors file, through Python's own writer: a full disk is then an OSError like any other."""
    from safetensors.numpy import save

    path.write_bytes(save({key: np.ascontiguousarray(array) for key, array in arrays.items()}))


def _write(folder: Path, name: str, arrays: Mapping[str, NDArray[Any]], metadata: Mapping[str, Any]) -> None:
    write_arrays(folder / f"{name}.safetensors", arrays)
    write_json(folder / f"{name}.json", metadata)


def _read(folder: Path, name: str) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    from safetensors import SafetensorError
    from safetensors.numpy import load_file

    try:
        arrays = load_file(folder / f"{name}.safetensors")
    except (OSError, SafetensorError) as error:
        raise UsageError(f"{folder}: no readable {name}.safetensors and {name}.json ({error})") from error
    return arrays, read_object(folder / f"{name}.json")
