"""The house in numbers and as a drawing: which room imports which, in a commit or in the checkout as it stands.

    python benchmarks/import_graph.py [COMMIT]

A room is a folder of gpsim/ with its files, cli/, or a module that lies loose in gpsim/. Printed are a table and the
arrows between rooms as a Mermaid drawing, in which what follows from others (A -> B -> C makes A -> C) is left out.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def sources(commit: str | None) -> dict[str, str]:
    """Path -> text of every Python file of gpsim/ and cli/."""
    if commit is None:
        paths = [*ROOT.glob("gpsim/**/*.py"), *ROOT.glob("cli/**/*.py")]
        return {p.relative_to(ROOT).as_posix(): p.read_text(encoding="utf-8") for p in sorted(paths)}
    names = _git("ls-tree", "-r", "--name-only", commit, "gpsim", "cli").split("\n")
    return {name: _git("show", f"{commit}:{name}") for name in names if name.endswith(".py")}


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout


def module_of(path: str) -> str:
    """The dotted name of a file; cli/ is the package gpsim.cli."""
    parts = path.removesuffix(".py").removesuffix("/__init__").split("/")
    return ".".join(parts if parts[0] == "gpsim" else ["gpsim", *parts])


def room_of(module: str, packages: Iterable[str]) -> str:
    """The folder in which a module lies, or the module itself where it lies loose."""
    name = module if module in packages else module.rpartition(".")[0]
    return module.removeprefix("gpsim.") if name == "gpsim" else name.removeprefix("gpsim.")


def imports(files: Mapping[str, str]) -> dict[str, set[str]]:
    """Module -> modules of gpsim that it imports, at any depth of its code."""
    modules = {module_of(path): path for path in files}
    out: dict[str, set[str]] = {}
    for module, path in modules.items():
        is_face = path.endswith("__init__.py")
        package = module.split(".") if is_face else module.split(".")[:-1]
        found: set[str] = set()
        for node in ast.walk(ast.parse(files[path])):
            if isinstance(node, ast.Import):
                found |= {a.name for a in node.names}
            elif isinstance(node, ast.ImportFrom):
                base = package[: len(package) - node.level + 1] if node.level else []
                name = ".".join([*base, node.module] if node.module else base)
                found |= {f"{name}.{a.name}" if f"{name}.{a.name}" in modules else name for a in node.names}
        out[module] = (found & modules.keys()) - {module, "gpsim"}
    return out


def circles(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """Groups of files each of which leads to all others of its group."""
    reach = {name: _reached(graph, name) for name in graph}
    groups: list[list[str]] = []
    for name in sorted(graph):
        group = sorted(other for other in reach[name] if name in reach.get(other, ()) and other != name)
        if group and sorted([name, *group]) not in groups:
            groups.append(sorted([name, *group]))
    return groups


def _reached(graph: Mapping[str, set[str]], start: str) -> set[str]:
    reached, ahead = set[str](), list(graph[start])
    while ahead:
        name = ahead.pop()
        if name not in reached:
            reached.add(name)
            ahead += graph.get(name, ())
    return reached


def main() -> None:
    """Print the table and the drawing."""
    files = sources(sys.argv[1] if len(sys.argv) > 1 else None)
    graph = imports(files)
    packages = {module_of(path) for path in files if path.endswith("__init__.py")}
    rooms = {module: room_of(module, packages) for module in graph if module != "gpsim"}
    arrows = {
        (rooms[a], rooms[b]) for a, seen in graph.items() for b in seen if a in rooms and b in rooms
    } - {(room, room) for room in rooms.values()}
    plain = {m: {o for o in seen if o not in packages} for m, seen in graph.items() if m not in packages}
    full = Counter(rooms[m] for m in rooms if m not in packages)
    loose = sorted(m for m in rooms if m.count(".") == 1 and m not in packages)
    fullest = max((r for r in full if r.split(".")[0] == "diagnosis"), key=lambda r: full[r])
    print("| what | |\n|---|---|")
    print(f"| files; lines | {len(files)}; {sum(t.count(chr(10)) for t in files.values())} |")
    print(f"| loose modules in gpsim/ | {len(loose)} |")
    print(f"| rooms; arrows between them | {len(set(rooms.values()))}; {len(arrows)} |")
    print(f"| files in the fullest folder of diagnosis/ | {full[fullest]} ({fullest}) |")
    print(f"| circles of files | {len(circles(plain))} |")
    by_room = {room: {b for a, b in arrows if a == room} for room in set(rooms.values())}
    beyond = {room: {far for b in seen for far in _reached(by_room, b)} for room, seen in by_room.items()}
    print("\n```mermaid\ngraph TD")
    for room in sorted(by_room):
        for other in sorted(by_room[room] - beyond[room]):
            print(f"  {room.replace('.', '_')}[{room}] --> {other.replace('.', '_')}[{other}]")
    print("```")


if __name__ == "__main__":
    main()
