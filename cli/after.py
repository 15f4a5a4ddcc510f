"""What follows a diagnosis: `gpsim plan` the next recording, `gpsim watch` new ones, `gpsim deploy` a policy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import typer

from gpsim.errors import UsageError

from . import completion
from .answers import NO_LONGER_HOLDS, answer, say, say_all
from .diagnose import Cores
from .options import CORES, DryRun, Out, Setup, option, refuse_unused, say_made, split_words, spread, words_of
from .progress import note

PLAN_USED = ("seed", "plan", "experiment", "runs_dir")
WATCH_USED = ("watch", "experiment", "runs_dir")


@dataclass
class Planned:
    """What is asked beside diagnoses and settings."""

    minutes: float = option(2.0, "--minutes", help="How long the plan may take.")
    anew: bool = option(
        False,
        "--anew",
        help="You put the machine back to rest before each piece, so it need not return by itself.",
    )
    policy: Path | None = option(
        None,
        "--policy",
        metavar="DIR",
        help="A trained policy that controls the machine; the plan is added to its commands.",
        autocompletion=completion.policies,
    )
    out: Out = None
    cores: Cores = None


@dataclass
class PlanSetup(Setup):
    """Diagnoses stand before the settings."""

    words: list[str] | None = words_of(
        "DIAGNOSIS... [KEY=VALUE]...",
        "Folders of finished diagnoses of one machine, then settings, as 'plan.box={q: [-1, 1]}'.",
        completion.diagnoses,
    )


@dataclass
class WatchSetup(Setup):
    """Its settings are few."""

    words: list[str] | None = words_of("[KEY=VALUE]...", "Settings, as watch.stretch=120.", completion.words)


@spread
def plan_command(*, asked: Planned, given: PlanSetup, dry_run: DryRun = False) -> None:
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
    from gpsim.stages.plan import Asked, plan_of, stage_for

    stage = stage_for(diagnoses, Asked(asked.minutes, asked.anew, asked.policy))
    if (made := setup.make(stage, asked.out, dry_run, cores=asked.cores or CORES)) is None:
        return
    artifact, existed = made
    facts = plan_of(artifact)
    say_all(told(facts))
    say_made(artifact, existed)
    answer(paths_of("plan", artifact.path), made=not existed, plan=dict(facts))


@spread
def watch_command(
    *,
    what: Path = typer.Argument(
        metavar="LOG|FOLDER",
        help="A recording, a CSV file that is still being written, or a folder that receives recordings.",
    ),
    diagnosis: Path = typer.Option(
        ..., "--diagnosis", metavar="DIR", help="The account.", autocompletion=completion.diagnoses
    ),
    log: Path | None = typer.Option(
        None,
        "--log",
        help="JSON lines, one object per recording; recordings in it are skipped. Default: LOG|FOLDER.watch.jsonl.",
    ),
    once: bool = typer.Option(
        False, "--once", help="Check the existing recordings and exit, for a CI job or cron."
    ),
    setup: WatchSetup,
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


@spread
def deploy_command(
    *,
    replay: list[Path] | None = typer.Option(
        None,
        "--replay",
        metavar="LOG",
        help="A log of the policy in use, read with collect.mapping, or a recording folder; may be repeated.",
    ),
    setup: Setup,
) -> None:
    """Test the monitor of a safe deployment on recorded drives: when it stops them, and why.

    It predicts each step with the simulator of correction=, and stops when the errors are unusual or a state leaves
    deploy.limits. Nothing is written. Try it on the simulated target with: gpsim evaluate deploy.safe=true
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
