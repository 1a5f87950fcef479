"""The command ``evoros``: evolves, or passes its arguments on to the subcommand named first."""

from collections.abc import Sequence
from functools import partial

from evoros.cli.run import run
from evoros.cli.subcommands import SUBCOMMANDS, find_misuse
from evoros.terminal.console import INPUT, report_error, run_main
from evoros.terminal.log import log_to_terminal

COMPLETIONS = ("-sc", "--shell-completion")


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
        from evoros.cli.completion import complete

        return complete(others[0])
    return run(arguments)


main = partial(run_main, evoros)
