"""Arguments, exit statuses and printed results of all commands."""

import os
import signal
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Sequence
from functools import wraps
from itertools import takewhile
from typing import Any, NoReturn

from evoros.base import errors
from evoros.terminal.log import LOGGER, escape_control, log_to_terminal, silence, silence_unwritable

# Exit statuses:
DONE, STOPPED, INPUT, INTERRUPTED = 0, 1, 2, 130  # STOPPED: resumable run; INPUT: unusable input
NOT_MET, NOT_DECIDED = 3, 4  # evaluations with a violated or an undecided requirement
DIFFERENT = 1  # the compared folders, missions or rows are different
Command = Callable[[Sequence[str]], int]  # runs a command; returns the exit status


def run_main(command: Command) -> NoReturn:
    """Run a command with the arguments of this process, and exit with its status."""
    _open_standard_streams()
    try:
        status = command(sys.argv[1:])
    except KeyboardInterrupt:
        status = INTERRUPTED  # a second Ctrl-C during the report of the first
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # exit waits for threads and workers
    silence_unwritable()  # a flush that fails at exit changes the status
    sys.exit(status)


def explain_interrupt() -> tuple[str, int]:
    """Return the message and the exit status for Ctrl-C."""
    return "interrupted", INTERRUPTED


def report_errors(
    name: str, run: Callable[[], int], explain: Callable[[], tuple[str, int]] = explain_interrupt
) -> int:
    """Run a command and return its exit status; report errors, and Ctrl-C as in ``explain``."""
    with log_to_terminal():
        try:
            return run()
        except SystemExit as ended:  # raised for --help and --version
            return int(ended.code or DONE)
        except KeyboardInterrupt:
            return report_error(name, *explain())
        except errors.EvorosError as error:
            return report_error(name, str(error), status_of(error))
        except (OSError, RuntimeError) as error:
            explanation = errors.explain_path(error)
            if not explanation:
                raise
            return report_error(name, explanation, INPUT)


def reports_errors(name: str) -> Callable[[Command], Command]:
    """Return a decorator that runs a command in ``report_errors``."""

    def decorate(run: Command) -> Command:
        return wraps(run)(lambda arguments: report_errors(name, lambda: run(arguments)))

    return decorate


def report_error(name: str, message: str, status: int) -> int:
    """Log the error that ended a command or job as one line; return ``status``."""
    LOGGER.error("%s: %s", name, errors.single_line(message))
    return status


def status_of(error: errors.EvorosError) -> int:
    """Return the exit status for an error."""
    return INPUT if isinstance(error, errors.InputError) else STOPPED


def print_result(text: str) -> None:
    """Print to standard output; ignore a closed pipe, and report other failures."""
    try:
        print(escape_control(text), flush=True)
    except OSError as error:
        if not isinstance(error, BrokenPipeError):
            LOGGER.error(
                "cannot write to standard output (%s); free some space, or redirect the output",
                error.strerror,
            )
        silence(sys.stdout)


def _open_standard_streams() -> None:
    """Open closed standard streams on the null device."""
    # C libraries would otherwise print into the files that are opened next.
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.dup2(os.open(os.devnull, os.O_RDWR), descriptor)
        if getattr(sys, name) is None:
            mode = "w" if descriptor else "r"
            setattr(sys, name, open(descriptor, mode, closefd=False))  # noqa: SIM115 - stays open


class CommandParser(ArgumentParser):
    """A parser that raises InputErrors, which commands report in one line."""

    def __init__(self, prog: str, **settings: Any) -> None:
        super().__init__(prog, **{"formatter_class": RawDescriptionHelpFormatter, **settings})

    def error(self, message: str) -> NoReturn:
        """Raise an InputError with the parser's message."""
        raise errors.InputError(f"{message}; see {self.prog} --help")

    def parse(self, words: Sequence[str]) -> Namespace:
        """Parse the arguments of a command; suggest quotes for a path with spaces."""
        options, rest = self.parse_known_args(list(words))
        if rest:
            before = words[: words.index(rest[0])][-1:]
            split = before and not any(word.startswith("-") for word in (*before, *rest))
            advice = f"; {_advise_quotes(*before, *rest)}" if split else ""
            self.error(f"unexpected argument {rest[0]}{advice}")
        return options


def require_keys(words: Sequence[str], before: str) -> None:
    """Require that words are ``key=value`` or ``~key``; ``before`` precedes them."""
    for i, word in enumerate(words):
        if not _stands_alone(word):
            before = word
            continue
        rest = takewhile(_stands_alone, words[i:])
        raise errors.InputError(f"{word!r}: must be key=value; {_advise_quotes(before, *rest)}")


def _stands_alone(word: str) -> bool:
    return "=" not in word and not word.startswith("~")


def _advise_quotes(before: str, *rest: str) -> str:
    key, equals, value = before.partition("=")
    if not equals:
        return f"a path with a space needs quotes: {errors.shell_line(' '.join((before, *rest)))}"
    whole = " ".join(filter(None, (value, *rest)))
    advice = "a value with a space needs quotes:" if " " in whole else "type"
    return f"{advice} {errors.shell_line(errors.override(key, whole))}"
