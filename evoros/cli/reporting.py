"""Reports how jobs end: signals, messages, summaries and exit statuses."""

import os
import signal
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from evoros.base.errors import EvorosError, PartFault, RunStopped, explain_path, single_line
from evoros.files.disk import exists
from evoros.terminal import console

PATIENCE_S = 10.0


class Interrupts:
    """Converts the first SIGINT or SIGTERM to KeyboardInterrupt; the second ends the process."""

    def __init__(self) -> None:
        self.last: int | None = None  # latest signal
        self._first_s: float | None = None  # time.monotonic() [s] at the first signal

    def __enter__(self) -> "Interrupts":
        self._handlers = {
            signum: signal.signal(signum, self._interrupt)
            for signum in (signal.SIGINT, signal.SIGTERM)
            if signal.getsignal(signum) != signal.SIG_IGN  # nohup ignores some signals
        }
        return self

    def __exit__(self, *_: object) -> None:
        for signum, handler in self._handlers.items():
            signal.signal(signum, handler)

    def _interrupt(self, signum: int, frame: FrameType | None) -> None:
        self.last = signum
        if self._first_s is not None:
            if time.monotonic() - self._first_s > PATIENCE_S:
                os._exit(self.explain()[1])  # also ends the workers; runs can be resumed
            return
        self._first_s = time.monotonic()
        # Code that catches Exception, such as logging, lets KeyboardInterrupt through.
        raise KeyboardInterrupt

    def explain(self) -> tuple[str, int]:
        """Return a message about the last signal, and the corresponding exit status."""
        if self.last == signal.SIGTERM:
            return "terminated by a signal", console.STOPPED
        return console.explain_interrupt()


# Exit statuses from worst to best; a sweep returns the worst status of its jobs.
WORST_FIRST = (
    *(console.INTERRUPTED, console.INPUT, console.STOPPED),
    *(console.NOT_MET, console.NOT_DECIDED, console.DONE),
)


@dataclass(frozen=True)
class JobResult:
    """The exit status of a job, and the reason for an early end (empty if it finished)."""

    status: int
    message: str = ""
    kept: bool = False  # whether the job was already complete before the sweep


def explain_end(
    config_dir: str | None,
    interrupts: Interrupts,
    folder: Path,
    error: BaseException,
    typed: Sequence[str] = (),
) -> JobResult:
    """Return the result of a failed job, with the command (overrides ``typed``) that resumes it."""
    # Imported here, because these imports are slow and --help does not need them.
    from evoros.config.own_files import locate_fault
    from evoros.storage.layout import FINISHED, LOG, MISSIONS, STATUS, read_json, resume_command

    resume, place = resume_command(folder, config_dir, typed), ""
    hint = f"; to continue, type: {resume}" if exists(folder / MISSIONS) else ""
    cause = error.__cause__ if isinstance(error, RunStopped) else error
    if not isinstance(cause, EvorosError | MemoryError | KeyboardInterrupt):
        place = locate_fault(error)
        again = _start_again(folder, resume, place)
        hint = f"; correct the code{again}" if place else hint
    if isinstance(error, KeyboardInterrupt):
        message, status = interrupts.explain()
        if read_json(folder / STATUS).get("state") == FINISHED:
            message += " while drawing figures; the run itself is finished"
            hint = f"; to draw them, type: {resume}" if hint else ""
        return JobResult(status, message + hint)
    log = folder / LOG
    shown = f" (traceback in {log})" if exists(log) else ""
    if isinstance(error, RunStopped):
        in_part = cause is not None and not isinstance(cause, EvorosError)
        return JobResult(console.STOPPED, f"{place}{error}{shown if in_part else ''}{hint}")
    if _is_gone(folder, error):
        return JobResult(
            console.STOPPED,
            f"{folder}: moved or deleted during the run; move the folder back and type: {resume}",
        )
    if isinstance(error, EvorosError):
        again = _start_again(folder, resume, str(error)) if isinstance(error, PartFault) else ""
        return JobResult(console.status_of(error), f"{error}{again}")
    path_error = explain_path(error)
    if path_error:
        return JobResult(console.STOPPED if hint else console.INPUT, place + path_error + hint)
    # an error in a user's part, a full disk, or a bug in evoros
    message = single_line(f"{type(error).__name__}: {error}")
    if not (shown or place):
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{last.filename}, line {last.lineno}, in {last.name}: "
    return JobResult(console.STOPPED, f"{place}{message}{shown}{hint}")


def _start_again(folder: Path, resume: str, told: str) -> str:
    """Return what to do after fixing the part named in a message; empty if nothing is recorded."""
    from evoros.storage.layout import MISSIONS
    from evoros.storage.manifest import list_unrecorded

    if not exists(folder / MISSIONS):
        return ""
    mended = any(str(file) in told for file in list_unrecorded(folder).values())
    return f" and type: {resume}" if mended else " and start a new run"


def _is_gone(folder: Path, error: BaseException) -> bool:
    cause = error.__cause__ if isinstance(error, EvorosError) else error
    if not isinstance(cause, FileNotFoundError) or exists(folder):
        return False
    return Path(str(cause.filename)).absolute().is_relative_to(folder.absolute())


def report_result(command: str, in_sweep: bool, folder: Path, result: JobResult) -> int:
    """Print the summary of a finished job, or why it ended early; return the exit status."""
    if result.message:
        name = f"{folder.name}: " if in_sweep else ""
        return console.report_error(command, f"{name}{result.message}", result.status)
    from evoros.cli.summary import summarize

    console.print_result(summarize(folder))
    return judge_result(folder, result)


def judge_result(folder: Path, result: JobResult) -> int:
    """Return the exit status of a job, which depends on the verdicts of a finished evaluation."""
    if result.status != console.DONE:
        return result.status
    from evoros.requirement.verdict import UNDECIDED, VIOLATED
    from evoros.storage.verdicts import read_verdicts

    results = {row["result"] for row in read_verdicts(folder)}
    if VIOLATED in results:
        return console.NOT_MET
    return console.NOT_DECIDED if UNDECIDED in results else console.DONE
