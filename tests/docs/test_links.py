"""Every link of every page leads somewhere: to a file of the checkout, and to a heading or an anchor in it."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    ROOT / "data" / "README.md",
    ROOT / "benchmarks" / "proofs.md",
    *sorted(ROOT.glob("docs/**/*.md")),
]
FENCE = re.compile(r"^```.*?^```$", flags=re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^)\s]+)\)")
MOST_BYTES = 200_000  # of a picture


def text_of(page):
    """A page without its blocks of code, in which nothing is a link."""
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    return re.sub(r"`[^`\n]*`", "", text)


def anchors(page):
    """What GitHub and mkdocs make of the headings of a page; of equal ones the second is -1."""
    found = []
    for head in re.findall(r"^#+ (.+)$", FENCE.sub("", page.read_text(encoding="utf-8")), flags=re.MULTILINE):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", head)
        name = re.sub(r"[^\w\- ]", "", plain.lower()).strip().replace(" ", "-")
        found.append(f"{name}-{found.count(name)}" if name in found else name)
    return set(found)


def broken(page):
    """The links of a page that lead nowhere."""
    out = []
    for target in LINK.findall(text_of(page)):
        if "://" in target or target.startswith("mailto:"):
            continue
        path, _, anchor = target.partition("#")
        other = (page.parent / path).resolve() if path else page
        if not other.exists() or (anchor and other.suffix == ".md" and anchor not in anchors(other)):
            out.append(target)
    return out


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_no_link_leads_nowhere(page):
    assert broken(page) == []


def test_a_broken_link_would_be_found(tmp_path):
    (tmp_path / "there.md").write_text("# One heading\n# One heading\n")
    page = tmp_path / "page.md"
    page.write_text(
        "# Own\n[a](there.md) [b](there.md#one-heading-1) ![c](no.png) [d](#own) [e](#no) [f](there.md#two)\n"
        "```\n[g](none.md)\n```\n`[h](none.md)` [i](https://example.org) ![[j](k)](none.md)\n"
    )
    assert broken(page) == ["no.png", "#no", "there.md#two", "none.md"]


def test_every_page_is_reached_from_the_index_or_the_readme():
    linked = {
        (page.parent / target.partition("#")[0]).resolve()
        for page in PAGES
        for target in LINK.findall(text_of(page))
        if "://" not in target and page.name != "CHANGELOG.md"
    }
    assert [
        page
        for page in PAGES
        if page not in linked and page.name not in ("README.md", "index.md", "CHANGELOG.md")
    ] == []


def test_every_picture_is_shown_and_small():
    pictures = sorted((ROOT / "docs" / "images").glob("*"))
    shown = {Path(target).name for page in PAGES for target in LINK.findall(text_of(page))}
    assert {path.name for path in pictures} <= shown
    assert all(path.stat().st_size < MOST_BYTES for path in pictures)
    assert {f"{kind}.png" for kind in ("diagnosis", "loop", "evaluation", "import", "prove")} <= {
        p.name for p in pictures
    }
