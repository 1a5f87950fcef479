"""The subcommand ``watch``: a page in the browser that follows runs until Ctrl-C."""

import sys
from argparse import Namespace
from collections.abc import Sequence

from evoros.base.errors import InputError
from evoros.terminal.arguments import CommandParser
from evoros.terminal.console import reports_errors
from evoros.watch.aside import run_aside

NAME = "evoros watch"
ABOUT = """Shows runs, evaluations and sweeps on a page in the browser, and follows them. It only
reads. The address that it prints is for this machine and holds a secret; Ctrl-C ends it."""
LAST_PORT = 65535


@reports_errors(NAME)
def watch(arguments: Sequence[str]) -> int:
    """Serve the page until Ctrl-C."""
    parse(arguments)
    return run_aside([sys.executable, "-m", "evoros.watch.serving", *arguments])


def parse(arguments: Sequence[str]) -> Namespace:
    """Parse the arguments of the command."""
    options = _parser().parse(arguments)
    if not 0 <= options.port <= LAST_PORT:
        raise InputError(
            f"--port: must be from 1 to {LAST_PORT}, not {options.port}; choose another, or leave "
            f"it out"
        )
    return options


def _parser() -> CommandParser:
    parser = CommandParser(NAME, description=ABOUT)
    about = "of a run, an evaluation or a sweep, or one that is to come"
    parser.add_argument("folders", nargs="+", metavar="FOLDER", help=about)
    about = "of the page; by default any that is free"
    parser.add_argument("--port", type=int, default=0, metavar="N", help=about)
    return parser
