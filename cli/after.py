"""What follows a diagnosis: `gpsim plan` the next recording, `gpsim watch` new ones, `gpsim deploy` a policy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from gpsim.errors import UsageError

from . import completion
from .answers import NO_LONGER_HOLDS, answer, say, say_all
from .diagnose import Cores
from .options import CORES, DryRun, Out, Setup, refuse_unused, say_made, split_words, spread
from .progress import note

DiagnosisWords = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="DIAGNOSIS... [KEY=VALUE]...",
        help="Folders of finished diagnoses of one machine, then settings, as 'plan.box={q: [-1, 1]}'.",
        autocompletion=completion.diagnoses,
    ),
]
Minutes = Annotated[float, typer.Option("--minutes", help="How long the plan may take.")]
Anew = Annotated[
    bool,
    typer.Option(
        "--anew", help="You put the machine back to rest before each piece, so it need not return by itself."
    ),
]
Policy = Annotated[
    Path | None,
    typer.Option(
        "--policy",
        metavar="DIR",
        help="A trained policy that controls the machine; the plan is added to its commands.",
        autocompletion=completion.policies,
    ),
]
PLAN_USED = ("seed", "plan", "experiment", "runs_dir")


@dataclass
class PlanSetup(Setup):
    """Diagnoses stand before the settings."""

    words: DiagnosisWords = None


@spread
def plan_command(
    *,
    minutes: Minutes = 2.0,
    anew: Anew = False,
    policy: Policy = None,
    out: Out = None,
    cores: Cores = None,
    given: PlanSetup,
    dry_run: DryRun = False,
) -> None:
    """Plan the next recording: safe commands for which the explanations of a diagnosis differ most."""
    diagnoses, settings = split_words(given.words or [])
    refuse_unused("plan", settings, PLAN_USED)
    setup = replace(given, words=settings)
    setup.request()
    if not diagnoses:
        raise UsageError("plan: name the DIAGNOSIS to plan for, as: gpsim plan found --minutes 2")
    # Imported here: scipy and matplotlib take seconds to load, and `--help` should not wait for it.
    from gpsim.reports.plan_page import told
    from gpsim.stages.figures import paths_of
    from gpsim.stages.plan import plan_of, stage_for

    made = setup.make(stage_for(diagnoses, minutes, anew, policy), out, dry_run, cores=cores or CORES)
    if made is None:
        return
    artifact, existed = made
    facts = plan_of(artifact)
    say_all(told(facts))
    say_made(artifact, existed)
    answer(paths_of("plan", artifact.path), made=not existed, plan=dict(facts))


What = Annotated[
    Path,
    typer.Argument(
        metavar="LOG|FOLDER",
        help="A recording, a CSV file that is still being written, or a folder that receives recordings.",
    ),
]
WatchWords = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[KEY=VALUE]...", help="Settings, as watch.stretch=120.", autocompletion=completion.words
    ),
]
DiagnosisDir = Annotated[
    Path, typer.Option("--diagnosis", metavar="DIR", help="The account.", autocompletion=completion.diagnoses)
]
Log = Annotated[
    Path | None,
    typer.Option(
        "--log",
        help="JSON lines, one object per recording; recordings in it are skipped. Default: LOG|FOLDER.watch.jsonl.",
    ),
]
Once = Annotated[
    bool, typer.Option("--once", help="Check the existing recordings and exit, for a CI job or cron.")
]
WATCH_USED = ("watch", "experiment", "runs_dir")


@dataclass
class WatchSetup(Setup):
    """Its settings are few."""

    words: WatchWords = None


@spread
def watch_command(
    *, what: What, diagnosis: DiagnosisDir, log: Log = None, once: Once = False, setup: WatchSetup
) -> None:
    """Check whether an account still holds for every new recording; exit code 4 if it does not."""
    refuse_unused("watch", setup.words or [], WATCH_USED)
    config = setup.config
    # Imported here: scipy takes a second to load, and `--help` should not wait for it.
    from gpsim.stages.watch import watch_of, watched

    watch = watch_of(diagnosis, what, log, config["watch"])
    note(f"watch: {watch.log}")
    found = []
    for said in watched(watch, once):
        say(said.line)
        found.append({k: v for k, v in said.to_dict().items() if k != "sums"})
    answer({"log": watch.log, "diagnosis": diagnosis}, holds=watch.holds, recordings=found)
    if not watch.holds:
        say(f"the account no longer holds: diagnose again, and start a new log ({watch.log})")
        raise typer.Exit(NO_LONGER_HOLDS)


Replay = Annotated[
    list[Path] | None,
    typer.Option(
        "--replay",
        metavar="LOG",
        help="A log of the policy in use, read with collect.mapping, or a recording folder; may be repeated.",
    ),
]


@spread
def deploy_command(*, replay: Replay = None, setup: Setup) -> None:
    """Test the monitor of a safe deployment on recorded drives: when it stops them, and why.

    It predicts each step with the simulator of correction=, and stops when the errors are unusual or a state leaves
    deploy.limits. Nothing is written. Try it on the stand-in with: gpsim evaluate deploy.safe=true
    """
    request = setup.request()
    if not replay:
        raise UsageError(
            "deploy: give --replay LOG to watch a recorded drive, or try the monitor in simulation with: gpsim "
            "evaluate deploy.safe=true"
        )
    # Imported here: what reads logs takes seconds to load, and `--help` should not wait for it.
    from gpsim.stages import evaluate_deployed

    found = evaluate_deployed.replay(request, replay)
    say_all(evaluate_deployed.replay_lines(found))
    answer(**found)
