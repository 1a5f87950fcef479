"""The errors that a user reads."""


class EvorosError(Exception):
    """Base of all errors that are meant to be read by the user."""


class InputError(EvorosError):
    """A configuration value or file that cannot be used. Exit status 2.

    The message is one line: which file or key, the rule, the value, the fix.
    """


class SimulationError(EvorosError):
    """The simulation itself failed (a state that is not finite). It recurs deterministically."""


class WorkerLost(EvorosError):
    """A call crashed its worker process or ran past its time limit, despite all retries."""


class PilotLost(WorkerLost):
    """A program beside this process ended or did not answer; the mission may be repeated.

    It is a controller, or the server of an engine. ``log`` is the end of what it printed.
    """

    def __init__(self, message: str, log: str = "") -> None:
        super().__init__(message, log)
        self.log = log

    def __str__(self) -> str:
        return str(self.args[0])


class LaunchError(InputError):
    """A controller or an engine outside of this process cannot be started, whatever the design."""


class RunStopped(EvorosError):
    """The run stopped before its end and can be resumed. Exit status 1."""


def single_line(message: object) -> str:
    """Return the text of an error or another object with all whitespace as single spaces."""
    return " ".join(str(message).split())
