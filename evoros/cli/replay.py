"""The subcommand ``replay``: reruns one recorded mission."""

from collections.abc import Sequence

from evoros.files.resources import expand_home
from evoros.terminal import console

NAME = "evoros replay"
ABOUT = f"""Rerun one recorded mission of a run or an evaluation, and print the outcome.

Give enough columns of missions.csv to select a single row, for example:
  {NAME} outputs/tested design=12 world=maze trial=3 --output mission.csv
Exit status: 0 if the outcome is as recorded, 1 if it differs, 2 for unusable input."""


@console.reports_errors(NAME)
def replay(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status."""
    from evoros.session.replay import replay_row, write_trajectory
    from evoros.storage.tables import (
        are_recorded,
        cell,
        list_further_of,
        name_outcome_columns,
        outcome_cells,
    )

    parser = console.CommandParser(NAME, description=ABOUT)
    parser.add_argument("folder", metavar="FOLDER")
    parser.add_argument("columns", nargs="*", metavar="column=value", help="a cell of missions.csv")
    parser.add_argument(
        "--output", type=expand_home, metavar="FILE", help="CSV file for the trajectory"
    )
    parser.add_argument("--config-dir", "-cd", metavar="FOLDER", help="folder with your own parts")
    options = parser.parse_intermixed_args(list(arguments))
    console.require_keys(options.columns, options.folder)
    columns = dict(text.split("=", 1) for text in options.columns)
    replayed = replay_row(options.folder, columns, options.config_dir)
    if options.output is not None:
        write_trajectory(options.output, replayed.trajectory)
    outcomes, agents = replayed.outcomes, replayed.agents
    parts = any(outcome.failed_parts for outcome in outcomes)
    further = list_further_of(parts, outcomes)
    names, cells = name_outcome_columns(agents, further), outcome_cells(outcomes, further)
    for name, value in zip(names, cells, strict=True):
        console.print_result(f"{name:28}{cell(value)}".rstrip())
    if are_recorded(outcomes, replayed.recorded, agents):
        return console.DONE
    console.print_result("outcome                     differs from the recorded one")
    return console.DIFFERENT
