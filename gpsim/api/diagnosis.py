"""diagnose and Diagnosis: which physics a simulator lacks, and how sure that is."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsim.api.corrected import CorrectedSimulator
from gpsim.api.recordings import Recordings, opened, taken_of
from gpsim.api.simulators import load_simulator
from gpsim.diagnosis import Diagnosis as Result
from gpsim.diagnosis import score
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Settings, read_known, read_settings
from gpsim.effects import Brought, bring, consent_to, installed, own_effect, read_effects
from gpsim.errors import UsageError
from gpsim.findings import NamedEffect, Score, Verdict
from gpsim.posterior import LeftOpen
from gpsim.recordings import Recording
from gpsim.settings import positive, whole
from gpsim.simulators import Simulator, lives_here
from gpsim.stages.diagnosis_files import Question, answer
from gpsim.stages.stage import generator, silent
from gpsim.trust import consent

if TYPE_CHECKING:
    import pandas as pd

    from gpsim.api.found import Found
    from gpsim.reports.diagnosis_figures import Picture

HERE = "DIR"
"""What stands for the folder of a diagnosis that has none yet."""
FRAME = ("role", "family", "place", "parameter", "unit", "value", "low", "high", "share")
"""Columns of the table of effects."""


def diagnose(
    recording: Recordings,
    simulator: Any = None,
    *,
    progress: Callable[[int, int, str], None] | None = None,
    settings: Settings | Mapping[str, Mapping[str, Any]] | None = None,
    known: Mapping[str, Any] | None = None,
    families: Mapping[str, Sequence[str]] | None = None,
    effects: Sequence[Any] = (),
    seed: int = 0,
    cores: int = 1,
    trust: bool = False,
) -> Diagnosis:
    """Say where recording and simulator differ, which physics is missing, how much of it, and how sure that is.

    It takes 5 to 100 s, half as long with one thread a process (`OMP_NUM_THREADS=1` in the environment) where several
    things run at once. The same recording, simulator, settings and seed give the same answer, as on the command line.

    Args:
        recording: a recording, or the path of one as for `read_recording`; several of one machine, in a list or by
            their names, to judge them together: what they share, and what is each one's own (`result.recordings`).
        simulator: as for `load_simulator`; the recording's own `system` by default.
        progress: called as progress(done, 100, note).
        settings: thresholds, as `{"windows": {"fewest": 6}}` or a `Settings`: docs/reference/settings.md lists them.
        known: what is known of the simulator: `{"fix": {"mass": 1.2}, "bounds": {"length": [0.4, 0.6]}}`.
        families: of effects to ask for: `{"only": [...], "without": [...], "require": [...], "also": [...]}`, each a
            family or `family on place`; `gpsim.effects.FAMILIES` has them all.
        effects: of your own, asked beside the catalogue's: classes, or files as "my_effects.py" or
            "my_effects.py:Cable" (docs/how-to/effect.md).
        seed: of the bootstrap's draws.
        cores: processes to share the work with. More than 1 need a simulator by name or from a file, and, in a
            script, `if __name__ == "__main__":` around it.
        trust: whether a Python file or module that only the recording names may run.

    Returns:
        What was found.

    Raises:
        UsageError: recording and simulator do not go together (channels, units, a clock that does not fit), the
            simulator raises or is not finite where the recording has been, or nothing can be said.

    Example:
        >>> import gpsim
        >>> recording = gpsim.read_recording("slider.csv", "slider")
        >>> diagnosis = gpsim.diagnose(recording)  # doctest: +SKIP
        >>> diagnosis = gpsim.Diagnosis.load("found")
        >>> diagnosis.verdict, [effect.family for effect in diagnosis.effects]
        ('named', ['viscous_friction'])
    """
    model = None if simulator is None else load_simulator(simulator)
    taken, model = opened(recording, model, trust)
    brought = _brought(effects)
    here = [name for name in (model.name, *(b.reference for b in brought)) if lives_here(name)]
    if positive(cores, "cores") > 1 and here:
        raise UsageError(
            f"cores={cores}: {here[0]} exists in this process only; use cores=1, or write it to a file and name it as "
            "FILE.py:ClassName"
        )
    asked = read_known(known, families)
    asked = replace(asked, also=(*asked.also, *bring(brought)))
    given = settings if isinstance(settings, Settings) else read_settings(settings or {})
    question = Question(given, asked, whole(seed, "seed"), cores, progress or silent)
    outcome = answer(taken, model, question)

    from gpsim.api.found import Made

    return Diagnosis(Made(outcome, taken, model, question), taken)


def _brought(given: Sequence[Any]) -> list[Brought]:
    """Effects of the caller's own, and those of installed packages."""
    out = list(installed())
    for one in (given,) if isinstance(given, str) else given:
        if isinstance(one, str | Path):
            consent_to(str(one))
            out += read_effects(str(one))
        else:
            out.append(own_effect(one))
    return out


def _share(effect: NamedEffect) -> float:
    return math.nan if effect.importance is None else effect.importance.share


class Diagnosis:
    """What a recording says about a simulator: `print` it, or end a notebook's cell with it.

    `diagnose` makes one, `Diagnosis.load` opens the folder that `save` or `gpsim diagnose --out` wrote.

    Attributes:
        result: the whole result, typed, as diagnosis.json holds it.
        recording: what was diagnosed, None of a loaded one that was not told.

    Example:
        >>> import gpsim
        >>> diagnosis = gpsim.Diagnosis.load("found")
        >>> print(diagnosis)  # doctest: +ELLIPSIS
        Verdict  named: viscous friction on q explains ...
    """

    def __init__(self, found: Found, recording: Recording | None = None) -> None:
        self._found = found
        self.recording = recording

    @property
    def result(self) -> Result:
        """The whole result."""
        return self._found.result

    @property
    def verdict(self) -> Verdict:
        """`named`, `ambiguous`, `partial`, `unknown` or `none`."""
        return self.result.verdict

    @property
    def effects(self) -> tuple[NamedEffect, ...]:
        """What was found missing: family, where it acts, parameters with 90 % intervals, importance."""
        return self.result.effects

    @property
    def simulator(self) -> Simulator:
        """The base simulator."""
        return self._found.simulator

    @property
    def left_open(self) -> LeftOpen:
        """What it leaves open, in numbers: explanations with their covariances, noise, where the recording has been."""
        return self._found.left_open

    def __str__(self) -> str:
        from gpsim.reports.account_lines import account_lines

        return "\n".join(account_lines(self._account()))

    def __repr__(self) -> str:
        named = ", ".join(f"{effect.family} on {effect.place}" for effect in self.effects)
        return f"<Diagnosis of {self._found.name}: {self.verdict}{f', {named}' if named else ''}>"

    def _repr_html_(self) -> str:
        from gpsim.reports.diagnosis_page import account_fragment, front_of

        pictures = self._found.pictures
        return account_fragment(
            self._account(), [pictures[name] for name in front_of(self.result) if name in pictures]
        )

    def _account(self) -> Any:
        from gpsim.reports.account import account_of

        return account_of(self.result, self._found.place or HERE, self._found.name)

    def to_frame(self) -> pd.DataFrame:
        """The effects as a table, a row a parameter, the most important effect first.

        Returns:
            Columns `role` (headline or slight), `family`, `place`, `parameter`, `unit`, `value`, `low`, `high` (its
            90 % interval, NaN where the data do not determine it) and `share` (of the mismatch, of the whole effect).
            Of several recordings also `recording`, whose own the value is, empty where they share it.

        Example:
            >>> import gpsim
            >>> table = gpsim.Diagnosis.load("found").to_frame()
            >>> list(table.loc[0, ["role", "family", "place", "parameter", "unit"]])
            ['headline', 'viscous_friction', 'q', 'damping', 'N s/m']
        """
        import pandas as pd

        several = self.result.recordings is not None
        rows = list[tuple[object, ...]]()
        for effect in sorted(self.effects, key=lambda e: (e.role != "headline", -_share(e))):
            own = dict(effect.own or {})
            shared = {} if effect.parameters in own.values() else {"": effect.parameters}
            for recording, values in (shared | own).items():
                for name, size in values.items():
                    known = (size.value, size.low, size.high, _share(effect))
                    numbers = [math.nan if number is None else number for number in known]
                    head = (effect.role, effect.family, effect.place, name, size.unit)
                    rows.append((*head, *numbers, *((recording,) if several else ())))
        return pd.DataFrame(rows, columns=[*FRAME, *(("recording",) if several else ())])

    @property
    def plots(self) -> tuple[str, ...]:
        """The names of the pictures that there are: what was found decides."""
        return tuple(self._found.pictures)

    def plot(self, name: str = "held_out_rollout") -> Picture:
        r"""A picture of what was found, which a notebook shows: `title`, `caption` and `png` (bytes).

        Args:
            name: one of `plots`.

        Raises:
            UsageError: no such picture; the message lists them.

        Example:
            >>> import gpsim
            >>> gpsim.Diagnosis.load("found").plot("held_out_rollout").png[:4]
            b'\x89PNG'
        """
        pictures = self._found.pictures
        if name not in pictures:
            raise UsageError(f"no picture '{name}'; there are: {', '.join(pictures) or 'none'}")
        return pictures[name]

    def corrected(self, gp: bool = False) -> CorrectedSimulator:
        """The simulator with what was found, to step, to roll out, and to train in (`make_env`).

        Args:
            gp: whether to add the Gaussian process on what is left, if there is one (`result.remainder.gp`).

        Raises:
            UsageError: a user's simulator that is not there, or has changed since.
        """
        return CorrectedSimulator(self._found.corrected(gp), self.recording)

    def score(self, recording: Recording | str | Path, *, seed: int = 0, cores: int = 1) -> Score:
        """How the effects do on another recording, beside the base; nothing is fitted.

        Args:
            recording: of the same system; a path as for `read_recording`.
            seed: of the bootstrap's draws.
            cores: as for `diagnose`.

        Returns:
            Root mean square errors by rate one step ahead and by channel after `horizon_s` [s], each with `before`,
            `after`, `after_gp` and `over_before`, and how much of the mismatch the effects explain here.

        Raises:
            UsageError: recording and simulator do not go together.

        Example:
            >>> import gpsim
            >>> score = gpsim.Diagnosis.load("found").score("slider.csv")
            >>> score.rollout["q"].after < 0.1 * score.rollout["q"].before
            True
        """
        taken = taken_of(recording, self.simulator)
        plant = self._found.corrected(False)
        process = self.result.remainder.gp
        with_gp = self._found.corrected(True) if process is None or process.used else None
        run = Run(threads=positive(cores, "cores"))
        return score(taken, plant, with_gp, generator(whole(seed, "seed"), "score"), run)

    def save(self, folder: str | Path) -> Path:
        """Write the folder that `gpsim diagnose --out` writes, whole or not at all; returns where it is.

        The command line takes it: `gpsim diagnose NEW --score FOLDER`, `gpsim train-gp-policy diagnosis=FOLDER`.

        Raises:
            UsageError: it exists already, or cannot be written.

        Example:
            >>> import gpsim
            >>> gpsim.Diagnosis.load("found").save("kept").name
            'kept'
        """
        path = Path(folder).resolve()
        if path.exists():
            raise UsageError(
                f"{folder}: exists already; a diagnosis is never overwritten, choose another folder"
            )
        self._found.save(path)
        return path

    @classmethod
    def load(
        cls,
        folder: str | Path,
        simulator: Any = None,
        *,
        recording: Recording | str | Path | None = None,
        trust: bool = False,
    ) -> Diagnosis:
        """A finished diagnosis, made here or by `gpsim diagnose`; its files are verified.

        Args:
            folder: what `save` or `--out` wrote, or runs/<experiment>/diagnose/vNNNN.
            simulator: the base, as for `load_simulator`; needed where it was written in a program that no folder knows.
            recording: what was diagnosed: `make_env` begins episodes there.
            trust: whether a Python file or module that only the folder names may run, as its base simulator.

        Raises:
            UsageError: no diagnosis, a file of it has changed, or it is of another simulator.
        """
        from gpsim.api.found import Kept

        model = None if simulator is None else load_simulator(simulator)
        kept = Kept.read(Path(os.fspath(folder)), model)
        if trust:
            consent(kept.name)
            for origin in (kept.result.brought or {}).values():
                consent_to(origin.reference)
        return cls(kept, None if recording is None else taken_of(recording, model or kept.simulator))
