"""watch: recordings as they come, against an old account; a JSON object a recording, and whether the account holds."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.artifacts import read_artifact
from gpsim.errors import NoDiagnosis, UsageError, near_path
from gpsim.files import disk_errors, file_digest, plain
from gpsim.planning import Account, Alarm, Monitor, Stretch, WatchSettings, looked_at
from gpsim.settings import build
from gpsim.stages.diagnose import Task, open_recording, read_corrected, read_left_open
from gpsim.stages.fleet import recordings_in
from gpsim.stages.stage import blamed

SCHEMA = "gpsim.watch/1"
WAIT = 5.0
"""Seconds between two looks at a folder."""


@dataclass(frozen=True)
class Watched:
    """What one recording, or what came to it since the last look, says.

    why: why it says nothing, if so.
    """

    recording: str
    sha256: str
    stretches: tuple[Stretch, ...]
    alarms: tuple[Alarm, ...]
    parameters: tuple[tuple[str, str], ...]
    driven: float
    sums: Mapping[str, Any]
    why: str = ""

    @property
    def holds(self) -> bool:
        """Whether the account does, after it."""
        return not self.alarms

    @property
    def share(self) -> float | None:
        """Of the base's mismatch that the account takes off, the mean over stretches."""
        shares = [s.share for s in self.stretches if s.share is not None]
        return float(np.mean(shares)) if shares else None

    def to_dict(self) -> dict[str, Any]:
        """A line of the log."""
        names = [f"{effect}: {name}" for effect, name in self.parameters]
        stretches = [
            {
                "episode": s.episode,
                "begin": s.begin,
                "end": s.end,
                "explained": s.share,
                "parameters": dict(zip(names, s.theta.tolist(), strict=True)),
                "left": dict(s.left),
            }
            for s in self.stretches
        ]
        content: dict[str, Any] = plain(
            {
                "schema": SCHEMA,
                "recording": self.recording,
                "sha256": self.sha256,
                "holds": self.holds,
                "explained": self.share,
                "driven": self.driven,
                "alarms": [asdict(alarm) for alarm in self.alarms],
                "stretches": stretches,
                "why": self.why or None,
                "sums": self.sums,
            }
        )
        return content

    @property
    def line(self) -> str:
        """What a person wants to know, in one line."""
        if self.why:
            return f"{self.recording}: says nothing ({self.why})"
        share = "" if self.share is None else f", explains {math.floor(1000 * self.share) / 10:.3g} %"
        if self.holds:
            return f"{self.recording}: holds{share}, {len(self.stretches)} stretches"
        told = [
            f"{a.what} {a.was:.3g} -> {a.now:.3g} since {a.since[1]:.4g} s of {a.since[0]}"
            for a in self.alarms
        ]
        return f"{self.recording}: no longer holds{share}; " + "; ".join(told)


@dataclass
class Watch:
    """A running watch. log: the JSON lines, which an earlier run may have begun."""

    diagnosis: Path
    what: Path
    log: Path
    settings: WatchSettings

    def __post_init__(self) -> None:
        artifact = read_artifact(self.diagnosis, "diagnose")
        self.name = str(artifact.manifest["config"]["simulator"])
        self.account = Account(read_corrected(self.diagnosis), read_left_open(self.diagnosis))
        if not self.account.hypothesis.terms:
            raise UsageError(f"{self.diagnosis}: names no effect: there is no account to watch")
        self.monitor = Monitor(self.account, self.settings)
        self.seen: dict[str, str] = {}
        self.driven: dict[str, float] = {}
        self.digest, self.holds = artifact.digest, True
        earlier = self.log.read_text(encoding="utf-8").splitlines() if self.log.is_file() else []
        for number, line in enumerate(earlier, 1):
            try:
                said = json.loads(line)
                same, self.holds = said["diagnosis"] == self.digest, bool(said["holds"])
                self.seen[said["recording"]] = said["sha256"]
                self.driven[said["recording"]] = float(said["driven"])
                self.monitor.resume(said["sums"])
            except (ValueError, KeyError, TypeError) as error:
                raise UsageError(
                    f"{self.log}: line {number} is not from gpsim watch; move it away, or choose another --log"
                ) from error
            if not same:
                raise UsageError(
                    f"{self.log}: is for another diagnosis than {self.diagnosis}; move it away, or choose another "
                    "--log"
                )

    def pass_over(self) -> Iterator[Watched]:
        """Everything that is new, once."""
        if not self.what.exists():
            raise UsageError(f"{self.what}: no such recording or folder{near_path(self.what)}")
        empty = self.what.is_dir() and not any(self.what.iterdir())
        found = {} if empty else recordings_in([self.what], self.name)
        for name, path in sorted(found.items(), key=lambda item: (item[1].stat().st_mtime, item[0])):
            tables = (path / name for name in ("recording.csv", "recording.parquet"))
            table = next(filter(Path.is_file, tables), None) if path.is_dir() else path
            digest = "" if table is None else file_digest(table)
            if self.seen.get(name) == digest:
                continue
            said = self._looked(name, path, digest)
            self.seen[name], self.driven[name], self.holds = digest, said.driven, said.holds
            with disk_errors(self.log, "--log"), self.log.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"diagnosis": self.digest, **said.to_dict()}, allow_nan=False) + "\n")
            yield said

    def _looked(self, name: str, path: Path, digest: str) -> Watched:
        before, why = self.driven.get(name, 0.0), ""
        stretches: list[Stretch] = []
        alarms: list[Alarm] = []
        try:
            recording, _ = open_recording(Task(path, self.name))
            with blamed(self.name):
                for stretch in looked_at(self.account, recording, self.settings.stretch, before):
                    stretches.append(stretch)
                    if alarms := self.monitor.see(name, stretch):
                        break
        except UsageError as error:
            # Of one among many: it may be half written yet, and is looked at when it changes.
            if not self.what.is_dir() and not isinstance(error, NoDiagnosis):
                raise
            why = str(error)
        driven = before + sum(s.seconds for s in stretches)
        driven = self.settings.stretch * round(driven / self.settings.stretch)
        told = (tuple(stretches), tuple(alarms), self.account.names)
        return Watched(name, digest, *told, driven, self.monitor.state, why)


def watch_of(diagnosis: Path, what: Path, log: Path | None, section: Mapping[str, Any]) -> Watch:
    """A watch under the settings of a section; the log lies beside what is watched unless said otherwise."""
    settings = build(WatchSettings, section, "watch")
    log = log or what.with_name(f"{what.name}.watch.jsonl")
    if log.parent != Path() and not log.parent.is_dir():
        raise UsageError(f"--log {log}: no folder {log.parent}")
    return Watch(diagnosis, what, log, settings)


def watched(watch: Watch, once: bool, wait: Callable[[float], None] = time.sleep) -> Iterator[Watched]:
    """What comes, until the account no longer holds; once: what is there."""
    while watch.holds:
        for said in watch.pass_over():
            yield said
            if not said.holds:
                return
        if once:
            return
        wait(WAIT)
