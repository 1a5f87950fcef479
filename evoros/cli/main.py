"""The command ``evoros``: runs a search, or the subcommand named by the first argument."""

import os
from collections.abc import Sequence
from functools import partial

from evoros.cli.command import run
from evoros.cli.subcommands import FIGURES, SUBCOMMANDS, find_misuse
from evoros.terminal.console import DONE, INPUT, print_result, report_error, report_errors, run_main
from evoros.terminal.log import log_to_terminal

COMPLETIONS = ("-sc", "--shell-completion")
LINE = "COMP_LINE"  # environment variable that holds the line typed so far


def evoros(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status."""
    misuse = find_misuse(arguments)
    if misuse:
        with log_to_terminal():
            return report_error("evoros", misuse, INPUT)
    word, *others = arguments or [""]
    if word in SUBCOMMANDS:
        return SUBCOMMANDS[word].load()(others)
    if word in COMPLETIONS and others[:1] and others[0].startswith("query="):
        return complete(others[0])
    return run(arguments)


def complete(query: str) -> int:
    """Print completions of the typed line for a query such as ``query=bash``."""
    from evoros.config.help import show

    typed = os.environ.get(LINE, "").split()[1:]
    ended = os.environ.get(LINE, "").endswith(" ")
    first = typed[0] if typed else ""
    chosen = first in SUBCOMMANDS and (ended or len(typed) > 1)
    if not chosen:
        print_result(" ".join(name for name in SUBCOMMANDS if name.startswith(first)))
    elif first != "evaluate":
        print_result(" ".join(_list_words(first, len(typed) + ended)))
        return DONE
    else:
        os.environ[LINE] = os.environ[LINE].replace(f" {first}", "", 1)
    primary = "evaluate" if chosen else "config"
    return report_errors("evoros", lambda: show("evoros", primary, ["-sc", query]))


def _list_words(subcommand: str, position: int) -> list[str]:
    from evoros.analysis import subcommands as analysis

    if subcommand == FIGURES and position == 2:  # the first argument is a figure's subcommand
        return list(analysis.SUBCOMMANDS)
    return list(SUBCOMMANDS[subcommand].options)


main = partial(run_main, evoros)
