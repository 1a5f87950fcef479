"""The errors that a user reads."""


class EvorosError(Exception):
    """Base of all errors that are meant to be read by the user."""


class InputError(EvorosError):
    """A configuration value or file that cannot be used. Exit status 2.

    The message is one line: which file or key, the rule, the value, the cure.
    """


class SimulationError(EvorosError):
    """The simulation itself failed (a state that is not finite). It recurs deterministically."""


class WorkerLost(EvorosError):
    """A call crashed its worker process or ran past its time limit, in spite of all retries."""


class RunStopped(EvorosError):
    """The run stopped before its end and can be resumed. Exit status 1."""


def single_line(message: object) -> str:
    """Return the text of an error or another object with all whitespace as single spaces."""
    return " ".join(str(message).split())
