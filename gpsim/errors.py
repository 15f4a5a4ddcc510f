"""The one exception whose message is meant for the person at the terminal."""


class UsageError(Exception):
    """Bad input: the message is one line that says what is wrong, where, and what to do.

    The command line turns it into `error: <message>` and exit code 2, without a traceback.
    """
