"""How much a file from elsewhere may make of itself: every limit in one place, all raised by GPSIM_LIMITS.

A small file can stand for gigabytes, or for hours of work. What a sound file makes stays far below these numbers; what
makes more is refused with one line. docs/method/limits.md has the table.
"""

from __future__ import annotations

import math
import os

from gpsim.errors import UsageError

VARIABLE = "GPSIM_LIMITS"

# Bytes that the compressed chunks of a bag make, beside so many times the file's own size.
CHUNKS_BYTES, CHUNKS_GROWTH = 256 << 20, 100
# Messages and other records of a bag, beside one for so many bytes of the file.
MESSAGES, BYTES_A_MESSAGE = 1_000_000, 8
# Chunks and records of a bag in which there is nothing.
EMPTY = 10_000
# Topics of a bag.
TOPICS = 2_000
# Bytes that the columns of a table make, beside so many times the file's own size; and how many columns.
TABLE_BYTES, TABLE_GROWTH = 256 << 20, 50
TABLE_COLUMNS = 10_000
# Bytes that the variables of a MATLAB file make.
MATLAB_BYTES = 256 << 20
# A model: bytes of its XML with all that it includes, elements with all that <replicate> makes, numbers that it asks
# room for, bytes of its meshes and pictures, and what the compiled model has.
MODEL_BYTES = 32 << 20
MODEL_ELEMENTS = 10_000
MODEL_NUMBERS = 1 << 24
MODEL_ASSETS = 512 << 20
MODEL_BODIES = 2_000
MODEL_JOINTS = 200


def factor() -> float:
    """What all limits are multiplied by: the environment variable GPSIM_LIMITS, 1 where it is not set."""
    said = os.environ.get(VARIABLE, "").strip()
    try:
        found = float(said or 1.0)
    except ValueError:
        found = math.nan
    if not 1.0 <= found <= 1e6:
        raise UsageError(f"{VARIABLE}={said[:40]!r}: give a number from 1 to 1e6, or leave it unset")
    return found


def allowed(limit: float) -> int:
    """A limit with what the user grants beside it."""
    return int(limit * factor())


def more(found: float | None = None, limit: float | None = None) -> str:
    """What to do where a sound file is beyond a limit. found, limit: how far it is beyond it, where that is known."""
    needed = 4.0 if found is None or not limit else max(2.0, math.ceil(found / limit))
    said = max(needed, 2 * factor()) if found is None else needed
    return f"if it is valid, allow more: {VARIABLE}={said:g}"
