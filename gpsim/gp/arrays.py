"""A predictor as plain data: named float64 arrays and JSON-able metadata, for whoever writes files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .chained import ChainedPredictor
from .exact import PosteriorTerms
from .kernels import FloatArray, HyperParameters, read_only
from .predictor import Output, Predictor
from .training_data import Standardisation

SCHEMA, CHAIN = "gpsim.gp/1", "gpsim.gp-chain/1"

_PARTS = ("hyper_parameters", "input_mean", "input_scale", "target", "support", "weights", "root")


def to_arrays(predictor: Predictor) -> tuple[dict[str, FloatArray], dict[str, Any]]:
    """All that the predictor is: `from_arrays` then predicts the same bits on the same machine.

    Arrays per output r: `r/hyper_parameters` (2 D + 3,) standardised, `r/input_mean` (D,), `r/input_scale`
    (D,), `r/target` (2,) mean and scale, `r/support` (M, D), `r/weights` (M,), `r/root` (M, P). The root is
    what makes the file large (8 M P bytes, P at most M).
    """
    if isinstance(predictor, ChainedPredictor):
        return _chain_to_arrays(predictor)
    arrays: dict[str, FloatArray] = {}
    for index, output in enumerate(predictor.outputs):
        scaling, terms = output.standardisation, output.terms
        values = (
            output.hyper_parameters.to_vector(),
            scaling.input_mean,
            scaling.input_scale,
            np.array([scaling.target_mean, scaling.target_scale]),
            terms.support,
            terms.weights,
            terms.root,
        )
        arrays.update({f"{index}/{part}": value.copy() for part, value in zip(_PARTS, values, strict=True)})
    metadata: dict[str, Any] = {
        "schema": SCHEMA,
        "dimension": predictor.dimension,
        "outputs": len(predictor.outputs),
        "support_rows": [output.terms.weights.size for output in predictor.outputs],
        "noise_variances": predictor.noise_variances.tolist(),
    }
    return arrays, metadata


def from_arrays(arrays: Mapping[str, FloatArray], metadata: Mapping[str, Any]) -> Predictor:
    """Inverse of `to_arrays`; ValueError for another schema, a missing array, a wrong dtype or shape."""
    if metadata.get("schema") == CHAIN:
        return _chain_from_arrays(arrays, metadata)
    if metadata.get("schema") != SCHEMA:
        raise ValueError(f"expected GP arrays of schema {SCHEMA!r}, got {metadata.get('schema')!r}")
    count, dimension = int(metadata["outputs"]), int(metadata["dimension"])
    missing = [f"{r}/{part}" for r in range(count) for part in _PARTS if f"{r}/{part}" not in arrays]
    if missing:
        raise ValueError(f"GP arrays are missing: {', '.join(missing)}")
    return Predictor([_output(arrays, r, dimension) for r in range(count)])


def _chain_to_arrays(predictor: ChainedPredictor) -> tuple[dict[str, FloatArray], dict[str, Any]]:
    """The arrays of part p are `p:NAME`."""
    found = [to_arrays(part) for part in predictor.parts]
    arrays = {f"{p}:{name}": array for p, (of_part, _) in enumerate(found) for name, array in of_part.items()}
    return arrays, {
        "schema": CHAIN,
        "dimension": predictor.dimension,
        "parts": [metadata for _, metadata in found],
        "noise_variances": predictor.noise_variances.tolist(),
    }


def _chain_from_arrays(arrays: Mapping[str, FloatArray], metadata: Mapping[str, Any]) -> ChainedPredictor:
    parts = []
    for p, of_part in enumerate(metadata["parts"]):
        own = {name.partition(":")[2]: a for name, a in arrays.items() if name.startswith(f"{p}:")}
        parts.append(from_arrays(own, of_part))
    if not parts:
        raise ValueError("a chain of Gaussian processes needs parts")
    return ChainedPredictor(parts)


def _output(arrays: Mapping[str, FloatArray], index: int, dimension: int) -> Output:
    parts = {part: arrays[f"{index}/{part}"] for part in _PARTS}
    rows = parts["weights"].size
    shapes = {
        "hyper_parameters": (2 * dimension + 3,),
        "input_mean": (dimension,),
        "input_scale": (dimension,),
        "target": (2,),
        "support": (rows, dimension),
        "weights": (rows,),
        "root": (rows, parts["root"].shape[-1]),
    }
    for part, shape in shapes.items():
        if parts[part].shape != shape or parts[part].dtype != np.float64:
            raise ValueError(
                f"GP array {index}/{part} must be float64 of shape {shape}, "
                f"got {parts[part].dtype} of shape {parts[part].shape}"
            )
    mean, scale = parts["target"].tolist()
    return Output(
        Standardisation(read_only(parts["input_mean"]), read_only(parts["input_scale"]), mean, scale),
        HyperParameters.from_vector(parts["hyper_parameters"]),
        PosteriorTerms(read_only(parts["support"]), read_only(parts["weights"]), read_only(parts["root"])),
    )
