"""The subcommand ``reproduce``: runs a folder again from its record and compares the bytes."""

from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.cli.interrupts import Interrupts
from evoros.cli.reporting import WORST_FIRST, JobResult, explain_end
from evoros.files.origin import read_origin
from evoros.files.resources import expand_home
from evoros.terminal.arguments import CommandParser, require_keys
from evoros.terminal.console import DONE, print_result, report_error, report_errors
from evoros.terminal.log import log_everything

if TYPE_CHECKING:
    from evoros.crate.reproducing import Prepared
    from evoros.session.reproduction import Reproduction
    from evoros.session.work import Work

NAME = "evoros reproduce"
DIFFERENT = 1
"""The exit status of different folders."""
ABOUT = """Runs a run, an evaluation or a sweep again from its record, and compares the bytes.

It prints the versions and machines that are not the same, and whether all missions and files agree,
or the first difference. FOLDER stays unchanged. It may be an archive (evoros archive): NEW then
gets inputs/ and runs/, and the code in inputs/ is run."""
STATUSES = """exit status: 0 all agree, 1 something differs or a mission was lost, 2 it cannot be
run again, 130 interrupted. Folders of others: see docs/run_folder.md before you run their code."""


def reproduce(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status."""
    with Interrupts() as interrupts:
        return report_errors(NAME, lambda: _reproduce(arguments, interrupts), interrupts.explain)


def _reproduce(arguments: Sequence[str], interrupts: Interrupts) -> int:
    from evoros.crate.reproducing import prepare
    from evoros.session.diff import describe_diff
    from evoros.session.reproduction import describe_circumstances, list_reproductions

    options = _parser().parse_intermixed_args(list(arguments))
    require_keys(options.overrides, options.folder)
    own_parts = options.config_dir and expand_home(options.config_dir).absolute()
    given = expand_home(options.folder), expand_home(options.output)
    with prepare(*given, own_parts) as prepared:
        reproductions = list_reproductions(prepared.source, prepared.output)
        status = _run_all(prepared, reproductions, options.overrides, interrupts)
        if status != DONE:
            return status
        print_result(describe_circumstances(reproductions))
        diff = prepared.compare()
    print_result(describe_diff(diff).splitlines()[0])
    return DIFFERENT if diff.difference else DONE


def _run_all(
    prepared: "Prepared",
    reproductions: "Sequence[Reproduction]",
    overrides: Sequence[str],
    interrupts: Interrupts,
) -> int:
    """Run all again in one pool; returns the worst exit status."""
    from evoros.cli.sweep import Sweep
    from evoros.cli.sweeping import begin_all
    from evoros.config.jobs import Job
    from evoros.session.progress import SweepProgress
    from evoros.session.reproduction import build_reproduction

    by_folder = {reproduction.folder: reproduction for reproduction in reproductions}
    jobs = [Job(reproduction.config, folder) for folder, reproduction in by_folder.items()]
    own_parts = None if prepared.config_dir is None else str(prepared.config_dir)

    def build(job: Job) -> "Work":
        reproduction = by_folder[job.folder]
        places = prepared.relocation(reproduction.source)
        return build_reproduction(reproduction, overrides, own_parts, places)

    with log_everything(), SweepProgress(len(jobs)) as display:
        sweep = Sweep(build, partial(explain_end, own_parts, interrupts), _report, display)
        begin_all(NAME, jobs, sweep, interrupts)
    ended = [result.status for _, result in sweep.results]
    if interrupts.last is not None:
        ended.append(interrupts.explain()[1])
    return next(status for status in WORST_FIRST if status in ended)


def _report(folder: Path, result: JobResult) -> None:
    if result.message:
        report_error(NAME, f"{folder}: {result.message}", result.status)


def _parser() -> ArgumentParser:
    parser = CommandParser(
        NAME, description=ABOUT, epilog=STATUSES, formatter_class=RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "folder", metavar="FOLDER", help="of a run, an evaluation or a sweep, or an archive"
    )
    parser.add_argument(
        "overrides", nargs="*", metavar="executor.KEY=VALUE", help="another executor"
    )
    parser.add_argument(
        "--output",
        metavar="NEW",
        default=f"outputs/{datetime.now():%Y-%m-%d_%H-%M-%S}_reproduced",
        help="where it runs again; one that was interrupted goes on (default: outputs/DATE...)",
    )
    parser.add_argument("--config-dir", metavar="DIR", help="folder of your own parts")
    parser.add_argument("--version", action="version", version=f"{NAME} {read_origin().version}")
    return parser
