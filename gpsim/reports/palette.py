"""One colour per policy, simulator and rate, the same in every figure and table; colour-blind safe (Okabe and Ito)."""

from __future__ import annotations

from collections.abc import Iterable

POLICIES = {
    "Source": "#D55E00",
    "Domain randomisation": "#E69F00",
    "GP-Mean": "#56B4E9",
    "GP-Sample": "#0072B2",
    "Target": "#333333",
}
"""Policies, and the simulators of the same names."""

OTHERS = ("#009E73", "#CC79A7", "#882255", "#999933", "#44AA99", "#AA4499", "#6D4C41")
"""For names that are not in POLICIES, in order of appearance; used again from the start when there are more."""

RATES = ("#009E73", "#AA4499", "#999933", "#44AA99", "#6D4C41")
"""Apart from the policies' colours, so that a rate is not mistaken for a policy."""

SEGMENTS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#882255", "#999933")
"""Parts of one bar that stand side by side, the largest first."""

SLIGHT = "#B8BEC7"  # of such a bar: what is small and no claim

INK, FAINT, GRID, BAND, GP = "#1B1F24", "#6B7280", "#E5E7EB", "#9CC9E8", "#0072B2"


def colours(names: Iterable[str]) -> dict[str, str]:
    """A colour for every name; names that are not known take the rest of the palette in order of appearance."""
    found: dict[str, str] = {}
    others = 0
    for name in names:
        if name in found:
            continue
        if name in POLICIES:
            found[name] = POLICIES[name]
        else:
            found[name] = OTHERS[others % len(OTHERS)]
            others += 1
    return found
