"""The subcommand ``diff``: reports the first difference between two runs, or their equality."""

from collections.abc import Sequence

from evoros.files.origin import read_origin
from evoros.terminal.console import DIFFERENT, DONE, CommandParser, print_result, reports_errors

NAME = "evoros diff"
ABOUT = """Report whether two runs are equal and, if not, their first difference.

A and B are folders or archives of runs, evaluations or sweeps. Jobs of sweeps are matched by path.
Everything that follows from the configuration is compared: missions, generations, champion,
trajectories, and figures that both have. Executors, logs, status, dates and machines may differ.
Exit status: 0 if equal, 1 if different, 2 if the folders cannot be compared.
To compare treatments statistically, use evoros analyze compare."""


@reports_errors(NAME)
def diff(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status."""
    from evoros.session.diff import describe_diff, diff_runs
    from evoros.storage.archives import open_folder

    parser = CommandParser(NAME, description=ABOUT)
    for name in ("A", "B"):
        parser.add_argument(name)
    parser.add_argument("--version", action="version", version=f"{NAME} {read_origin().version}")
    options = parser.parse(arguments)
    comparison = diff_runs(open_folder(options.A), open_folder(options.B))
    print_result(describe_diff(comparison))
    return DIFFERENT if comparison.difference else DONE
