"""What a page is made of, as a browser reads it."""

from __future__ import annotations

import base64
import hashlib
from html.parser import HTMLParser


class Page(HTMLParser):
    """Elements with their attributes, the style sheets and the text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.styles: list[str] = []
        self.text = ""
        self._inside = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self._inside = tag
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_data(self, data):
        if self._inside == "style":
            self.styles.append(data)
        else:
            self.text += data

    def handle_endtag(self, tag):
        self._inside = ""

    @property
    def tags(self) -> set[str]:
        return {tag for tag, _ in self.elements}

    @property
    def attributes(self) -> set[str]:
        return {name for _, attributes in self.elements for name in attributes}

    @property
    def policies(self) -> list[str]:
        return [
            a["content"] for _, a in self.elements if a.get("http-equiv", "") == "Content-Security-Policy"
        ]


def check_policy(text: str) -> Page:
    """The page lets nothing in but its own pictures and its one style sheet, and needs no more."""
    page = Page(text)
    (policy,), (style,) = page.policies, page.styles
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules == {
        "default-src": "'none'",
        "img-src": "data:",
        "style-src": f"'sha256-{digest}'",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    order = [tag for tag, _ in page.elements]
    assert order.index("meta") < order.index("style") < order.index("title")
    assert not page.tags & {"script", "link", "iframe", "object", "embed", "form", "base", "svg"}
    assert "style" not in page.attributes
    assert not any(name.startswith("on") for name in page.attributes)
    assert all(a["src"].startswith("data:image/") for tag, a in page.elements if tag == "img")
    return page


def check_fragment(text: str) -> Page:
    """A piece of a page needs nothing from elsewhere, runs nothing, and its style is of itself alone."""
    page = Page(text)
    (style,) = page.styles
    rules = [line for line in style.splitlines() if line.strip()]
    assert all(line.startswith(".gpsim-") for line in rules)
    assert not page.tags & {
        "html",
        "head",
        "body",
        "script",
        "link",
        "iframe",
        "object",
        "embed",
        "form",
        "base",
    }
    assert "style" not in page.attributes
    assert not any(name.startswith("on") for name in page.attributes)
    assert all(a["src"].startswith("data:image/") for tag, a in page.elements if tag == "img")
    return page
