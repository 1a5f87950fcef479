"""The command ``evoros``: arguments, messages and exit statuses.

Exit statuses: 0 done; 1 stopped, resumable; 2 input that cannot be used; 130 interrupted.
"""

import os
import shlex
import signal
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from evoros.assets import folder
from evoros.errors import EvorosError, InputError, RunStopped
from evoros.log import LOGGER, logging_to_terminal

if TYPE_CHECKING:
    from evoros.session import Display

DONE, STOPPED, INPUT, INTERRUPTED = 0, 1, 2, 130
WORST_FIRST = (INTERRUPTED, INPUT, STOPPED, DONE)
"""A sweep ends with the status of the worst of its jobs."""


def main() -> None:
    """Entry point of the console script."""
    sys.exit(evoros(sys.argv[1:]))


def evoros(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit status."""
    with logging_to_terminal(), _Signals() as signals:
        try:
            return _command(list(arguments), signals)
        except KeyboardInterrupt:
            return _say(*signals.what_happened())
        except EvorosError as error:
            return _say(str(error), _status(error))


def _command(arguments: list[str], signals: "_Signals") -> int:
    from evoros.jobs import options_of

    if "--version" in arguments:
        from importlib.metadata import version

        print(f"evoros {version('evoros')}")
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
        return _resume(options, signals)
    return _show(arguments) if shown else _run(options, signals)


def _resume(options: Namespace, signals: "_Signals") -> int:
    """``evoros resume=FOLDER [executor...] [optimizer.generations=N]``."""
    from evoros.session import resume

    target = next(each for each in options.overrides if each.startswith("resume="))
    path = Path(target.partition("=")[2]).expanduser()
    overrides = [each for each in options.overrides if each is not target]
    own = options.config_dir
    work = partial(resume, path, overrides, config_dir=own)
    return _session(work, path, own, signals, live=True)


def _run(options: Namespace, signals: "_Signals") -> int:
    """One run, or the runs of a sweep."""
    from evoros.jobs import Jobs
    from evoros.session import start

    own = options.config_dir
    jobs = Jobs(options.overrides, bool(options.multirun), own)
    statuses = []
    for job in jobs:
        if isinstance(job, EvorosError):
            statuses.append(_say(str(job), _status(job)))
            continue
        alone = jobs.sweep is None
        work = partial(start, job.config, job.folder)
        statuses.append(_session(work, job.folder, own, signals, alone))
        if signals.last is not None:
            if not alone:
                LOGGER.error(
                    "evoros: for the jobs that have not begun, repeat the command with "
                    "hydra.sweep.dir=%s: those that have begun are refused, untouched",
                    shlex.quote(str(jobs.sweep)),
                )
            break
    return next(status for status in WORST_FIRST if status in (*statuses, DONE))


def _show(arguments: list[str]) -> int:
    """What Hydra shows without running anything: --help, --cfg, --info, completion."""
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra then raises what it would print at length
    import hydra

    from evoros.messages import one_line

    sys.argv = ["evoros", *arguments]
    decorate = hydra.main(version_base="1.3", config_path=str(folder("conf")), config_name="config")
    try:
        decorate(lambda config: None)()
    except SystemExit as stop:  # so it ends after --help
        return int(stop.code or DONE)
    except Exception as error:
        raise InputError(one_line(error)) from error
    return DONE


def _session(
    work: Callable[["Display"], object],
    path: Path,
    config_dir: str | None,
    signals: "_Signals",
    live: bool,
) -> int:
    """One run, its display and what is said at its end; returns an exit status."""
    from evoros.progress import Progress
    from evoros.record import LOG
    from evoros.summary import summary

    try:
        with Progress(live and sys.stderr.isatty()) as display:
            work(display)
    except KeyboardInterrupt:
        message, status = signals.what_happened()
        return _say(message + _again(path, config_dir), status)
    except RunStopped as error:
        return _say(f"{error}{_again(path, config_dir)}", STOPPED)
    except EvorosError as error:
        return _say(str(error), _status(error))
    except Exception as error:  # a part of the user's, a full disk, or a fault of ours
        said = " ".join(f"{type(error).__name__}: {error}".split())
        log = path / LOG
        where = f" (traceback in {log})" if log.exists() else ""
        return _say(f"{said}{where}{_again(path, config_dir)}", STOPPED)
    print(summary(path))
    return DONE


def _again(path: Path, config_dir: str | None) -> str:
    """What to type to go on; nothing before there is a run."""
    from evoros.record import MISSIONS, resume_command

    own = f" --config-dir {shlex.quote(config_dir)}" if config_dir else ""
    begun = (path / MISSIONS).exists()
    return f"; to continue type: {resume_command(path)}{own}" if begun else ""


def _status(error: EvorosError) -> int:
    return INPUT if isinstance(error, InputError) else STOPPED


def _say(message: str, status: int) -> int:
    LOGGER.error("evoros: %s", " ".join(message.split()))
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
