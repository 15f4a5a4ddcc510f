"""What the diagnosis says of recordings of real machines, with the base simulators of data/README.md and no hints.

    GPSIM_RECORDINGS=... python benchmarks/real_recordings.py --out runs/real_recordings

imports every set by its shipped mapping, diagnoses it, and writes OUT/summary.md: verdict, explained share, effects
with 90 % intervals, rivals, held-out errors, and seconds of processors (which do not depend on what else the machine
does) and by the clock on all cores. The diagnoses themselves (report.html, figures) lie beside it.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gpsim.diagnosis import Diagnosis
from gpsim.findings import Estimate, NamedEffect, Share
from gpsim.reports.quantities import percent

ROOT = Path(__file__).resolve().parents[1]
FOLDER = Path(os.environ.get("GPSIM_RECORDINGS", ROOT.parent / "shared" / "recordings"))
GPSIM = Path(sys.executable).with_name("gpsim")
TANKS = f"{ROOT / 'docs' / 'examples' / 'cascaded_tanks.py'}:CascadedTanks"
KINDS = {
    "before": "base", "tuned": "tuned", "gp": "GP", "after": "effects", "after_gp": "effects + GP",
    "noise_floor": "floor",
}  # fmt: skip


@dataclass(frozen=True)
class Set:
    """A public recording: where it lies, the mapping that imports it, and a simulator of one's own where needed."""

    name: str
    source: str
    mapping: str
    simulator: str | None = None


SETS = (
    Set("EMPS slide", "emps/DATA_EMPS.mat", "emps"),
    Set("cart-pole rig, balancing", "physical_cartpole/balancing", "physical_cartpole"),
    Set("cart-pole rig, cart held", "physical_cartpole/free_swing", "physical_cartpole"),
    Set("DART car", "dart_jetracer/bags/4_sept_random_driving_slow.bag", "dart_jetracer"),
    Set("F1TENTH car", "f1tenth_track", "f1tenth_track"),
    Set("torque-limited pendulum", "simple_pendulum", "simple_pendulum"),
    Set("cascaded tanks", "cascaded_tanks/dataBenchmark.csv", "cascaded_tanks", TANKS),
)


@dataclass(frozen=True)
class Outcome:
    """What the tool said of a set: its diagnosis, or the one line with which it refused; seconds: processors, clock."""

    set: Set
    seconds: tuple[float, float]
    diagnosis: Diagnosis | None
    refusal: str


def run(words: Sequence[str]) -> tuple[tuple[float, float], int, str]:
    """Seconds of processors and by the clock, exit code and the last line of a gpsim command."""
    started, begun = processor_seconds(), time.monotonic()
    done = subprocess.run([str(GPSIM), *words], capture_output=True, text=True, check=False)
    lines = (done.stderr or done.stdout).strip().splitlines()
    seconds = processor_seconds() - started, time.monotonic() - begun
    return seconds, done.returncode, lines[-1] if lines else ""


def processor_seconds() -> float:
    """What all commands have used so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def diagnosed(which: Set, out: Path) -> Outcome:
    """Import and diagnose one set."""
    recording, folder = out / "recordings" / which.source, out / which.source
    _, code, said = run(
        ["import", str(FOLDER / which.source), "--mapping", which.mapping, "--out", str(recording)]
    )
    if code:
        return Outcome(which, (0.0, 0.0), None, said)
    own = ["--simulator", which.simulator] if which.simulator else []
    seconds, code, said = run(["diagnose", str(recording), *own, "--out", str(folder)])
    if code:
        return Outcome(which, seconds, None, said)
    path = folder / "diagnosis.json"
    return Outcome(
        which, seconds, Diagnosis.from_dict(json.loads(path.read_text(encoding="utf-8")), str(path)), ""
    )


def told(outcomes: Sequence[Outcome]) -> list[str]:
    """The table of verdicts: what is claimed, with its share, and what is slight."""
    columns = "set", "verdict", "explained", "what was left out, with 90 % intervals", "slight", "left in"
    head = f"| {' | '.join((*columns, 'processor s', 's'))} |"
    lines = [head, "|---" * 8 + "|"]
    for outcome in outcomes:
        seconds = " | ".join(f"{value:.0f}" for value in outcome.seconds)
        found, name = outcome.diagnosis, outcome.set.name
        if found is None:
            lines.append(f"| {name} | refused | | {outcome.refusal} | | | {seconds} |")
            continue
        claims, slight = ([e for e in found.effects if e.role == r] for r in ("headline", "slight"))
        said = spoken(claims) or "nothing"
        for rival in found.alternatives:
            others = " + ".join(f"{e.family} on {e.place}" for e in rival.effects)
            said += f"; or ({rival.probability:.2f}): {others}"
        worth = found.explained
        share = "" if worth.rollout is None else f"{with_interval(worth.rollout)}, {worth.judged_on}"
        left = found.remainder.rate or ""
        lines.append(
            f"| {name} | {found.verdict} | {share} | {said} | {spoken(slight)} | {left} | {seconds} |"
        )
    return lines


def with_interval(share: Share) -> str:
    """A share with its interval."""
    text = f"{100 * share.share:.3g} %"
    return text if share.low is None else f"{text} [{100 * share.low:.3g}, {100 * share.high:.3g}]"


def spoken(effects: Sequence[NamedEffect]) -> str:
    """Effects with their numbers, their share and whether their law holds."""
    said = []
    for e in effects:
        sizes = ", ".join(f"{name} {number(p)}" for name, p in e.parameters.items())
        share = "" if e.importance is None else f", share {percent(e.importance.share)} %"
        form = "" if e.form == "untested" else f", law: {e.form}"
        said.append(f"{e.family} on {e.place} ({sizes}){gate(e)}{share}{form}")
    return " + ".join(said)


def number(estimate: Estimate) -> str:
    """A value with its interval."""
    low, high = ("?" if edge is None else f"{edge:.3g}" for edge in (estimate.low, estimate.high))
    told = f"{estimate.value:.3g} [{low}, {high}] {estimate.unit}".removesuffix(" 1")
    return told + (" AT ITS BOUND" if estimate.at_bound else "")


def gate(effect: NamedEffect) -> str:
    """Where and since when it acts, if not always and everywhere."""
    words = [f"for {name} in [{low:.3g}, {high:.3g}]" for name, (low, high) in effect.region.items()]
    if effect.since is not None:
        words.append(f"since {effect.since:.3g} s")
    return "".join(f" {word}" for word in words)


def errors(outcomes: Sequence[Outcome]) -> list[str]:
    """The table of held-out errors: one step, then rollouts."""
    head = " | ".join(KINDS.values())
    lines = [f"| set | error of | {head} | unit |", "|---" * (len(KINDS) + 3) + "|"]
    for outcome in outcomes:
        if outcome.diagnosis is None:
            continue
        fit = outcome.diagnosis.fit
        runs = {f"{name} after {fit.rollout.horizon_s:.3g} s": e for name, e in fit.rollout.channels.items()}
        for name, e in {**fit.one_step, **runs}.items():
            values = " | ".join(f"{e.of(kind):.3g}" for kind in KINDS)
            lines.append(f"| {outcome.set.name} | {name} | {values} | {e.unit} |")
    return lines


def main() -> None:
    """Diagnose every set and write the summary."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("runs/real_recordings"), help="a folder that is new")
    parser.add_argument("--only", nargs="*", default=[], help="mappings to look at, all by default")
    given = parser.parse_args()
    if not FOLDER.is_dir():
        parser.error(f"no recordings at {FOLDER}: set GPSIM_RECORDINGS, see data/README.md")
    if given.out.exists():
        parser.error(f"{given.out} exists: the summary is of one run; name a new folder with --out")
    outcomes = []
    for which in SETS:
        if given.only and which.mapping not in given.only:
            continue
        outcomes.append(diagnosed(which, given.out))
        print("\n".join(told(outcomes[-1:])[2:]), flush=True)
    text = "\n".join([*told(outcomes), "", *errors(outcomes), ""])
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "summary.md").write_text(text, encoding="utf-8")
    print("\n".join(["", *errors(outcomes)]))
    print(f"\n{given.out / 'summary.md'}")


if __name__ == "__main__":
    main()
