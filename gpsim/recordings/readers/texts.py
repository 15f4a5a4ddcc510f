"""Columns of text as numbers: which rows say the same is all that an import asks of them."""

from __future__ import annotations

import numpy as np
import pandas as pd

from gpsim.channels import BoolArray, FloatArray


class Codes:
    """Texts as 0, 1, 2 ... in the order in which they first appear, over all the pieces of a column."""

    def __init__(self) -> None:
        self.known: dict[str, int] = {}

    def of(self, column: pd.Series) -> tuple[FloatArray, BoolArray, BoolArray]:
        """(codes (N,), NaN where empty; empty cells; cells that cannot be read: none)."""
        empty = column.isna().to_numpy(dtype=np.bool_)
        held = column[~empty].astype("category").cat  # a word is looked at once, however often it is there
        order = held.codes.drop_duplicates().tolist()
        code = np.full(len(held.categories), np.nan)
        for at in order:
            word = str(held.categories[at]).strip()
            code[at] = self.known.setdefault(word, len(self.known))
        codes = np.full(len(column), np.nan)
        codes[~empty] = code[held.codes.to_numpy()]
        return codes, empty, np.zeros(len(column), dtype=np.bool_)
