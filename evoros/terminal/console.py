"""Exit statuses and printed results of every command."""

import os
import signal
import sys
from collections.abc import Callable, Sequence
from functools import wraps
from typing import NoReturn

from evoros.base.errors import EvorosError, InputError, single_line
from evoros.terminal.log import LOGGER, escape_control, log_to_terminal
from evoros.terminal.unwritable import silence, silence_unwritable

DONE, STOPPED, INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit statuses: done; stopped and resumable; unusable input; interrupted."""
NOT_MET, NOT_DECIDED = 3, 4
"""Exit statuses of evaluations that are done: a requirement is violated, or undecided."""
Command = Callable[[Sequence[str]], int]
"""Runs a command with its arguments and returns its exit status."""


def run_main(command: Command) -> NoReturn:
    """Run a command with the arguments of this process, and exit with the status it returns."""
    _open_standard_streams()
    try:
        status = command(sys.argv[1:])
    except KeyboardInterrupt:
        status = INTERRUPTED  # a second Ctrl-C, while the command reported the first
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the exit joins threads and workers
    silence_unwritable()  # Python would try again as it exits, and change the exit status
    sys.exit(status)


def explain_interrupt() -> tuple[str, int]:
    """Return the message and the exit status of Ctrl-C."""
    return "interrupted", INTERRUPTED


def report_errors(
    name: str, run: Callable[[], int], explain: Callable[[], tuple[str, int]] = explain_interrupt
) -> int:
    """Do the work of a command and return its exit status; report an error in one line.

    ``explain`` returns the message and the status of a KeyboardInterrupt.
    """
    with log_to_terminal():
        try:
            return run()
        except SystemExit as ended:  # --help and --version
            return int(ended.code or DONE)
        except KeyboardInterrupt:
            return report_error(name, *explain())
        except EvorosError as error:
            return report_error(name, str(error), status_of(error))


def reports_errors(name: str) -> Callable[[Command], Command]:
    """Return a decorator for the function of a command whose errors ``report_errors`` reports."""

    def decorate(run: Command) -> Command:
        return wraps(run)(lambda arguments: report_errors(name, lambda: run(arguments)))

    return decorate


def report_error(name: str, message: str, status: int) -> int:
    """Report in one line why a command or a job ended, and return the exit status."""
    LOGGER.error("%s: %s", name, single_line(message))
    return status


def status_of(error: EvorosError) -> int:
    """Return the exit status of an error."""
    return INPUT if isinstance(error, InputError) else STOPPED


def print_result(text: str) -> None:
    """Print to standard output.

    A reader that has closed the pipe early is no error. A failure to write, as on a full disk, is
    reported once; the results of a command are not lost with it.
    """
    try:
        print(escape_control(text), flush=True)
    except OSError as error:
        if not isinstance(error, BrokenPipeError):
            LOGGER.error(
                "standard output: cannot be written (%s); free some space, or direct it elsewhere",
                error.strerror,
            )
        silence(sys.stdout)


def _open_standard_streams() -> None:
    """Open closed standard streams on the null device.

    Otherwise the next files that are opened take their numbers, and libraries of C, which print to
    these, write into a table.
    """
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.dup2(os.open(os.devnull, os.O_RDWR), descriptor)
        if getattr(sys, name) is None:
            mode = "w" if descriptor else "r"
            setattr(sys, name, open(descriptor, mode, closefd=False))  # noqa: SIM115 - it stays open
