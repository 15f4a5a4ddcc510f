"""An empty picture in place of a figure."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import IO, Any

_PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGP4DwABAQEAsTj2FAAAAABJRU5ErkJggg=="
)
_SVG = b'<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg"/>'


def blank(figure: object, to: IO[bytes] | Path, format: str = "png", **_: Any) -> None:
    """As `Figure.savefig`, of one white pixel."""
    content = _SVG if format == "svg" else _PNG
    if isinstance(to, Path):
        to.write_bytes(content)
    else:
        to.write(content)
