"""The subcommand ``diff``: tells whether two runs are equal, or their first difference."""

from argparse import RawDescriptionHelpFormatter
from collections.abc import Sequence

from evoros.files.origin import read_origin
from evoros.terminal.arguments import CommandParser
from evoros.terminal.console import DONE, print_result, reports_errors

NAME = "evoros diff"
DIFFERENT = 1
"""The exit status of different folders."""
ABOUT = f"""{NAME} tells whether two runs or evaluations are equal, or their first difference.

A and B are folders of runs or evaluations, or of sweeps, whose jobs are compared by their paths,
or archives of such.
It compares all that follows from the configuration: missions, generations, champion,
trajectories, figures that both have. Executors, logs, status, dates and machines may differ.
Exit status: 0 equal, 1 different, 2 for folders that cannot be compared.
evoros analyze compare is another command: it compares treatments, with tests and effect sizes."""


@reports_errors(NAME)
def diff(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status."""
    from evoros.session.diff import describe_diff, diff_runs
    from evoros.storage.archives import open_folder

    parser = CommandParser(NAME, description=ABOUT, formatter_class=RawDescriptionHelpFormatter)
    for name in ("A", "B"):
        parser.add_argument(name)
    parser.add_argument("--version", action="version", version=f"{NAME} {read_origin().version}")
    options = parser.parse(arguments)
    comparison = diff_runs(open_folder(options.A), open_folder(options.B))
    print_result(describe_diff(comparison))
    return DIFFERENT if comparison.difference else DONE
