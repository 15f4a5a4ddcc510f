"""The exceptions that end a command: bad input, in one line, and being asked to end."""

import signal


class UsageError(Exception):
    """Bad input: the message is one line that says what is wrong, where, and what to do.

    The command line turns it into `error: <message>` and exit code 2, without a traceback. Names in it are from files:
    line breaks in them become blanks, other control characters `?`.
    """

    def __str__(self) -> str:
        line = " ".join(super().__str__().splitlines())
        return line if line.isprintable() else "".join(c if c.isprintable() else "?" for c in line)


class NoDiagnosis(UsageError):  # noqa: N818  # what happened is no error of the recording's
    """A sound recording of which no diagnosis is possible: too short, or nothing moves in it.

    The command line ends with exit code 3: nothing is to be corrected, another recording is to be made.
    """


CODE = 128 + signal.SIGTERM
"""The exit code of a process that ended because it was asked to."""


class Terminated(SystemExit):
    """The process is asked to end: it cleans up as after Ctrl-C."""

    def __init__(self) -> None:
        super().__init__(CODE)
