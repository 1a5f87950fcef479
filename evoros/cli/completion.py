"""Shell completion: subcommands, figures and options; Hydra completes overrides.

``eval "$(evoros -sc install=bash)"`` installs it, as with every program that uses Hydra.
"""

import os

from evoros.cli.subcommands import FIGURES, SUBCOMMANDS
from evoros.config.help import show
from evoros.terminal.console import DONE, print_result, report_errors

LINE = "COMP_LINE"
"""The environment variable in which a shell passes the line so far."""


def complete(query: str) -> int:
    """Print the words that can follow the line so far, and return the exit status.

    ``query`` is the shell's question, such as ``query=bash``.
    """
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
    """Return the figures if one is to come next, otherwise the subcommand's options."""
    from evoros.analysis import subcommands as analysis

    if subcommand == FIGURES and position == 2:  # the subcommand itself is the first word
        return list(analysis.SUBCOMMANDS)
    return list(SUBCOMMANDS[subcommand].options)
