"""An account for a notebook: a piece of a page, in which other pieces stand too."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources

from markupsafe import Markup

from gpsim.reports.account import Account
from gpsim.reports.diagnosis_figures import Picture
from gpsim.reports.html import fragment_of

STYLE = """
.gpsim-account { max-width: 62rem; }
.gpsim-account .gpsim-verdict { font-size: 1.1em; border-left: 6px solid #6b7280; padding: .3em .8em; }
.gpsim-account th, .gpsim-account td { text-align: left; vertical-align: top; padding: .1em .9em .1em 0; }
.gpsim-account p { margin: 0 0 .15em; }
.gpsim-account img { max-width: 30rem; width: 49%; }
"""
"""Of this piece alone: what stands around it keeps its own."""


def account_fragment(account: Account, pictures: Sequence[Picture] = ()) -> str:
    """HTML without scripts and without anything from elsewhere; every text is escaped."""
    return fragment_of(
        resources.files("gpsim.reports").joinpath("account.html.jinja").read_text(encoding="utf-8"),
        style=Markup(STYLE),
        account=account,
        sentence=account.sentence[:1].upper() + account.sentence[1:],
        pictures=pictures,
    )
