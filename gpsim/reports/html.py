"""What all pages share: every text is escaped, names stay short, and a policy lets nothing in but the page's own."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from importlib import resources
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from gpsim.reports.canvas import LABEL
from gpsim.reports.quantities import shortened

LONGEST = 48  # letters of a name in a table: its title holds all of them


def page_of(template: str, style: str, **content: Any) -> str:
    """The page that a template file makes of its content; `head` in it is the charset, the policy and the style.

    style: the one style sheet. Scripts, frames, forms and everything from elsewhere stay out, whatever a name holds.
    """
    return fragment_of(template, head=_head(style), **content)


def fragment_of(template: str, **content: Any) -> str:
    """What a template file makes of its content, for a page that somebody else makes."""
    environment = Environment(
        loader=FunctionLoader(resource),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "short": _short,
        "title_of": _title_of,
        "titles_of": _titles_of,
        "pretty": _pretty,
    }
    return environment.get_template(template).render(**content)


def resource(name: str) -> str:
    """The text of a template or a style sheet."""
    return resources.files("gpsim.reports").joinpath("templates", name).read_text(encoding="utf-8")


def security_policy(style: str) -> str:
    """A Content-Security-Policy under which a page may show pictures that it holds, in this style, and nothing else."""
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode("ascii")
    return (
        f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'; base-uri 'none'; form-action 'none'"
    )


def _head(style: str) -> Markup:
    if "<" in style or "\r" in style:
        raise ValueError("a style sheet that ends its own element, or whose hash a browser would not find")
    policy = Markup('<meta http-equiv="Content-Security-Policy" content="{}">').format(security_policy(style))
    return Markup('<meta charset="utf-8">\n{}\n<style>{}</style>').format(policy, Markup(style))


def _short(text: str, most: int = LONGEST) -> str:
    return shortened(text, most)


def _pretty(tree: Any) -> str:
    return json.dumps(tree, indent=1, default=str)


def _titles_of(names: Sequence[str], most: int = LABEL) -> str:
    """A title attribute with the whole of those names that a figure does not show whole."""
    long = [name for name in names if len(name) > most]
    return Markup(' title="{}"').format(", ".join(long)) if long else ""


def _title_of(text: str, most: int = LONGEST) -> str:
    """A title attribute with the whole text, where it is not shown whole."""
    return Markup(' title="{}"').format(text) if len(text) > most else ""
