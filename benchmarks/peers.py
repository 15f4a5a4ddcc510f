"""gpsim and its peers on the same data: one command, each peer at its best, and a page of what came out.

    GPSIM_RECORDINGS=... python benchmarks/peers.py --out runs/peers           # every ground and peer: hours
    python benchmarks/peers.py --ground emps --peer pysindy                    # some of it
    python benchmarks/peers.py --keep                                          # the page, of the results kept

runs every cell (ground, peer, seed) in a process of its own and writes OUT/GROUND/PEER-SEED.json; a cell that has its
file is not run again, so the command carries on where it was stopped. `--again` repeats the cells that crashed, were
stopped, or lacked a package. `--keep` puts the cells of OUT into benchmarks/peers.json and makes
docs/method/peers.md and docs/images/peers.svg from it. The peers' packages:
`pip install -c constraints.txt -e '.[peers]'`.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.metadata
import importlib.util
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from peer_grounds.contract import Ground, Peer, Task, as_cell

ROOT = Path(__file__).resolve().parents[1]
MODULES = "records", "worlds", "robots", "training"  # of peer_grounds, in the order of the page
KEPT = ROOT / "benchmarks" / "peers.json"
LEAST_LIMIT = 60.0  # s


def grounds() -> dict[str, Ground]:
    """Every ground by its name; two of one name are an error."""
    found: dict[str, Ground] = {}
    for name in MODULES:
        if importlib.util.find_spec(f"peer_grounds.{name}") is None:
            continue
        for ground in importlib.import_module(f"peer_grounds.{name}").GROUNDS:
            if ground.name in found:
                raise ValueError(f"two grounds are named {ground.name}")
            found[ground.name] = ground
    return found


def cell_path(out: Path, ground: str, peer: str, seed: int) -> Path:
    """Where a cell lies."""
    return out / ground / f"{peer}-{seed}.json"


def versions(peer: Peer) -> dict[str, str]:
    """Of gpsim and of what the peer needs."""
    found = {}
    of_module = importlib.metadata.packages_distributions()
    for name in ("gpsim", *peer.needs):
        top = name.split(".")[0]
        for package in of_module.get(top, [top])[:1]:
            try:
                found[package] = importlib.metadata.version(package)
            except importlib.metadata.PackageNotFoundError:
                found[package] = "not installed"
    return found


def lacking(peer: Peer) -> str:
    """The modules that are not there, in words; nothing where all are."""
    gone = [name for name in peer.needs if importlib.util.find_spec(name.split(".")[0]) is None]
    return f"not installed: {', '.join(gone)}" if gone else ""


def run_cell(ground: Ground, peer: Peer, seed: int, out: Path) -> dict[str, Any]:
    """Run a cell in a process of its own, measure it, and write its file whole."""
    cell: dict[str, Any] = {
        "ground": ground.name, "peer": peer.name, "seed": seed, "kind": peer.kind, "status": "absent",
        "why": ground.absent() or lacking(peer), "processor_s": 0.0, "clock_s": 0.0, "versions": versions(peer),
    }  # fmt: skip
    path = cell_path(out, ground.name, peer.name, seed)
    folder = path.with_suffix("")
    folder.mkdir(parents=True, exist_ok=True)
    if not cell["why"]:
        cell |= measured(folder, ground.name, peer, seed)
        if cell["status"] == "done":
            cell |= json.loads((folder / "answer.json").read_text(encoding="utf-8"))
    draft = path.with_suffix(".part")
    draft.write_text(json.dumps(cell, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    draft.replace(path)
    return cell


def measured(folder: Path, ground: str, peer: Peer, seed: int) -> dict[str, Any]:
    """How the cell's process ended, and its seconds with those of the children it waited for."""
    log, begun, stopped = folder / "log.txt", time.monotonic(), False
    words = [
        sys.executable,
        str(Path(__file__).resolve()),
        "--cell",
        ground,
        peer.name,
        str(seed),
        str(folder),
    ]
    environment = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"} | dict(os.environ)
    with log.open("w", encoding="utf-8") as said:
        process = subprocess.Popen(words, stdout=said, stderr=said, env=environment, start_new_session=True)
        while True:
            done, status, used = os.wait4(process.pid, os.WNOHANG)
            if done:
                break
            if time.monotonic() - begun > max(peer.limit_s, LEAST_LIMIT) and not stopped:
                os.killpg(process.pid, 9)
                stopped = True
            time.sleep(0.2)
    process.returncode = os.waitstatus_to_exitcode(status)
    found = {
        "processor_s": round(used.ru_utime + used.ru_stime, 2),
        "clock_s": round(time.monotonic() - begun, 2),
    }
    if stopped:
        return found | {"status": "stopped", "why": f"not done within {peer.limit_s:.0f} s"}
    if process.returncode or not (folder / "answer.json").is_file():
        lines = [
            line for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()
        ]
        return found | {
            "status": "crashed",
            "why": lines[-1][:300] if lines else f"exit {process.returncode}",
        }
    return found | {"status": "done", "why": ""}


def inside(ground: str, peer: str, seed: int, folder: Path) -> None:
    """What the process of a cell does."""
    (folder / "answer.json").unlink(missing_ok=True)
    chosen = grounds()[ground]
    player = next(one for one in chosen.peers if one.name == peer)
    said = as_cell(player.run(Task(seed, folder)))
    (folder / "answer.json").write_text(json.dumps(said), encoding="utf-8")


def wanted(given: argparse.Namespace, known: dict[str, Ground]) -> list[tuple[Ground, Peer, int]]:
    """The cells that the words ask for."""
    return [
        (ground, peer, seed)
        for ground in known.values()
        if not given.ground or ground.name in given.ground
        for peer in ground.peers
        if not given.peer or peer.name in given.peer
        for seed in ground.seeds
        if not given.seed or seed in given.seed
    ]


def is_due(path: Path, again: bool) -> bool:
    """Whether a cell has to be run."""
    if not path.is_file():
        return True
    return again and json.loads(path.read_text(encoding="utf-8"))["status"] != "done"


def clock(seconds: float) -> str:
    """Minutes and seconds."""
    return f"{int(seconds) // 60} min {int(seconds) % 60:02d} s"


def headline(ground: Ground, cell: dict[str, Any]) -> str:
    """The line of the terminal."""
    if cell["status"] != "done":
        return f"{cell['status']}: {cell['why']}"
    score = cell["scores"][ground.headline]
    value = "ran away" if score["value"] is None else f"{score['value']:.4g} {score['unit']}"
    return f"{ground.headline} {value}, {cell['processor_s']:.0f} processor s"


def play(cells: Sequence[tuple[Ground, Peer, int]], out: Path, again: bool) -> None:
    """Run what is due, one after another, saying how far it is and how long it will take yet."""
    due = [c for c in cells if is_due(cell_path(out, c[0].name, c[1].name, c[2]), again)]
    print(f"{len(cells)} cells, {len(cells) - len(due)} of them done already", flush=True)
    begun = time.monotonic()
    for i, (ground, peer, seed) in enumerate(due):
        print(f"[{i + 1}/{len(due)}] {ground.name} {peer.name} seed {seed} ...", end=" ", flush=True)
        said = headline(ground, run_cell(ground, peer, seed, out))
        spent = time.monotonic() - begun
        left = spent / (i + 1) * (len(due) - i - 1)
        print(f"{said}; {clock(spent)} gone, about {clock(left)} left", flush=True)


def keep(out: Path, known: dict[str, Ground]) -> None:
    """Put the cells of a folder among the kept ones, then make the page and the figure."""
    from peer_grounds.page import write_page

    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.is_file() else []
    cells = {(c["ground"], c["peer"], c["seed"]): c for c in kept}
    for path in sorted(out.glob("*/*-*.json")):
        cell = json.loads(path.read_text(encoding="utf-8"))
        cells[cell["ground"], cell["peer"], cell["seed"]] = cell
    found = [cells[key] for key in sorted(cells)]
    KEPT.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    for made in write_page(ROOT, list(known.values()), found):
        print(made)


def main() -> None:
    """Run the cells that are due, or keep what there is."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--out", type=Path, default=Path("runs/peers"))
    words.add_argument("--ground", nargs="*", default=[], help="grounds to play on, all by default")
    words.add_argument("--peer", nargs="*", default=[], help="peers to ask, all by default")
    words.add_argument("--seed", nargs="*", default=[], type=int, help="seeds, all by default")
    words.add_argument(
        "--recordings", type=Path, help="the public recordings of data/README.md; or GPSIM_RECORDINGS"
    )
    words.add_argument("--scoreboard", type=Path, help="the scored logs; or GPSIM_SCOREBOARD")
    words.add_argument("--again", action="store_true", help="repeat cells that are not done")
    words.add_argument("--keep", action="store_true", help="keep the results of OUT and make the page")
    words.add_argument("--list", action="store_true", help="say which grounds and peers there are")
    words.add_argument("--cell", nargs=4, help=argparse.SUPPRESS)
    given = words.parse_args()
    if given.cell:
        inside(given.cell[0], given.cell[1], int(given.cell[2]), Path(given.cell[3]))
        return
    for name in ("recordings", "scoreboard"):
        if getattr(given, name):
            os.environ[f"GPSIM_{name.upper()}"] = str(getattr(given, name).resolve())
    known = grounds()
    strange = [g for g in given.ground if g not in known]
    strange += [p for p in given.peer if all(p != one.name for g in known.values() for one in g.peers)]
    if strange:
        words.error(f"no ground or peer is called {strange[0]}; --list says which there are")
    if given.list:
        for ground in known.values():
            print(f"{ground.name}: {', '.join(peer.name for peer in ground.peers)} {ground.absent()}")
        return
    if given.keep:
        keep(given.out, known)
        return
    for ground in known.values():
        if ground.absent() and (not given.ground or ground.name in given.ground):
            print(f"{ground.name}: {ground.absent()}", flush=True)
    play(wanted(given, known), given.out.resolve(), given.again)


if __name__ == "__main__":
    main()
