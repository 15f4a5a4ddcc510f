"""Draw sentences at random from pages and messages, for an editor to judge: `python docs/sentences.py SEED [N]`.

Sentences of README.md and of the pages that are written by hand, of the help of the commands, and of the strings that
gpsim raises, warns of and reports. A name in a message that is filled in when it is said stands as {}.
"""

from __future__ import annotations

import ast
import random
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from plain_words import pages

ROOT = Path(__file__).resolve().parents[1]
FEWEST = 4  # words of a sentence that can be judged by itself


def split(text: str) -> Iterator[str]:
    """Whole sentences of a text, each on one line."""
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*#|]|\d+\.) )", text):
        words = re.sub(r"^(?:[-*#>]+|\d+\.) ", "", " ".join(block.split()))
        for sentence in re.split(r"(?<=[.?!])\s+(?=[A-Z*`\[])", words):
            if len(sentence.split()) >= FEWEST and sentence[-1] in ".?!":
                yield sentence


def prose(page: Path) -> Iterator[str]:
    """The sentences of a page, without blocks of code, pictures and tables."""
    text = re.sub(r"```.*?```|^(?: {4}|\||!\[).*?$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    yield from split(text)


def literal(node: ast.AST) -> str:
    """What a node says, or nothing: a string, or one that is filled in."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.JoinedStr):
        return "".join(literal(part) or "{}" for part in node.values)
    return ""


def messages(path: Path) -> Iterator[str]:
    """What a file says when it runs: strings of a sentence's length; docstrings and parts of another one apart."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    silent = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    silent |= {
        id(p) for n in ast.walk(tree) if isinstance(n, ast.JoinedStr) for p in ast.walk(n) if p is not n
    }
    for node in ast.walk(tree):
        said = "" if id(node) in silent else " ".join(literal(node).split())
        code = re.search(r"\]\(|<|\bdef \b|\bimport \w+\.|: none;|max-width|\] = |\.\*", said)
        if len(re.findall(r"\b[a-z]{2,}\b", said)) >= FEWEST + 2 and not code:
            yield said


def population() -> list[tuple[str, str]]:
    """(place, sentence), each sentence once, in order."""
    said = {s: p.relative_to(ROOT).as_posix() for p in pages() for s in prose(p)}
    for folder in ("gpsim", "cli"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            said |= {s: path.relative_to(ROOT).as_posix() for s in messages(path) if s not in said}
    return sorted((place, sentence) for sentence, place in said.items())


def main() -> None:
    """Print a draw: place and sentence, a line each."""
    seed, number = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 200
    every = population()
    print(f"# seed {seed}: {number} of {len(every)} sentences")
    for place, sentence in sorted(random.Random(seed).sample(every, number)):
        print(f"{place}: {sentence}")


if __name__ == "__main__":
    main()
