"""The subcommand ``reproduce``, which reruns recorded runs and compares all bytes."""

from argparse import ArgumentParser
from collections.abc import Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.cli.reporting import WORST_FIRST, Interrupts, JobResult, explain_end
from evoros.files.origin import read_origin
from evoros.files.resources import expand_home
from evoros.terminal import console
from evoros.terminal.log import log_everything

if TYPE_CHECKING:
    from evoros.plugins.archives.reproducing import Prepared
    from evoros.session.reproduction import Reproduction
    from evoros.session.run import Session

NAME = "evoros reproduce"
ABOUT = """Repeat a run, an evaluation or a sweep from its record, and compare all bytes.

The output lists differences between versions and machines, and then reports that all missions
and files agree, or the first difference. FOLDER stays unchanged. If FOLDER is an archive (from
evoros archive), inputs/ and runs/ are created in NEW, and the code in inputs/ is run."""
STATUSES = """exit status: 0 if everything agrees, 1 if something differs or a mission was lost,
2 if FOLDER cannot be rerun, 130 if interrupted. Read docs/run_folder.md before you run the code
in somebody else's folder."""


def reproduce(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status."""
    with Interrupts() as interrupts:
        return console.report_errors(
            NAME, lambda: _reproduce(arguments, interrupts), interrupts.explain
        )


def _reproduce(arguments: Sequence[str], interrupts: Interrupts) -> int:
    from evoros.plugins.archives.reproducing import prepare
    from evoros.session.diff import describe_diff
    from evoros.session.reproduction import describe_circumstances, list_reproductions

    options = _parser().parse_intermixed_args(list(arguments))
    console.require_keys(options.overrides, options.folder)
    own_parts = options.config_dir and expand_home(options.config_dir).absolute()
    given = expand_home(options.folder), expand_home(options.output)
    with prepare(*given, own_parts) as prepared:
        reproductions = list_reproductions(prepared.source, prepared.output)
        status = _run_all(prepared, reproductions, options.overrides, interrupts)
        if status != console.DONE:
            return status
        console.print_result(describe_circumstances(reproductions))
        diff = prepared.compare()
    console.print_result(describe_diff(diff).splitlines()[0])
    return console.DIFFERENT if diff.difference else console.DONE


def _run_all(
    prepared: "Prepared",
    reproductions: "Sequence[Reproduction]",
    overrides: Sequence[str],
    interrupts: Interrupts,
) -> int:
    from evoros.cli.sweep import Sweep, begin_all
    from evoros.config.jobs import Job
    from evoros.session.progress import SweepProgress
    from evoros.session.reproduction import build_reproduction

    by_folder = {reproduction.folder: reproduction for reproduction in reproductions}
    jobs = [Job(reproduction.config, folder) for folder, reproduction in by_folder.items()]
    own_parts = None if prepared.config_dir is None else str(prepared.config_dir)

    def build(job: Job) -> "Session":
        reproduction = by_folder[job.folder]
        places = prepared.relocation(reproduction.source)
        return build_reproduction(reproduction, overrides, own_parts, places)

    with log_everything(), SweepProgress(len(jobs)) as display:
        sweep = Sweep(build, partial(explain_end, own_parts, interrupts), _report, display)
        begin_all(jobs, sweep, interrupts)
    ended = [result.status for _, result in sweep.results]
    if interrupts.last is not None:
        ended.append(interrupts.explain()[1])
    return next(status for status in WORST_FIRST if status in ended)


def _report(folder: Path, result: JobResult) -> None:
    if result.message:
        console.report_error(NAME, f"{folder}: {result.message}", result.status)


def _parser() -> ArgumentParser:
    parser = console.CommandParser(NAME, description=ABOUT, epilog=STATUSES)
    about = "a run, an evaluation, a sweep or an archive"
    parser.add_argument("folder", metavar="FOLDER", help=about)
    about = "settings of the executor"
    parser.add_argument("overrides", nargs="*", metavar="executor.KEY=VALUE", help=about)
    default = f"outputs/{datetime.now():%Y-%m-%d_%H-%M-%S}_reproduced"
    about = "folder of the new run; an interrupted run is continued (default: outputs/DATE...)"
    parser.add_argument("--output", metavar="NEW", default=default, help=about)
    parser.add_argument("--config-dir", metavar="DIR", help="folder with your own parts")
    parser.add_argument("--version", action="version", version=f"{NAME} {read_origin().version}")
    return parser
