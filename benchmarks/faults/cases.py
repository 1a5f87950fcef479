"""What all kinds of faults share: calls of commands, what counts as whole, and the loop.

A case is a pure function of its seed. It is whole if the folder has the bytes of a run that nobody
disturbed, or if one line tells what is wrong and the folder has what it had. Anything else, such
as a traceback, a hang, other bytes or a lost file, is a fault.
"""

import io
import re
import resource
import signal
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any, NamedTuple

from helpers import everything

from evoros.cli.diff import diff
from evoros.terminal.console import DONE, INPUT, INTERRUPTED, STOPPED

SAME, REFUSED, READ = "same bytes", "one line, nothing lost", "read as it is"
"""The verdicts of whole cases; the last is for input that a reader accepts."""
FAULT = "fault"
CHANGING = ("evoros.log", "status.json", "damaged", "figures")
"""Files that tell when and how long, files that are drawn anew, and what was set aside."""
MEMORY = 3 << 30
"""The address space [bytes] that a case may take."""
TIMERS = ((signal.SIGPROF, signal.ITIMER_PROF, 1), (signal.SIGALRM, signal.ITIMER_REAL, 10))
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")


class Fault(Exception):
    """A case that is not whole, in one line."""


class TooLong(BaseException):
    """A case took longer than its limit; nothing that handles errors catches it."""


class Trial(NamedTuple):
    """A case in a few words, and the call that tries it and returns its verdict."""

    case: str
    run: Callable[[], str]


class Result(NamedTuple):
    """The end of a case; ``about`` says what is wrong."""

    case: str
    verdict: str
    about: str


class Answer(NamedTuple):
    """The exit status of a command, and what it wrote."""

    status: int
    output: str
    errors: str


Plan = Callable[[int, Path], Trial]
"""Chooses the case of a seed, which is tried in an empty folder."""
Kind = Callable[[Path], AbstractContextManager[Plan]]
"""Prepares, in an empty folder, what all cases of a kind share."""


def prepare_quietly(action: Callable[[], object]) -> None:
    """Make what the cases share, without a word on the terminal."""
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        action()


def call(command: Callable[[], int]) -> Answer:
    """Call a command in this process; an exception that reaches here would be a traceback."""
    output, errors = io.StringIO(), io.StringIO()
    with redirect_stdout(output), redirect_stderr(errors):
        status = command()
    answer = Answer(status, output.getvalue(), errors.getvalue())
    if status == INTERRUPTED or "terminated by a signal" in answer.errors:
        raise KeyboardInterrupt  # of the harness
    check_words(answer.output + answer.errors)
    return answer


def check_words(words: str) -> None:
    """Require that nothing is a traceback and no control character reaches the terminal."""
    if "Traceback" in words:
        raise Fault(f"a traceback: {_find_error(words)}")
    if control := _CONTROL.search(words):
        raise Fault(f"{control[0]!r} reaches the terminal")


def _find_error(words: str) -> str:
    """Return the first error of a traceback and where it was raised; other lines may follow it."""
    lines = words[words.index("Traceback") :].splitlines()[1:]
    error = next((i for i, line in enumerate(lines) if not line.startswith(" ")), len(lines))
    place = next((line.strip() for line in lines[error::-1] if line.startswith("  File ")), "")
    return f"{' '.join(lines[error : error + 1])} {place}".strip()


def last_line(words: str) -> str:
    """Return the last line that is not empty."""
    return next(filter(None, reversed(words.splitlines())), "")


def check_refusal(answer: Answer, folder: Path, before: dict[str, bytes]) -> None:
    """Require a status of an error, a line that says why, and a folder that has all it had."""
    check_line(answer)
    check_kept(folder, before)


def check_line(answer: Answer) -> None:
    """Require a status of an error and a line that says why."""
    if answer.status not in (INPUT, STOPPED):
        raise Fault(f"status {answer.status}: {last_line(answer.errors)}")
    # In a sweep, lines about other jobs may follow.
    if not any(line.startswith("evoros") for line in answer.errors.splitlines()):
        raise Fault(f"status {answer.status} without a line: {last_line(answer.errors)!r}")


def check_kept(folder: Path, before: dict[str, bytes]) -> None:
    """Require all files of before, with their bytes; the log and the status may say why."""
    now = everything(folder)
    for name, content in before.items():
        if name in now and Path(name).name in ("evoros.log", "status.json"):
            continue
        if now.get(name) != content:
            raise Fault(f"{name}: {'changed' if name in now else 'lost'} by a command that refuses")


def lasting(folder: Path, changing: tuple[str, ...] = CHANGING) -> dict[str, bytes]:
    """Return the files that are the same whatever happened; drafts of a killed process are none."""
    return {
        name: content
        for name, content in everything(folder).items()
        if not any(part.startswith((*changing, ".")) for part in Path(name).parts)
    }


def check_same(folder: Path, whole: dict[str, bytes]) -> None:
    """Require the lasting files of the run that nobody disturbed, as ``lasting`` returned them."""
    now = lasting(folder)
    for name in sorted({*now, *whole}):
        if now.get(name) != whole.get(name):
            how = "missing" if name not in now else "new" if name not in whole else "other bytes"
            raise Fault(f"{name}: {how}")


def check_equal(folder: Path, whole: Path) -> None:
    """Require what ``evoros diff`` compares, whatever the executor and the date of the start."""
    answer = call(lambda: diff([str(whole), str(folder)]))
    if answer.status != DONE:
        raise Fault(last_line(answer.output + answer.errors))


@contextmanager
def limit(seconds: float) -> Iterator[None]:
    """Interrupt what takes longer, and refuse memory to what reads without end."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise TooLong

    before: dict[int, Any] = {}
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, most[1]))
    # Processor time, because others may use the machine; and the clock, because a hang needs none.
    for number, timer, size in TIMERS:
        before[number] = signal.signal(number, interrupt)
        signal.setitimer(timer, size * seconds)
    try:
        yield
    finally:
        for number, timer, _ in TIMERS:
            signal.setitimer(timer, 0)
            signal.signal(number, before[number])
        resource.setrlimit(resource.RLIMIT_AS, most)


def try_case(plan: Plan, seed: int, folder: Path, limit_s: float) -> Result:
    """Try the case of a seed."""
    trial = plan(seed, folder)
    try:
        with limit(limit_s):
            return Result(trial.case, trial.run(), "")
    except TooLong:
        about = f"takes longer than {limit_s:g} s"
    except Fault as fault:
        about = str(fault)
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        about = f"a traceback: {type(error).__name__}: {error} ({place.filename}:{place.lineno})"
    return Result(trial.case, FAULT, " ".join(about.replace(str(folder), ".").split())[:400])


def run_cases(kind: Kind, seeds: Iterable[int], limit_s: float) -> Iterator[tuple[int, Result]]:
    """Try the case of each seed and yield its result."""
    with TemporaryDirectory(prefix="faults-", dir=memory_folder()) as base:
        shared = Path(base, "shared")
        shared.mkdir()
        with kind(shared) as plan:
            for seed in seeds:
                with TemporaryDirectory(
                    prefix="case-", dir=base, ignore_cleanup_errors=True
                ) as folder:
                    yield seed, try_case(plan, seed, Path(folder), limit_s)


def memory_folder() -> str | None:
    """Return a folder in memory, in which syncs cost nothing; None if this system has none."""
    return "/dev/shm" if Path("/dev/shm").is_dir() else None
