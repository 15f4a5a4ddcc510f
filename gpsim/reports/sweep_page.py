"""A sweep as one self-contained page: its main figures over what was swept, and a row a point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from gpsim.reports.canvas import colours, data_uri, panels, style
from gpsim.reports.pages import page_of, resource
from gpsim.reports.sheets import significant

SEED = "seed"
MAIN = (
    "returns_certified.",
    "returns_all.",
    "success_all.",
    "one_step.",
    "explained",
    "verdict",
    "effects",
    "rates.",
)
"""Beginnings of the figures that a page shows of an evaluation, a diagnosis or a fit; of others it shows the first."""
OF_A_RATE = (".log_marginal_likelihood", ".hyper_parameters_original.noise_std")
MOST, MOST_DRAWN = 12, 6  # columns of a table; lines of a picture
MOST_WHOLE = 1e6  # numbers below it are written without a point, if they have no use for one
MOST_ROWS = 2000  # points in the page: the CSV has all


def sweep_page(of: str, swept: Sequence[str], table: pd.DataFrame) -> str:
    """The page; table: a row a point, as stages/full_loop.py makes it. Equal tables give equal pages."""
    shown, over = main_figures(swept, table), _axis(swept, table)
    figure = None if over is None else _picture(over, shown, table)
    numbers = [name for name in shown if _numeric(table, name)]
    return page_of(
        "sweep.html.jinja",
        resource("plain.css") + "img { max-width: 100%; } td { white-space: nowrap; }\n",
        of=of,
        swept=swept,
        points=len(table),
        missing=int(table["error"].notna().sum()),
        over=over,
        picture=None if figure is None else data_uri(figure),
        heads={name: _heading(name) for name in shown},
        number_heads=list(map(_heading, numbers)),
        seeds=_over_seeds(swept, numbers, table),
        records=table.head(MOST_ROWS).fillna({"error": ""}).to_dict("records"),
        most=MOST_ROWS,
        text=_text,
    )


def main_figures(swept: Sequence[str], table: pd.DataFrame) -> list[str]:
    """The columns that a page shows, at most MOST."""

    def repeats(name: str) -> bool:
        """Whether a figure says no more than a setting that is swept, as the rows of a fit do."""
        values = table[name].astype(float) if _numeric(table, name) else None
        keys = [key for key in swept if _numeric(table, key)]
        return values is not None and any(values.equals(table[key].astype(float)) for key in keys)

    found = [name for name in table.columns if name not in (*swept, "sha256", "error")]
    varying = [name for name in found if table[name].notna().any() and not repeats(name)]
    main = [name for name in varying if name.startswith(MAIN) and _is_mean(name)]
    if any(name.startswith("returns_certified.") for name in main):  # over all starts they say it once more
        main = [name for name in main if not name.startswith("returns_all.")]
    return (main or varying)[:MOST]


def _is_mean(name: str) -> bool:
    if name.startswith("rates."):
        return name.endswith(OF_A_RATE)
    if name.startswith("one_step."):
        return name.endswith((".mean.nrmse", ".before", ".after"))
    return "." not in name or name.endswith((".mean", ".rate"))


def _numeric(table: pd.DataFrame, name: str) -> bool:
    return bool(pd.api.types.is_numeric_dtype(table[name]) and not pd.api.types.is_bool_dtype(table[name]))


def _axis(swept: Sequence[str], table: pd.DataFrame) -> str | None:
    """The setting to draw over: the first number that is swept, the seed only where it is alone."""
    numbers = [name for name in swept if _numeric(table, name)]
    return next((name for name in numbers if name != SEED), numbers[0] if numbers else None)


def _picture(over: str, shown: Sequence[str], table: pd.DataFrame) -> Figure | None:
    """A point a row and a line through the medians, a colour a figure, a panel for each kind of them."""
    numbers = [name for name in shown if _numeric(table, name)]
    kinds = list(dict.fromkeys(_kind(name)[0] for name in numbers))
    if not kinds:
        return None
    with style():
        figure, axes = panels(1, len(kinds), (4.6 * len(kinds), 3.6))
        for axis, kind in zip(axes[0], kinds, strict=True):
            lines = [name for name in numbers if _kind(name)[0] == kind][:MOST_DRAWN]
            tints = colours(_kind(name)[1] for name in lines)
            for name in lines:
                rows = table[[over, name]].dropna().sort_values(over)
                line = _kind(name)[1]
                axis.plot(rows[over], rows[name], ".", color=tints[line], alpha=0.5)
                middle = rows.groupby(over)[name].median()
                axis.plot(middle.index, middle.to_numpy(), color=tints[line], label=line)
            axis.set_xlabel(over)
            axis.set_title(kind.replace("_", " "))
            if len(lines) > 1:
                axis.legend(fontsize=8)
    return figure


def _kind(name: str) -> tuple[str, str]:
    """(panel, line) of a figure: of returns the policies in one, of a fit each figure's rates in one."""
    first, *rest = name.split(".")
    if first == "rates":
        return rest[-1], rest[0]
    return first, ".".join(rest).removesuffix(".mean")


def _heading(name: str) -> str:
    kind, line = _kind(name)
    return f"{kind.replace('_', ' ')} {line}".strip()


def _over_seeds(swept: Sequence[str], numbers: Sequence[str], table: pd.DataFrame) -> list[list[str]]:
    """Mean and spread over the seeds of each other combination; no rows where no seeds are swept."""
    others = [name for name in swept if name != SEED]
    rows = []
    for key, group in table.groupby(others, sort=False, dropna=False) if others else [((), table)]:
        count = str(int(group["error"].isna().sum()))
        rows.append([*map(str, key), count, *(_spread(group[name].dropna()) for name in numbers)])
    return rows if SEED in swept and numbers else []


def _spread(values: Any) -> str:
    """Mean and standard deviation; the value alone where all are the same."""
    if len(values) == 0 or values.nunique() == 1:
        return _text(values.iloc[0] if len(values) else None)
    return f"{significant(float(values.mean()))} ± {significant(float(values.std()))}"


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    whole = value is not None and float(value).is_integer() and abs(value) < MOST_WHOLE
    return f"{value:.0f}" if whole else significant(value)
