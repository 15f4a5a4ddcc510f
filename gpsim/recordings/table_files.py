"""Tables that are recordings: read whole, their columns' names and their values' size looked at."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
import pyarrow.parquet as pq

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.names import LONGEST_LINE, check_columns, one_line
from gpsim.recordings.parquet import PARQUET, check_parquet, check_width, is_plain, is_text
from gpsim.recordings.values import LARGEST


def read_frame(path: Path, precision: Literal["round_trip"] | None = None) -> pd.DataFrame:
    """A CSV or Parquet table; UsageError where it cannot be read or two columns have one name.

    Episodes are called letter by letter what the table says: NA and 007 are names, too. precision: pandas'
    float_precision, for CSV.
    """
    if path.exists() and not path.is_file():
        raise UsageError(f"{path}: is no ordinary file; name a CSV or Parquet table")
    try:
        names = _parquet_names(path) if path.suffix == ".parquet" else _csv_names(path)
        check_columns(names, str(path))
        if path.suffix == ".parquet":
            return _parquet(path)
        frame = pd.read_csv(path, dtype={"episode": str}, float_precision=precision)
        if "episode" in frame.columns and frame["episode"].isna().any():
            said = pd.read_csv(path, usecols=["episode"], dtype=str, keep_default_na=False)["episode"]
            frame["episode"] = said.where(said != "")
        return frame
    except UsageError:
        raise
    except Exception as error:  # pandas and pyarrow raise a dozen kinds on a damaged file
        raise UsageError(f"{path}: cannot be read: {one_line(error, 160)}") from error


def _parquet_names(path: Path) -> list[str]:
    with pq.ParquetFile(path, **PARQUET) as file:
        check_parquet(path, file.metadata)
        return [str(name) for name in file.schema_arrow.names]


def _parquet(path: Path) -> pd.DataFrame:
    """A file's columns of numbers, times and text; a text that is there many times is held once."""
    with pq.ParquetFile(path, **PARQUET) as file:
        fields = [field for field in file.schema_arrow if is_plain(field.type)]
    texts = [field.name for field in fields if is_text(field.type)]
    frame = pd.read_parquet(path, columns=[field.name for field in fields], read_dictionary=texts)
    for name in texts:
        frame[name] = frame[name].astype("category").astype(object)
    return frame


def _csv_names(path: Path) -> list[str]:
    with path.open("rb") as file:
        if len(file.readline(LONGEST_LINE + 1)) > LONGEST_LINE:
            raise UsageError(
                f"{path}: its first line is longer than {LONGEST_LINE} bytes; write a table with line breaks"
            )
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        first = next((row for row in csv.reader(file) if row), [])
    check_width(path, len(first))
    return [name.strip() or f"column_{number}" for number, name in enumerate(first)]


def check_size(values: FloatArray, names: Sequence[str], where: str, rows: Sequence[int]) -> None:
    """Refuse finite values (N, C) that no measurement can be; rows: (N,) what the rows are called."""
    with np.errstate(invalid="ignore"):
        bad = np.argwhere(np.abs(values) > LARGEST)
    if len(bad):
        row, column = (int(i) for i in bad[0])
        raise UsageError(
            f"{where}, row {rows[row]}, column {names[column]}: {values[row, column]:g} is no measurement, none is "
            f"larger than {LARGEST:g} ({len(bad)} such value(s)); drop or repair the rows"
        )
