"""Nobody needs to know which commit or which year a figure came from: pages cite neither. History is in the changelog."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "data" / "README.md", *sorted(ROOT.glob("docs/**/*.md"))]
HASH = re.compile(r"(?<![\w.+-])(?=[0-9a-f]*[a-f])(?=[0-9a-f]*[0-9])[0-9a-f]{7,40}(?![\w.])")
MONTHS = "January|February|March|April|May|June|July|August|September|October|November|December"
DATE = re.compile(rf"\b(?:\d{{1,2}} (?:{MONTHS})\b|(?:{MONTHS}) (?:\d{{1,2}}\b|\d{{4}}\b)|\d{{4}}-\d\d-\d\d)")
SEEDS = re.compile(  # a seed may look like a year: where the seed itself is meant, and says so
    r"(?:[sS]eeds?[`*]*|--seed|since[`]* =|proofs/)\s*[`]*\d+(?:(?:,| and| to|, and)\s+(?:seeds? )?\d+)*"
)
YEAR = re.compile(r"(?<![\w.])20(?:2[6-9]|[3-9]\d)\b")  # of the project's own time; the literature is older


def history(text):
    """Commits, dates and years that a text cites."""
    plain = SEEDS.sub("seed", text)
    return [found.group() for kind in (HASH, DATE, YEAR) for found in kind.finditer(plain)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_pages_cite_no_commit_and_no_date(page):
    assert history(page.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("run with commit 039caeb", ["039caeb"]),
        ("Of 22 November 2026.", ["22 November", "2026"]),
        ("on 2026-11-22", ["2026-11-22", "2026"]),
        ("in June 2021", ["June 2021"]),
        ("as measured in 2027", ["2027"]),
        (
            "seed 2031, up to seed\n  2031, seeds 2026 to 2028, `--seed 2040`, `since = 2030`, benchmarks/proofs/2040.json",
            [],
        ),
        ("Garancini (2025), GPML (2006), 2.9e-7 m, 1e-10, 0.0002 defaced, trials 100001 to 100004", []),
    ],
)
def test_history_is_told_from_seeds_and_literature(text, found):
    assert history(text) == found


def test_results_are_tables_with_short_texts_between():
    blocks = (ROOT / "docs" / "results.md").read_text(encoding="utf-8").split("\n\n")
    assert sum(block.count("\n") + 2 for block in blocks) <= 330
    assert max(len(block.split()) for block in blocks if not block.startswith("|")) <= 90
