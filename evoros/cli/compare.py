"""The command ``evoros-compare``: tells whether two runs are equal, or their first difference."""

from collections.abc import Sequence

from evoros.base.console import DONE, INPUT, INTERRUPTED, print_result, run_main
from evoros.base.errors import EvorosError, InputError, single_line
from evoros.base.log import LOGGER, log_to_terminal
from evoros.base.origin import read_origin
from evoros.base.resources import expand_home

NAME = "evoros-compare"
DIFFERENT = 1
"""Exit status."""
USAGE = f"""{NAME} tells whether two runs or evaluations are equal, or their first difference.

{NAME} A B

A and B are folders of runs or evaluations, or of sweeps, whose jobs are compared by their paths.
What is compared is all that follows from the configuration: missions, generations, champion,
trajectories, figures that both have. Executors, logs, status, dates and machines may differ.
Exit status: 0 equal, 1 different, 2 for what cannot be compared.
evoros-analyze compare is another command: it compares treatments, with tests and effect sizes."""


def main() -> None:
    """Entry point of the console script."""
    run_main(evoros_compare)


def evoros_compare(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status."""
    if not arguments or {"-h", "--help"} & set(arguments):
        print_result(USAGE)
        return DONE if arguments else INPUT
    if "--version" in arguments:
        print_result(f"{NAME} {read_origin().version}")
        return DONE
    with log_to_terminal():
        try:
            return _compare(arguments)
        except KeyboardInterrupt:
            LOGGER.error("%s: interrupted", NAME)
            return INTERRUPTED
        except EvorosError as error:
            LOGGER.error("%s: %s", NAME, single_line(error))
            return INPUT


def _compare(arguments: Sequence[str]) -> int:
    from evoros.session.comparison import compare, describe

    if len(arguments) != 2:
        raise InputError(f"two folders must be given, not {len(arguments)}; type: {NAME} A B")
    comparison = compare(*(expand_home(name) for name in arguments))
    print_result(describe(comparison))
    return DIFFERENT if comparison.difference else DONE
