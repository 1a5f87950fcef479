"""Reports the ends of jobs: messages, summaries and exit statuses."""

import sysconfig
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.base.errors import EvorosError, RunStopped, single_line
from evoros.cli.interrupts import Interrupts
from evoros.files.disk import exists, explain_rights
from evoros.files.resources import PACKAGE
from evoros.terminal.console import (
    DONE,
    INPUT,
    INTERRUPTED,
    NOT_DECIDED,
    NOT_MET,
    STOPPED,
    print_result,
    report_error,
    status_of,
)

if TYPE_CHECKING:
    from evoros.cli.kind import Kind

WORST_FIRST = (INTERRUPTED, INPUT, STOPPED, NOT_MET, NOT_DECIDED, DONE)
"""Exit statuses, the worst first: a sweep ends with the worst of its jobs."""


@dataclass(frozen=True)
class JobResult:
    """How a job ended: its exit status, and why it ended; the message is empty if it finished."""

    status: int
    message: str = ""
    kept: bool = False  # it was complete before


def explain_end(
    config_dir: str | None, interrupts: Interrupts, folder: Path, error: BaseException
) -> JobResult:
    """Return the result of a job that raised, with the command that resumes it."""
    from evoros.storage.layout import FINISHED, LOG, STATUS, read_json, resume_command

    hint = _resume_hint(folder, config_dir)
    if isinstance(error, KeyboardInterrupt):
        message, status = interrupts.explain()
        if read_json(folder / STATUS).get("state") == FINISHED:
            message += " while figures were drawn; the run itself is finished"
            hint = hint.replace("; to continue", "; to draw them")
        return JobResult(status, message + hint)
    log = folder / LOG
    shown = f" (traceback in {log})" if exists(log) else ""
    if isinstance(error, RunStopped):
        in_part = error.__cause__ is not None and not isinstance(error.__cause__, EvorosError)
        return JobResult(STOPPED, f"{error}{shown if in_part else ''}{hint}")
    if _is_gone(folder, error):
        return JobResult(
            STOPPED,
            f"{folder}: must stay where it is until the run ends, and was moved or deleted; move "
            f"it back and type: {resume_command(folder, config_dir)}",
        )
    if isinstance(error, EvorosError):
        return JobResult(status_of(error), str(error))
    rights = explain_rights(error)
    if rights:
        return JobResult(STOPPED, f"{rights}{hint}")
    # An error in the user's own part, a full disk, or a bug of evoros.
    message = single_line(f"{type(error).__name__}: {error}")
    return JobResult(STOPPED, f"{'' if shown else _locate(error)}{message}{shown}{hint}")


def _is_gone(folder: Path, error: BaseException) -> bool:
    """Whether an error is that the folder, and with it one of its files, is not there any more."""
    cause = error.__cause__ if isinstance(error, EvorosError) else error
    if not isinstance(cause, FileNotFoundError) or exists(folder):
        return False
    return Path(str(cause.filename)).absolute().is_relative_to(folder.absolute())


def _locate(error: BaseException) -> str:
    """Name the place where an error was raised, the last one that is the user's if there is any."""
    frames = traceback.extract_tb(error.__traceback__)
    installed = (str(PACKAGE), *map(sysconfig.get_path, ("stdlib", "purelib", "platlib")))
    user_frames = [frame for frame in frames if not frame.filename.startswith(installed)]
    place = next(iter([*reversed(user_frames), *reversed(frames)]), None)
    return "" if place is None else f"{place.filename}, line {place.lineno}, in {place.name}: "


def _resume_hint(folder: Path, config_dir: str | None) -> str:
    """Return the command that resumes the job; empty if the folder has not been made."""
    from evoros.storage.layout import MISSIONS, resume_command

    if not exists(folder / MISSIONS):
        return ""
    return f"; to continue type: {resume_command(folder, config_dir)}"


def report_result(kind: "Kind", in_sweep: bool, folder: Path, result: JobResult) -> int:
    """Print the summary of a finished job, or report why it ended; returns its exit status."""
    if result.message:
        name = f"{folder.name}: " if in_sweep else ""
        return report_error(kind.name, f"{name}{result.message}", result.status)
    print_result(kind.load().summarize(folder))
    return judge_result(kind, folder, result)


def judge_result(kind: "Kind", folder: Path, result: JobResult) -> int:
    """Return the exit status of a job, which for a finished one may follow from its folder."""
    return kind.load().judge(folder) if result.status == DONE else result.status
