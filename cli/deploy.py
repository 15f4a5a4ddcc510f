"""`gpsim deploy --replay`: what the monitor of a safe deployment would have made of recorded drives."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gpsim.errors import UsageError

from .answers import answer
from .options import ConfigDir, ShowConfig, Words, configured, shown_words
from .printing import say

Replay = Annotated[
    list[Path] | None,
    typer.Option(
        "--replay",
        metavar="LOG",
        help="A log of the policy at work, read by collect.mapping, or a recording's folder; may be given again.",
    ),
]


def deploy_command(
    words: Words = None, replay: Replay = None, config_dir: ConfigDir = None, show_config: ShowConfig = False
) -> None:
    """Watch recorded drives as the monitor of a safe deployment would have: when it stops them, and why.

    It predicts each step with the simulator that correction= says, and stops where the errors are no longer usual, or
    a state leaves deploy.limits. Nothing is written. Try it on the stand-in with: gpsim evaluate deploy.safe=true
    """
    config = configured(words, config_dir, show_config)
    if not replay:
        raise UsageError(
            "deploy: give --replay LOG to watch a recorded drive, or try the monitor on the stand-in with: "
            "gpsim evaluate deploy.safe=true"
        )
    # Imported here: what reads logs takes seconds to load, and `--help` should not wait for it.
    from gpsim.stages.evaluate_deployed import replay as replayed
    from gpsim.stages.evaluate_deployed import replay_lines
    from gpsim.stages.stage import Request

    found = replayed(Request(config, shown_words(words, config_dir)), replay)
    for line in replay_lines(found):
        say(line)
    answer(**found)
