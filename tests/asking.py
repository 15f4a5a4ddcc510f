"""What a stage is asked for, as the command line asks it."""

from gpsim.cli.configuration import resolve

from gpsim.stages.stage import Request


def asked(*words: str) -> Request:
    """The configuration that these words select."""
    return Request(resolve(list(words), None), words)
