"""What the commands share: arguments, messages, signals and exit statuses.

Exit statuses: 0 done; 1 stopped, resumable; 2 input that cannot be used; 130 interrupted.
"""

import os
import shlex
import signal
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from evoros.base.console import DONE, INPUT, INTERRUPTED, STOPPED, print_result
from evoros.base.errors import EvorosError, InputError, RunStopped
from evoros.base.log import LOGGER, logging_to_terminal
from evoros.base.resources import bundled_folder

if TYPE_CHECKING:
    from omegaconf import DictConfig

    from evoros.cli.sweep import JobResult, Sweep
    from evoros.config.jobs import Jobs
    from evoros.session.run import Work

WORST_FIRST = (INTERRUPTED, INPUT, STOPPED, DONE)
"""A sweep ends with the status of the worst of its jobs."""


@dataclass(frozen=True)
class Command:
    """One console command: what it does with a configuration and a folder.

    Its functions import what they need when they are called, so that the first word is quick.
    """

    name: str
    config: str  # the primary configuration, a file of conf/
    new: "Callable[[DictConfig, Path], Work]"
    resumed: "Callable[[Path, Sequence[str], str | None], Work]"
    summary: Callable[[Path], str]  # what it says at the end of the work in a folder

    def __call__(self, arguments: Sequence[str]) -> int:
        """Run the command; returns its exit status."""
        with logging_to_terminal(), _Signals() as signals:
            try:
                return _command(self, list(arguments), signals)
            except KeyboardInterrupt:
                return _say(self, *signals.what_happened())
            except EvorosError as error:
                return _say(self, str(error), _status(error))


def _command(command: Command, arguments: list[str], signals: "_Signals") -> int:
    from evoros.config.jobs import options_of

    if "--version" in arguments:
        from importlib.metadata import version

        print(f"{command.name} {version('evoros')}")
        return DONE
    options = options_of(arguments)
    chosen = {name for name, value in vars(options).items() if value}
    shown = chosen & {"help", "hydra_help", "cfg", "info", "shell_completion"}
    unused = chosen & {"config_name", "config_path", "experimental_rerun"}
    if unused:
        option = unused.pop().replace("_", "-")
        raise InputError(f"--{option}: is Hydra's and not evoros's; use experiment= for a study")
    if options.config_dir:
        from evoros.config.compose import own_folder

        own_folder(options.config_dir)
    if any(override.startswith("resume=") for override in options.overrides):
        if shown or options.multirun:
            raise InputError("resume=: goes with --config-dir only; leave the other options out")
        return _resume(command, options, signals)
    return _show(command, arguments) if shown else _run(command, options, signals)


def _resume(command: Command, options: Namespace, signals: "_Signals") -> int:
    """``resume=FOLDER`` and what may change then."""
    target = next(each for each in options.overrides if each.startswith("resume="))
    path = Path(target.partition("=")[2]).expanduser()
    overrides = [each for each in options.overrides if each is not target]
    own = options.config_dir
    return _alone(command, partial(command.resumed, path, overrides, own), path, own, signals)


def _run(command: Command, options: Namespace, signals: "_Signals") -> int:
    """One run, or the runs of a sweep."""
    from evoros.config.jobs import Jobs

    own = options.config_dir
    jobs = Jobs(options.overrides, bool(options.multirun), own, command.config)
    if jobs.sweep is not None:
        return _sweep(command, jobs, own, signals)
    (job,) = (each for each in jobs if not isinstance(each, EvorosError))
    return _alone(command, partial(command.new, job.config, job.folder), job.folder, own, signals)


def _alone(
    command: Command,
    build: "Callable[[], Work]",
    path: Path,
    config_dir: str | None,
    signals: "_Signals",
) -> int:
    """One run, its display and what is said at its end; returns an exit status."""
    from evoros.cli.progress import Progress
    from evoros.cli.sweep import JobResult

    ending = JobResult(DONE)
    try:
        with Progress(sys.stderr.isatty()) as display:
            build().run(display)
    except (KeyboardInterrupt, Exception) as error:
        ending = _ending(config_dir, signals, path, error)
    return _tell(command, False, path, ending)


def _sweep(command: Command, jobs: "Jobs", config_dir: str | None, signals: "_Signals") -> int:
    """All runs of a sweep; returns the worst exit status."""
    from evoros.base.log import logging_all
    from evoros.cli.progress import SweepProgress
    from evoros.cli.sweep import Sweep

    explain, tell = partial(_ending, config_dir, signals), partial(_tell, command, True)
    with logging_all(), SweepProgress(sys.stderr.isatty(), len(jobs)) as display:
        sweep = Sweep(command.new, explain, tell, display)
        begun = _begin_all(command, jobs, sweep, signals)
    if signals.last is not None:
        sweep.statuses.append(signals.what_happened()[1])
        if begun < len(jobs):
            LOGGER.error(
                "%s: for the jobs that have not begun, repeat the command with "
                "hydra.sweep.dir=%s: those that have begun are refused, untouched",
                command.name,
                shlex.quote(str(jobs.sweep)),
            )
    return next(status for status in WORST_FIRST if status in (*sweep.statuses, DONE))


def _begin_all(command: Command, jobs: "Jobs", sweep: "Sweep", signals: "_Signals") -> int:
    """Begin the jobs until a signal comes, and wait for their ends; returns how many began."""
    begun = 0
    try:
        for job in jobs:
            if isinstance(job, EvorosError):
                sweep.refuse(_say(command, str(job), _status(job)))
            else:
                sweep.begin(job)  # waits, maybe for long, for another one to end
            begun += 1
            if signals.last is not None:
                break
        sweep.finish()
    except KeyboardInterrupt:  # each run that it stops says how to go on
        pass
    finally:
        sweep.close()
    return begun


def _show(command: Command, arguments: list[str]) -> int:
    """What Hydra shows without running anything: --help, --cfg, --info, completion."""
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra then raises what it would print at length
    import hydra

    from evoros.config.messages import one_line

    sys.argv = [command.name, *arguments]
    conf = str(bundled_folder("conf"))
    decorate = hydra.main(version_base="1.3", config_path=conf, config_name=command.config)
    try:
        decorate(lambda config: None)()
    except SystemExit as stop:  # so it ends after --help
        return int(stop.code or DONE)
    except Exception as error:
        raise InputError(one_line(error)) from error
    return DONE


def _ending(
    config_dir: str | None, signals: "_Signals", path: Path, error: BaseException
) -> "JobResult":
    """How a run ended that raised, and how to go on with it."""
    from evoros.cli.sweep import JobResult
    from evoros.storage.mission_log import LOG

    again = _again(path, config_dir)
    if isinstance(error, KeyboardInterrupt):
        message, status = signals.what_happened()
        return JobResult(status, message + again)
    if isinstance(error, EvorosError):
        status = _status(error)
        return JobResult(status, f"{error}{again if isinstance(error, RunStopped) else ''}")
    # A part of the user's, a full disk, or a fault of ours.
    said = " ".join(f"{type(error).__name__}: {error}".split())
    log = path / LOG
    where = f" (traceback in {log})" if log.exists() else ""
    return JobResult(STOPPED, f"{said}{where}{again}")


def _tell(command: Command, named: bool, path: Path, ending: "JobResult") -> int:
    """What is said at the end of a run; ``named`` where it is one of several."""
    if ending.said:
        name = f"{path.name}: " if named else ""
        return _say(command, f"{name}{ending.said}", ending.status)
    print_result(command.summary(path))
    return ending.status


def _again(path: Path, config_dir: str | None) -> str:
    """What to type to go on; nothing before there is a run."""
    from evoros.storage.mission_log import MISSIONS, resume_command

    own = f" --config-dir {shlex.quote(config_dir)}" if config_dir else ""
    begun = (path / MISSIONS).exists()
    return f"; to continue type: {resume_command(path)}{own}" if begun else ""


def _status(error: EvorosError) -> int:
    return INPUT if isinstance(error, InputError) else STOPPED


def _say(command: Command, message: str, status: int) -> int:
    LOGGER.error("%s: %s", command.name, " ".join(message.split()))
    return status


class _Signals:
    """While open, SIGTERM ends a run as cleanly as Ctrl-C does, but with another status."""

    def __init__(self) -> None:
        self.last: int | None = None

    def __enter__(self) -> "_Signals":
        self._before = {
            number: signal.signal(number, self._interrupt)
            for number in (signal.SIGINT, signal.SIGTERM)
            if signal.getsignal(number) != signal.SIG_IGN  # as with nohup
        }
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        self.last = number
        # Not an Exception: nothing that catches those, as logging does, may swallow it.
        raise KeyboardInterrupt

    def what_happened(self) -> tuple[str, int]:
        """A message and an exit status."""
        if self.last == signal.SIGTERM:
            return "terminated by a signal", STOPPED
        return "interrupted", INTERRUPTED
