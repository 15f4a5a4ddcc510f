"""How large gpsim is: code lines, files and public names by room, and the settings of the diagnosis.

    python benchmarks/size.py [COMMIT] [--against COMMIT]

A code line holds code: blank lines, comments and docstrings do not count. A room is a package of gpsim/ with all that
lies below it, or cli/; a public name is a function, class or constant of a module that does not begin with an
underscore; a setting is a leaf of conf/diagnose/default.yaml. With --against every figure stands beside that commit's.
"""

from __future__ import annotations

import argparse
import ast
import io
import tarfile
import tokenize
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from subprocess import run

import yaml

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("gpsim", "cli", "tests", "conf")
SETTINGS = "conf/diagnose/default.yaml"
SILENT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}


@dataclass(frozen=True)
class Size:
    """Counts of a room."""

    lines: int = 0
    files: int = 0
    names: int = 0

    def __add__(self, other: Size) -> Size:
        return Size(self.lines + other.lines, self.files + other.files, self.names + other.names)


def sources(commit: str | None) -> dict[str, str]:
    """Path -> text of Python files and of the settings, of a commit or of the checkout as it stands."""
    if commit is None:
        paths = [p for folder in FOLDERS for p in sorted((ROOT / folder).rglob("*"))]
        wanted = [p for p in paths if p.suffix == ".py" or p == ROOT / SETTINGS]
        return {p.relative_to(ROOT).as_posix(): p.read_text(encoding="utf-8") for p in wanted}
    packed = run(
        ["git", "archive", "--format=tar", commit, *FOLDERS], cwd=ROOT, capture_output=True, check=True
    )
    with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
        read = {m.name: archive.extractfile(m) for m in archive.getmembers() if m.isfile()}
        return {
            name: file.read().decode("utf-8")
            for name, file in read.items()
            if file is not None and (name.endswith(".py") or name == SETTINGS)
        }


def code_lines(text: str) -> int:
    """Lines that hold code: no blank ones, no comments, no docstrings."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in SILENT:
            lines |= set(range(token.start[0], token.end[0] + 1))
    return len(lines - set(_docstrings(ast.parse(text))))


def _docstrings(tree: ast.Module) -> Iterator[int]:
    """Lines of strings that stand alone as a statement: docstrings, those below a constant among them."""
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            yield from range(node.lineno, (node.end_lineno or node.lineno) + 1)


def public_names(text: str) -> int:
    """Functions, classes and constants of a module that do not begin with an underscore."""
    return sum(not name.startswith("_") for node in ast.parse(text).body for name in _bound(node))


def _bound(node: ast.stmt) -> Iterator[str]:
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        yield node.name
    elif isinstance(node, ast.Assign):
        yield from (n.id for t in node.targets for n in ast.walk(t) if isinstance(n, ast.Name))
    elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
        yield node.target.id


def room_of(path: str) -> str:
    """The package of gpsim/ that holds a file; modules that lie loose in gpsim/ are one room."""
    parts = path.split("/")
    return parts[0] if parts[0] != "gpsim" else parts[1] if len(parts) > 2 else "loose modules"


def sizes(files: Mapping[str, str]) -> dict[str, Size]:
    """Room -> its counts."""
    found: dict[str, Size] = {}
    for path, text in files.items():
        if path.endswith(".py") and not path.startswith("conf/"):
            one = Size(code_lines(text), 1, public_names(text))
            found[room_of(path)] = found.get(room_of(path), Size()) + one
    return found


def settings(files: Mapping[str, str]) -> int:
    """How many settings the diagnosis has."""
    return _leaves(yaml.safe_load(files[SETTINGS])) if SETTINGS in files else 0


def _leaves(value: object) -> int:
    return sum(map(_leaves, value.values())) if isinstance(value, dict) and value else 1


def fullest(files: Mapping[str, str]) -> tuple[str, int]:
    """The folder of gpsim/ with most files, and how many."""
    folders = Counter(path.rpartition("/")[0] for path in files if path.startswith("gpsim/"))
    return folders.most_common(1)[0]


def table(before: Mapping[str, str] | None, after: Mapping[str, str]) -> list[str]:
    """The table as Markdown, a room a row, the largest first."""
    new, old = sizes(after), None if before is None else sizes(before)
    rooms = sorted({*new, *(old or {})} - {"tests"}, key=lambda r: -new.get(r, Size()).lines)

    def cells(room: str, now: Size, then: Size | None) -> str:
        pairs = [
            (now.lines, then and then.lines),
            (now.files, then and then.files),
            (now.names, then and then.names),
        ]
        return (
            f"| {room} | " + " | ".join(f"{n:,}" if t is None else f"{t:,} → {n:,}" for n, t in pairs) + " |"
        )

    def row(room: str) -> str:
        return cells(room, new.get(room, Size()), None if old is None else old.get(room, Size()))

    everything = sum((new[r] for r in new if r != "tests"), Size())
    earlier = None if old is None else sum((old[r] for r in old if r != "tests"), Size())
    held = [settings(after)] if before is None else [settings(before), settings(after)]
    folders = [fullest(after)] if before is None else [fullest(before), fullest(after)]
    return [
        "| room | code lines | files | public names |",
        "|---|---|---|---|",
        *map(row, rooms),
        cells("**gpsim with its commands**", everything, earlier),
        row("tests"),
        "",
        f"Settings of the diagnosis: {' → '.join(map(str, held))}. "
        f"The fullest folder: {' → '.join(f'{name} ({count})' for name, count in folders)}.",
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("commit", nargs="?", help="a commit; the checkout by default")
    parser.add_argument("--against", help="an earlier commit to stand beside it")
    given = parser.parse_args()
    print("\n".join(table(sources(given.against) if given.against else None, sources(given.commit))))


if __name__ == "__main__":
    main()
