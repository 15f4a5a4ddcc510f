"""Templates of pages and of sentences, and what keeps a page to itself: every text of a page is escaped."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from functools import cache, partial
from importlib import resources
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from gpsim.reports import quantities, sheets
from gpsim.reports.quantities import LABEL, shortened

if TYPE_CHECKING:
    from jinja2 import Environment

LONGEST_CELL = 48  # letters of a name in a table: its title holds all of them


def page_of(template: str, style: str, **content: Any) -> str:
    """The page that a template file makes of its content; `head` in it is the charset, the policy and the style.

    style: the one style sheet. Scripts, frames, forms and everything from elsewhere stay out, whatever a name holds: a
    page may show pictures that it holds, in this style, and nothing else.
    """
    if "<" in style or "\r" in style:
        raise ValueError("a style sheet that ends its own element, or whose hash a browser would not find")
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode("ascii")
    policy = (
        f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'; base-uri 'none'; form-action 'none'"
    )
    head = Markup(
        '<meta charset="utf-8">\n<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta http-equiv="Content-Security-Policy" content="{}">\n<style>{}</style>'
    ).format(policy, Markup(style))
    return fragment_of(template, head=head, **content)


def fragment_of(template: str, **content: Any) -> str:
    """What a template file makes of its content, for a page that somebody else makes."""
    return environment().get_template(template).render(**content)


def text_of(template: str, **content: Any) -> str:
    """What a template file makes of its content, for a terminal."""
    return environment(escapes=False).get_template(template).render(**content)


def resource(name: str) -> str:
    """The text of a template or a style sheet."""
    return resources.files("gpsim.reports").joinpath("templates", name).read_text(encoding="utf-8")


@cache
def environment(escapes: bool = True) -> Environment:
    """Templates of pages; those of sentences, which are no HTML, do not escape."""
    from jinja2 import (  # here: who tells nothing need not wait for it
        Environment,
        FunctionLoader,
        StrictUndefined,
    )

    made = Environment(
        loader=FunctionLoader(resource), autoescape=escapes, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    # Numbers as a person would say them, by their own names.
    said = ("brief", "in_percent", "number", "odds_text", "share_text", "size_text")
    made.globals |= {name: getattr(quantities, name) for name in said}
    made.globals |= {
        name: getattr(sheets, name) for name in ("known", "significant", "whole_percent", "with_unit")
    }
    made.filters |= {
        "spelled": quantities.spelled,
        "listed": quantities.listed,
        "percent": quantities.percent,
        "share": quantities.share_text,
        "shortened": quantities.shortened,
        "short": _short,
        "title_of": _title,
        "titles_of": partial(_titled, most=LABEL),
        "pretty": partial(json.dumps, indent=1, default=str),
    }
    return made


def _short(text: str, most: int = LONGEST_CELL) -> str:
    return shortened(text, most)


def _title(text: str, most: int = LONGEST_CELL) -> str:
    return _titled([text], most)


def _titled(names: Sequence[str], most: int) -> str:
    """A title attribute with the whole of those names that are not shown whole."""
    long = [name for name in names if len(name) > most]
    return Markup(' title="{}"').format(", ".join(long)) if long else ""
