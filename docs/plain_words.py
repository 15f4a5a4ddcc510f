"""Whether the words of the project are plain: `python docs/plain_words.py` lists what is not, file and line.

It reads README.md, the pages of docs/ that are written by hand, the help of the commands (docs/reference/cli.md), and
the sentences that reports and commands print. A rule is a pattern and what to say instead. A sentence of a page has at
most LONGEST words. Terms of the method have to be in the glossary. Records of measurements (docs/method/proofs.md) stay
as they were written.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LONGEST = 45  # words of a sentence
RECORDS = {"proofs.md", "settings.md", "configuration.md", "python.md"}  # measured or generated elsewhere
SPOKEN = ("gpsim/reports", "cli")  # whose strings are printed
RULES: dict[str, str] = {
    r"\bforesee\w*": "predict",
    r"\bmends?\b|\bmending\b": "correct, repair",
    r"\b(has|have) no name\b": "is unexplained, is not identified",
    r"\bbeyond noise lies\b": "the error there is not noise",
    r"\bwhat nobody can name\b": "what no effect explains",
    r"\b(that|as) I know\b": "of the catalogue",
    r"\breckons? with\b": "takes into account",
    r"\ba trifle\b": "negligible",
    r"\bby its number\b": "numbered joint0, joint1 ...",
    r"\b[Rr]ead once more\b": "read again",
    r"\bturns? round\b": "reverses",
    r"\btold is\b": "the table shows",
    r"\btold (and|by|of|%)|[:,] told\b": "found, named",
    r"\bstand-ins?\b": "simulated machine",
    r"\busual machines?\b": "machines of this kind",
    r"\b[Nn]obody (measured|commanded|commands|tells|told|tried)\b": "was not measured, was not commanded",
    r"\bwith all of its letters\b": "in full",
    r"\bsays nothing of\b": "does not say",
    r"\bof one's own\b": "of your own",
    r"\bis of no use\b": "is useless",
    r"\bwhoever\b": "anyone who, the person who",
    r"\botherwise than\b": "differently from",
}
EXPLAINED = (
    "coarse step", "concealed", "gate", "nat", "onset", "price", "rival", "Shapley value", "stratum", "world",
)  # fmt: skip
"""Terms that pages and reports may use, because the glossary has them."""
CODE = re.compile(r"```.*?```|^(?:    |\|).*?$|`[^`\n]*`|\]\([^)]*\)", re.MULTILINE | re.DOTALL)


def pages() -> list[Path]:
    """The pages that people read."""
    return [ROOT / "README.md", *(p for p in sorted((ROOT / "docs").rglob("*.md")) if p.name not in RECORDS)]


def prose(text: str) -> str:
    """A page without code, tables and addresses, every line where it was."""
    return CODE.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), text)


def findings(text: str, measured: bool = True) -> Iterator[tuple[int, str]]:
    """(line, what is wrong) of a text; measured: whether the length of its sentences counts, too."""
    for pattern, instead in RULES.items():
        for found in re.finditer(pattern, text):
            yield text.count("\n", 0, found.start()) + 1, f"{found.group()!r}: say {instead}"
    for found in re.finditer(r"[^.:;?!|]+[.:;?!]", text) if measured else ():
        parts = re.split(r"\n\s*\n|\n(?=\s*[-*#|] |\s*\d+\. )", found.group())
        for part in parts:
            if len(part.split()) > LONGEST:
                line = text.count("\n", 0, found.start()) + 1
                yield line, f"a sentence of {len(part.split())} words: make two of it"


def spoken(path: Path) -> Iterator[tuple[int, str]]:
    """(line, text) of every string that a file may print; docstrings are not printed."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    silent = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in silent:
            yield node.lineno, node.value


def main() -> None:
    """Print the findings; exit code 1 where there are any."""
    said = [
        f"{page.relative_to(ROOT)}:{line}: {what}"
        for page in pages()
        for line, what in findings(prose(page.read_text(encoding="utf-8")))
    ]
    for folder in SPOKEN:
        for path in sorted((ROOT / folder).rglob("*.py")):
            for line, text in spoken(path):
                said += [
                    f"{path.relative_to(ROOT)}:{line}: {what}" for _, what in findings(text, measured=False)
                ]
    glossary = (ROOT / "docs" / "reference" / "glossary.md").read_text(encoding="utf-8")
    said += [f"glossary.md: {word!r} is missing" for word in EXPLAINED if f"\n**{word}**" not in glossary]
    print("\n".join(said) or "plain words everywhere")
    sys.exit(1 if said else 0)


if __name__ == "__main__":
    main()
