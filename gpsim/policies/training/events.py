"""Event files of a training, for TensorBoard: a logger of stable-baselines3 that writes them, or keeps nothing.

What a training makes does not depend on it: numbers go out, none comes back.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat

FIGURES = "training"  # what gpsim itself says; stable-baselines3 adds `train/` and `time/`


@contextmanager
def event_log(folder: Path | None) -> Iterator[Logger]:
    """A logger into a folder, closed at the end; without one, of nothing: the library's own leaves a folder behind."""
    logger = Logger(None, [TensorBoardOutputFormat(str(folder))] if folder is not None else [])
    try:
        yield logger
    finally:
        logger.close()


def note(log: Logger | None, **figures: float) -> None:
    """Write figures down for the next dump; what is not finite, as the mean return of no episode, is left out."""
    for name, value in figures.items():
        if log is not None and math.isfinite(value):
            log.record(f"{FIGURES}/{name}", value)
