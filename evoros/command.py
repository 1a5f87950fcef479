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

from evoros.assets import folder
from evoros.errors import EvorosError, InputError, RunStopped
from evoros.log import LOGGER, logging_to_terminal

if TYPE_CHECKING:
    from omegaconf import DictConfig

    from evoros.session import Display

DONE, STOPPED, INPUT, INTERRUPTED = 0, 1, 2, 130
WORST_FIRST = (INTERRUPTED, INPUT, STOPPED, DONE)
"""A sweep ends with the status of the worst of its jobs."""


@dataclass(frozen=True)
class Command:
    """One console command: what it does with a configuration and a folder.

    Its functions import what they need when they are called, so that the first word is quick.
    """

    name: str
    config: str  # the primary configuration, a file of conf/
    start: "Callable[[DictConfig, Path, Display], object]"
    resume: "Callable[[Path, Sequence[str], str | None, Display], object]"
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
    from evoros.jobs import options_of

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
        from evoros.config import own_folder

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
    work = partial(command.resume, path, overrides, own)
    return _session(command, work, path, own, signals, live=True)


def _run(command: Command, options: Namespace, signals: "_Signals") -> int:
    """One run, or the runs of a sweep."""
    from evoros.jobs import Jobs

    own = options.config_dir
    jobs = Jobs(options.overrides, bool(options.multirun), own, command.config)
    statuses = []
    for job in jobs:
        if isinstance(job, EvorosError):
            statuses.append(_say(command, str(job), _status(job)))
            continue
        alone = jobs.sweep is None
        work = partial(command.start, job.config, job.folder)
        statuses.append(_session(command, work, job.folder, own, signals, alone))
        if signals.last is not None:
            if not alone:
                LOGGER.error(
                    "%s: for the jobs that have not begun, repeat the command with "
                    "hydra.sweep.dir=%s: those that have begun are refused, untouched",
                    command.name,
                    shlex.quote(str(jobs.sweep)),
                )
            break
    return next(status for status in WORST_FIRST if status in (*statuses, DONE))


def _show(command: Command, arguments: list[str]) -> int:
    """What Hydra shows without running anything: --help, --cfg, --info, completion."""
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra then raises what it would print at length
    import hydra

    from evoros.messages import one_line

    sys.argv = [command.name, *arguments]
    conf = str(folder("conf"))
    decorate = hydra.main(version_base="1.3", config_path=conf, config_name=command.config)
    try:
        decorate(lambda config: None)()
    except SystemExit as stop:  # so it ends after --help
        return int(stop.code or DONE)
    except Exception as error:
        raise InputError(one_line(error)) from error
    return DONE


def _session(
    command: Command,
    work: "Callable[[Display], object]",
    path: Path,
    config_dir: str | None,
    signals: "_Signals",
    live: bool,
) -> int:
    """One run, its display and what is said at its end; returns an exit status."""
    from evoros.folder import LOG
    from evoros.progress import Progress

    try:
        with Progress(live and sys.stderr.isatty()) as display:
            work(display)
    except KeyboardInterrupt:
        message, status = signals.what_happened()
        return _say(command, message + _again(path, config_dir), status)
    except RunStopped as error:
        return _say(command, f"{error}{_again(path, config_dir)}", STOPPED)
    except EvorosError as error:
        return _say(command, str(error), _status(error))
    except Exception as error:  # a part of the user's, a full disk, or a fault of ours
        said = " ".join(f"{type(error).__name__}: {error}".split())
        log = path / LOG
        where = f" (traceback in {log})" if log.exists() else ""
        return _say(command, f"{said}{where}{_again(path, config_dir)}", STOPPED)
    print(command.summary(path))
    return DONE


def _again(path: Path, config_dir: str | None) -> str:
    """What to type to go on; nothing before there is a run."""
    from evoros.folder import MISSIONS, resume_command

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
