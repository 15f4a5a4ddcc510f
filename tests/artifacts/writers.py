"""A recipe and a writer that the tests of artifacts share."""

from pathlib import Path

from gpsim.artifacts import Recipe


def write(folder: Path):
    (folder / "a.txt").write_text("alpha")
    (folder / "deep").mkdir()
    (folder / "deep" / "b.bin").write_bytes(bytes(range(256)))
    return {"note": "fast"}


def recipe(**config):
    return Recipe("fit-gp", config, {}, {"seed": 0})
