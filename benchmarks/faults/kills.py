"""Kills: a real process of a run, or a worker of it, gets a signal at some point of its progress.

Then the run is resumed, and perhaps killed again. In the end it has the bytes of a run that nobody
disturbed, and no process is left.
"""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random
from typing import NamedTuple
from unittest import mock
from uuid import uuid4

from cases import SAME, Fault, Trial, call, check_equal, check_words, last_line, prepare_quietly
from helpers import ROOT, TINY, USER_PARTS, resume, start, tiny
from needs import NEEDS, ROS2_PYTHON

from evoros.cli.main import evoros
from evoros.terminal.console import DONE, INTERRUPTED, STOPPED

LIMIT_S = 300.0
EARLY, START_S = 0.2, 3.0
"""The share of signals that come at a time [s] since the start, and their latest time."""
END_S = 60.0
"""Time in which a process has to end after a signal, and a killed one's workers with it."""
MARK = "EVOROS_FAULTS"
SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
TARGETS = ("main", "main", "group", "worker")
SHORT = (*TINY, "optimizer.generations=2", "simulator.pause_s=0.02")
SHORTER = ("~world.far", "optimizer.generations=1", "optimizer.population_size=2")
TESTS = ROOT / "tests"
PLANAR = (
    "simulator=planar", "world=maze", "world.maze.course.time_limit_s=5", "figures=[]",
    "optimizer.population_size=3", "optimizer.generations=2", "optimizer.validation_trials=1",
)  # fmt: skip


class Setting(NamedTuple):
    """The overrides of a run, those of its executor, and how often it is chosen."""

    words: tuple[str, ...]
    executor: tuple[str, ...] = ("executor=serial",)
    weight: float = 1.0
    need: str = ""  # besides Python packages

    def is_there(self) -> bool:
        """Whether this machine has what it needs."""
        return not self.need or NEEDS[self.need].is_met()


def _command(*words: object) -> str:
    quoted = ",".join(f"'{word}'" for word in words)
    return f"[{quoted}]"


def _nodes(version: int, python: object) -> tuple[str, ...]:
    nodes = _command(python, TESTS / "nodes" / f"ros{version}_avoid.py", "callback")
    parts = (f"controller=ros{version}", f"controller.nodes=[{nodes}]")
    return (*TINY, *SHORTER, *parts, "+controller.parameters.reach=1.0")


def _program() -> tuple[str, ...]:
    rules = _command(sys.executable, TESTS / "programs" / "rules.py")
    parts = ("controller=program", "controller.modes=[avoiding,navigating]")
    return (*PLANAR, *parts, f"controller.command={rules}")


TWO_WORKERS = ("executor=processes", "executor.workers=2")
SETTINGS = {
    "serial": Setting(SHORT, weight=4.0),
    "processes": Setting(SHORT, TWO_WORKERS, weight=3.0),
    "trajectories": Setting((*SHORT, "record=all"), TWO_WORKERS),
    "evaluation": Setting(("evaluate", *TINY, "designs=DESIGNS", "trials=6"), TWO_WORKERS),
    "dask": Setting(SHORT, ("executor=dask", "executor.workers=2")),
    "planar": Setting(PLANAR, TWO_WORKERS),
    "MuJoCo": Setting(("simulator=physics", *PLANAR[1:]), TWO_WORKERS),
    "program": Setting(_program(), TWO_WORKERS),
    "ROS 1": Setting(_nodes(1, "/usr/bin/python3"), weight=0.5, need="ros1"),
    "ROS 2": Setting(
        (*_nodes(2, ROS2_PYTHON), f"controller.python={ROS2_PYTHON}"), weight=0.5, need="ros2"
    ),
}


@contextmanager
def prepare(base: Path) -> Iterator[Callable[[int, Path], Trial]]:
    """Make the run of each setting that nobody disturbs, when it is first needed."""
    designs = base / "designs"
    prepare_quietly(lambda: tiny(designs, "optimizer.generations=1"))
    names = [name for name, setting in SETTINGS.items() if setting.is_there()]

    def plan(seed: int, folder: Path) -> Trial:
        rng = Random(f"kill {seed}")
        (name,) = rng.choices(names, [SETTINGS[name].weight for name in names])
        words = [word.replace("DESIGNS", str(designs)) for word in SETTINGS[name].words]
        setting = SETTINGS[name]._replace(words=tuple(words))
        if not (base / name).exists():
            answer = call(
                lambda: evoros([*words, "executor=serial", f"hydra.run.dir={base / name}"])
            )
            assert answer.status == DONE, answer.errors
        times = rng.choice((1, 1, 1, 2, 3))
        case = f"{name}: {times} kills"
        return Trial(case, lambda: kill_and_resume(setting, folder, base / name, times, rng))

    yield plan


def kill_and_resume(setting: Setting, folder: Path, whole: Path, times: int, rng: Random) -> str:
    """Kill a run some times, and let it end in this process."""
    run, mark = folder / "run", str(uuid4())
    rows = (whole / "missions.csv").read_bytes().count(b"\n")
    with mock.patch.dict(os.environ, {MARK: mark}):
        for _ in range(times):
            process = begin(setting, folder)
            try:
                strike(process, run, rows, rng)
                require_nothing_left(mark)
            finally:
                for pid in list_marked(mark):
                    with suppress(ProcessLookupError):
                        os.kill(pid, signal.SIGKILL)
    if not has_begun(run):
        shutil.rmtree(run, ignore_errors=True)
        words = [*setting.words, "executor=serial", f"hydra.run.dir={run}"]
        answer = call(lambda: evoros(words))
    else:
        answer = call(lambda: resume(run, "executor=serial"))
    if answer.status != DONE:
        raise Fault(f"status {answer.status}: {last_line(answer.errors)}")
    check_equal(run, whole)
    return SAME


def has_begun(run: Path) -> bool:
    """Whether a run can be resumed; a kill while its folder is made may leave less."""
    return (run / "missions.csv").exists()


def begin(setting: Setting, folder: Path) -> "subprocess.Popen[str]":
    """Start a run, or resume it, in a process of its own."""
    run = folder / "run"
    if has_begun(run):
        words = ["resume", str(run), "--config-dir", str(USER_PARTS), *setting.executor]
    else:
        shutil.rmtree(run, ignore_errors=True)
        words = [*setting.words, *setting.executor, f"hydra.run.dir={run}"]
    return start(words, folder, "evoros.__main__")


def strike(process: "subprocess.Popen[str]", run: Path, rows: int, rng: Random) -> None:
    """Send a signal at some point of the progress, and judge how the process ends."""
    if rng.random() < EARLY:
        time.sleep(rng.uniform(0.0, START_S))
    else:
        wait_for_rows(process, run, rng.randint(0, rows))
        time.sleep(rng.uniform(0.0, 0.05))
    target, number = rng.choice(TARGETS), rng.choice(SIGNALS)
    family = list_family(process.pid)
    if target == "worker" and family:
        with suppress(ProcessLookupError):
            os.kill(rng.choice(family), signal.SIGKILL)
    elif process.poll() is None:
        target = target if target == "group" else "main"
        (os.killpg if target == "group" else os.kill)(process.pid, number)
    try:
        _, errors = process.communicate(timeout=END_S)
    except subprocess.TimeoutExpired as late:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        raise Fault(f"{target} {number.name}: does not end in {END_S:.0f} s") from late
    if number == signal.SIGINT and is_before_evoros(errors):
        return
    check_words(errors)
    if process.returncode not in (DONE, STOPPED, INTERRUPTED, -number, -signal.SIGKILL):
        raise Fault(f"{target} {number.name}: status {process.returncode}: {last_line(errors)}")


def is_before_evoros(errors: str) -> bool:
    """Whether Ctrl-C met Python before it called a function of evoros, so that it has the word."""
    frames = [line for line in errors.splitlines() if line.startswith("  File ")]
    at_import = all(line.endswith(", in <module>") or "<frozen " in line for line in frames)
    return errors.rstrip().endswith("KeyboardInterrupt") and at_import


def wait_for_rows(process: "subprocess.Popen[str]", run: Path, rows: int) -> None:
    """Wait until so many rows are on disk, or the process has ended."""
    table = run / "missions.csv"
    while process.poll() is None:
        if rows == 0 or (table.exists() and table.read_bytes().count(b"\n") >= rows):
            return
        time.sleep(0.005)


def list_family(pid: int) -> list[int]:
    """List the processes that descend from one.

    Python's tracker of resources is left out: it holds no work, and Python prints a traceback if
    another tracker is told of what this one knew.
    """
    parents: dict[int, int] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, ValueError, IndexError):
            parents[int(folder.name)] = int(
                (folder / "stat").read_text().rpartition(")")[2].split()[1]
            )
    family, ages = {pid}, {pid}
    while ages:
        ages = {child for child, parent in parents.items() if parent in family} - family
        family |= ages
    return sorted(child for child in family - {pid} if not is_tracker(child))


def is_tracker(pid: int) -> bool:
    """Whether a process is Python's tracker of resources."""
    with suppress(OSError):
        return b"multiprocessing.resource_tracker" in Path(f"/proc/{pid}/cmdline").read_bytes()
    return False


def list_marked(mark: str) -> list[int]:
    """List the processes that a case has started, other than this one."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if f"{MARK}={mark}".encode() in (folder / "environ").read_bytes().split(b"\0"):
                found.append(int(folder.name))
    return [pid for pid in found if pid != os.getpid()]


def require_nothing_left(mark: str) -> None:
    """Require that all processes of a case end in time."""
    deadline = time.monotonic() + END_S
    while left := list_marked(mark):
        if time.monotonic() > deadline:
            raise Fault(f"{len(left)} processes are left")
        time.sleep(0.02)
