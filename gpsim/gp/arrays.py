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
_SHAPES = {
    "hyper_parameters": "H", "input_mean": "D", "input_scale": "D", "target": "2", "support": "MD", "weights": "M",
    "root": "MP",
}  # fmt: skip
"""The arrays of an output: H = 2 D + 3 hyper-parameters, standardised; target: mean and scale; M rows, P columns."""


def to_arrays(predictor: Predictor) -> tuple[dict[str, FloatArray], dict[str, Any]]:
    """All that the predictor is: `from_arrays` then predicts the same bits on the same machine.

    The arrays of output r are `r/NAME`, NAME and shape as in _SHAPES; those of part p of a chain `p:r/NAME`. The root
    is what makes the file large (8 M P bytes, P at most M).
    """
    if isinstance(predictor, ChainedPredictor):
        found = [to_arrays(part) for part in predictor.parts]
        arrays = {f"{p}:{name}": array for p, (own, _) in enumerate(found) for name, array in own.items()}
        content: dict[str, Any] = {"parts": [metadata for _, metadata in found]}
    else:
        outputs = predictor.outputs
        arrays = {f"{r}/{name}": a.copy() for r, o in enumerate(outputs) for name, a in _parts(o).items()}
        content = {"outputs": len(outputs), "support_rows": [o.terms.weights.size for o in outputs]}
    schema = CHAIN if "parts" in content else SCHEMA
    noise = predictor.noise_variances.tolist()
    return arrays, {"schema": schema, "dimension": predictor.dimension, **content, "noise_variances": noise}


def from_arrays(arrays: Mapping[str, FloatArray], metadata: Mapping[str, Any]) -> Predictor:
    """Inverse of `to_arrays`; ValueError for another schema, a missing array, a wrong dtype or shape."""
    if metadata.get("schema") == CHAIN:
        parts = []
        for p, of_part in enumerate(metadata["parts"]):
            own = {name.partition(":")[2]: a for name, a in arrays.items() if name.startswith(f"{p}:")}
            parts.append(from_arrays(own, of_part))
        if not parts:
            raise ValueError("a chain of Gaussian processes needs parts")
        return ChainedPredictor(parts)
    if metadata.get("schema") != SCHEMA:
        raise ValueError(f"expected GP arrays of schema {SCHEMA!r}, got {metadata.get('schema')!r}")
    count, dimension = int(metadata["outputs"]), int(metadata["dimension"])
    missing = [f"{r}/{part}" for r in range(count) for part in _SHAPES if f"{r}/{part}" not in arrays]
    if missing:
        raise ValueError(f"GP arrays are missing: {', '.join(missing)}")
    return Predictor([_output(arrays, r, dimension) for r in range(count)])


def _parts(output: Output) -> dict[str, FloatArray]:
    """In the order of _SHAPES."""
    own, terms = output.standardisation, output.terms
    target = np.array([own.target_mean, own.target_scale])
    first = (output.hyper_parameters.to_vector(), own.input_mean, own.input_scale, target)
    return dict(zip(_SHAPES, (*first, terms.support, terms.weights, terms.root), strict=True))


def _output(arrays: Mapping[str, FloatArray], index: int, dimension: int) -> Output:
    parts = {part: arrays[f"{index}/{part}"] for part in _SHAPES}
    rows, columns = parts["weights"].size, parts["root"].shape[-1]
    sizes = {"D": dimension, "H": 2 * dimension + 3, "2": 2, "M": rows, "P": columns}
    for part, letters in _SHAPES.items():
        shape, got = tuple(sizes[letter] for letter in letters), parts[part]
        if got.shape != shape or got.dtype != np.float64:
            raise ValueError(
                f"GP array {index}/{part} must be float64 of shape {shape}, got {got.dtype} of shape {got.shape}"
            )
    mean, scale = parts["target"].tolist()
    return Output(
        Standardisation(read_only(parts["input_mean"]), read_only(parts["input_scale"]), mean, scale),
        HyperParameters.from_vector(parts["hyper_parameters"]),
        PosteriorTerms(read_only(parts["support"]), read_only(parts["weights"]), read_only(parts["root"])),
    )
