"""The subcommand ``export``: sends recorded runs to a tracker."""

from collections.abc import Sequence
from pathlib import Path

from evoros.base.errors import InputError, write_count
from evoros.files.resources import expand_home
from evoros.terminal import console
from evoros.terminal.log import warn_left_out

NAME = "evoros export"
ABOUT = """Send recorded runs to a tracker; data that the tracker already has is not sent again.

TRACKER is a choice from the group observers, such as mlflow; set its keys with KEY=VALUE."""


@console.reports_errors(NAME)
def export(arguments: Sequence[str]) -> int:
    """Run the subcommand and return its exit status."""
    from evoros.config.compose import build_observer
    from evoros.session.observation import describe, export

    parser = console.CommandParser(NAME, description=ABOUT)
    parser.add_argument("tracker", metavar="TRACKER")
    parser.add_argument(
        "words", nargs="+", metavar="FOLDER", help="folder of a run or a sweep, or KEY=VALUE"
    )
    parser.add_argument("--config-dir", "-cd", metavar="FOLDER", help="folder with your own parts")
    options = parser.parse_intermixed_args(list(arguments))
    folders = [word for word in options.words if "=" not in word or Path(word).is_dir()]
    typed = [word for word in options.words if word not in folders]
    runs = [run for folder in folders for run in _list_runs(expand_home(folder))]
    if not runs:
        raise InputError("FOLDER is missing; give the folder of a run or a sweep")
    observer = build_observer(options.tracker, typed, options.config_dir)
    observer.check()
    for folder in runs:
        try:
            run = export(folder, observer, Path.cwd())
        except InputError:
            raise
        except Exception as error:  # a library may raise any exception
            return console.report_error(
                NAME, f"{options.tracker}: {describe(error)}", console.STOPPED
            )
        state = "unfinished" if run.end is None else run.end.state
        console.print_result(
            f"{folder}: {write_count(len(run.generations), 'generation')}, {state}"
        )
    return console.DONE


def _list_runs(folder: Path) -> list[Path]:
    from evoros.storage.layout import evaluates, folders_below

    below = folders_below(folder, warn_left_out)
    return [path for path in below if not evaluates(path)] or [folder]
