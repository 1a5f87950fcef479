"""Sweeps: several runs at the same time, in one pool."""

import io
import logging
import re
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from fixture_types import Capture, Patch
from helpers import TINY, content, tiny

from evoros.cli.main import evoros
from evoros.cli.reporting import JobResult
from evoros.cli.sweep import Sweep, begin_all, jobs_at_once
from evoros.config.jobs import Job
from evoros.executor.processes import Processes
from evoros.executor.protocol import Executor, Pool
from evoros.session.progress import SweepProgress
from evoros.session.run import Session
from evoros.session.status import Display
from evoros.session.work import DrawFigures, PoolOpener, open_pool
from evoros.terminal.console import DONE, STOPPED
from evoros.terminal.log import (
    LOGGER,
    attach,
    collect_messages,
    format_for_terminal,
    log_everything,
    log_for_job,
    log_to_file,
)

ONE = ("executor=processes", "executor.workers=1", "optimizer.generations=1")
TWO = ("executor=processes", "executor.workers=2", "optimizer.generations=2")


@dataclass
class Cores(Executor):
    """An executor that counts how often it was opened, and ends what waits when it is closed."""

    workers: int
    shares_files: bool = True
    opened: int = 0
    given: list["Future[Any]"] = field(default_factory=list)
    closed: threading.Event = field(default_factory=threading.Event)

    @contextmanager
    def open(self) -> Iterator[Pool]:
        self.opened += 1
        try:
            yield self
        finally:
            for future in self.given:
                if not future.done():
                    future.set_exception(CancelledError())
            self.closed.set()

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        self.given.append(Future())
        return self.given[-1]


@dataclass
class Fake:
    """Work that does something with its pool."""

    executor: Executor
    do: Callable[[Pool], object]
    task: None = None

    def run(self, display: Display, draw: DrawFigures, opener: PoolOpener = open_pool) -> None:
        with opener(self.executor) as pool:
            self.do(pool)


def sweep_of(works: list[Fake], names: str) -> tuple[Sweep, list[Job], dict[str, str]]:
    """The sweep, its jobs, and what will be said of each."""
    said: dict[str, str] = {}
    by_name = dict(zip(names, works, strict=True))

    def explain(path: Path, error: BaseException) -> JobResult:
        return JobResult(1, type(error).__name__)

    def tell(path: Path, result: JobResult) -> None:
        assert threading.current_thread() is threading.main_thread()
        said[path.name] = result.message

    def build(job: Job) -> Session:
        return cast(Session, by_name[job.folder.name])

    sweep = Sweep(build, explain, tell, SweepProgress(len(works), shown=False))
    return sweep, [Job(None, Path(name)) for name in names], said  # type: ignore[arg-type]


# ---- the command


@pytest.mark.slow
def test_the_folders_of_a_sweep_are_those_of_its_runs_alone(
    tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    opened: list[Processes] = []
    real = Processes.open

    def counted(self: Processes) -> Any:
        opened.append(self)
        return real(self)

    monkeypatch.setattr(Processes, "open", counted)
    arguments = [*TINY, *TWO, f"hydra.sweep.dir={tmp_path / 'sweep'}"]
    swept = ["seed=0,2", "simulator.fault=none,raise,fail"]
    assert evoros(["-m", *arguments, *swept]) == STOPPED
    out, err = capsys.readouterr()
    assert len(opened) == 1
    name = "experiment-tiny_executor-processes_workers-2_generations-2_seed-{}_fault-{}"
    for seed in (0, 2):
        run = tmp_path / "sweep" / name.format(seed, "none")
        alone = tmp_path / f"alone {seed}"
        assert tiny(alone, "optimizer.generations=2", f"seed={seed}") == DONE
        assert content(run) == content(alone)
        log = (run / "evoros.log").read_text()
        assert len(re.findall(r"INFO generation \d/1: ", log)) == 2
        assert all(str(path) not in log for path in run.parent.iterdir() if path != run)
        failed = tmp_path / "sweep" / name.format(seed, "raise")
        assert "ZeroDivisionError" in (failed / "evoros.log").read_text()
        (told,) = [line for line in err.splitlines() if line.startswith(f"evoros: {failed.name}: ")]
        assert "_happen: the mission of design " in told
        assert "correct the code and start a new run" in told
        assert out.count(f"run folder        {run}, with champion/\n") == 1
        warning = tmp_path / "sweep" / name.format(seed, "fail")
        warned = re.findall(r"WARNING (.*)", (warning / "evoros.log").read_text())
        assert len(warned) >= 4
        shown = [line for line in err.splitlines() if line.startswith(f"{warning.name}: ")]
        assert shown == [f"{warning.name}: {line}" for line in warned]
    whole = r"champion  .*\n(?:(?!champion  ).*\n)*?run folder"  # no summary within another
    assert out.count("champion  ") == len(re.findall(whole, out))
    assert "generation 0/1" not in err  # which would mix those of several runs


@pytest.mark.slow
def test_runs_with_different_executors_do_not_compete(tmp_path: Path, monkeypatch: Patch) -> None:
    open_now, most = [0], [0]
    real = Processes.open

    @contextmanager
    def watched(self: Processes) -> Iterator[Pool]:
        open_now[0] += 1
        most[0] = max(most[0], open_now[0])
        with real(self) as pool:
            yield pool
        open_now[0] -= 1

    monkeypatch.setattr(Processes, "open", watched)
    arguments = [*TINY, *ONE, f"hydra.sweep.dir={tmp_path / 'sweep'}"]
    assert evoros(["-m", *arguments, "executor.retries=0,1"]) == DONE
    assert (open_now, most) == ([0], [1])
    assert len(list((tmp_path / "sweep").glob("*/champion/design.csv"))) == 2


# ---- the jobs


@pytest.mark.parametrize("workers", [1, 2, 8, 64])
def test_enough_jobs_are_under_way_and_no_more(workers: int) -> None:
    cores, running, most, changed = Cores(workers), [0], [0], threading.Condition()
    enough = min(jobs_at_once(workers), 26)

    def work(pool: Pool) -> None:
        with changed:
            running[0] += 1
            most[0] = max(most[0], running[0])
            changed.notify_all()
            # a job ends once as many as shall be under way have been, however slow the machine
            changed.wait_for(lambda: most[0] >= enough, timeout=60)
        time.sleep(0.02)  # so that one too many would be seen
        with changed:
            running[0] -= 1

    names = [chr(ord("a") + i) for i in range(26)]
    sweep, jobs, said = sweep_of([Fake(cores, work) for _ in names], "".join(names))
    for job in jobs:
        sweep.begin(job)
    sweep.finish()
    sweep.close()
    assert said == dict.fromkeys(names, "")
    assert cores.opened == 1
    assert most[0] == enough


def test_with_one_worker_jobs_run_in_the_main_thread() -> None:
    seen: list[threading.Thread] = []
    work = [Fake(Cores(1), lambda pool: seen.append(threading.current_thread())) for _ in "ab"]
    sweep, jobs, _ = sweep_of(work, "ab")
    for job in jobs:
        sweep.begin(job)
        assert len(seen) == "ab".index(job.folder.name) + 1
    sweep.close()
    assert set(seen) == {threading.main_thread()}


def test_an_error_in_one_job_stops_no_other() -> None:
    cores = Cores(2)

    def fail(pool: Pool) -> None:
        raise ZeroDivisionError

    sweep, jobs, said = sweep_of([Fake(cores, fail), Fake(cores, lambda pool: None)] * 2, "abcd")
    for job in jobs:
        sweep.begin(job)
    sweep.finish()
    sweep.close()
    assert said == {"a": "ZeroDivisionError", "b": "", "c": "ZeroDivisionError", "d": ""}
    assert sorted(result.status for _, result in sweep.results) == [0, 0, 1, 1]


def test_closing_interrupts_whoever_waits_and_whoever_asks_for_more() -> None:
    cores = Cores(2)

    def wait(pool: Pool) -> None:
        pool.submit(len, "").result()

    def ask_later(pool: Pool) -> None:
        assert cores.closed.wait(60)
        raise RuntimeError("this pool is closed")

    sweep, jobs, said = sweep_of([Fake(cores, wait), Fake(cores, ask_later)], "ab")
    for job in jobs:
        sweep.begin(job)
    while not cores.given:
        time.sleep(0.01)
    sweep.close()
    assert said == {"a": "KeyboardInterrupt", "b": "KeyboardInterrupt"}


def test_a_job_that_was_waiting_for_its_turn_has_not_begun() -> None:
    """Ctrl-C comes most likely then: the user is to repeat the command for the last one, too."""

    class Waiting:
        begun = 0

        def begin(self, job: Job) -> None:
            if self.begun == 2:
                raise KeyboardInterrupt
            self.begun += 1

        def finish(self) -> None: ...
        def close(self) -> None: ...

    jobs: Any = [Job(None, Path(name)) for name in "abc"]  # type: ignore[arg-type]
    signals: Any = SimpleNamespace(last=None)
    assert begin_all(jobs, Waiting(), signals) == 2  # type: ignore[arg-type]


# ---- messages


def test_threads_speak_on_behalf_of_their_own_jobs(tmp_path: Path) -> None:
    before = (LOGGER.level, LOGGER.handlers)
    together = threading.Barrier(3)

    def speak(name: str) -> None:
        with log_for_job(name), log_to_file(tmp_path / name):
            for index in range(50):
                if index == 25:
                    together.wait(60)
                LOGGER.info("%s %d", name, index)

    threads = [threading.Thread(target=speak, args=(name,)) for name in "abc"]
    with log_everything(), collect_messages() as said:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        LOGGER.info("of all")
    assert [record.getMessage() for record in said] == ["of all"]
    for name in "abc":
        lines = (tmp_path / name).read_text().splitlines()
        assert [line.split(" INFO ")[1] for line in lines] == [f"{name} {n}" for n in range(50)]
    assert before == (LOGGER.level, LOGGER.handlers)


def test_jobs_in_folders_of_the_same_name_keep_their_logs_apart(tmp_path: Path) -> None:
    """As with hydra.sweep.subdir='${failure}/${seed}'."""
    together = threading.Barrier(2)
    folders = [tmp_path / "one" / "0", tmp_path / "other" / "0"]

    def work(path: Path) -> Fake:
        def speak(pool: Pool) -> None:
            path.mkdir(parents=True)
            with log_to_file(path / "log"):
                together.wait(60)
                LOGGER.warning("from %s", path.parent.name)
                together.wait(60)

        return Fake(cores, speak)

    cores, shown = Cores(2), io.StringIO()
    sweep = Sweep(
        lambda job: cast(Session, work(job.folder)),
        lambda path, error: JobResult(1, repr(error)),
        lambda path, result: None,
        SweepProgress(2, shown=False),
    )
    with attach(format_for_terminal(logging.StreamHandler(shown))):
        for folder in folders:
            sweep.begin(Job(None, folder))  # type: ignore[arg-type]
        sweep.finish()
        sweep.close()
    assert [result.status for _, result in sweep.results] == [0, 0]
    for folder in folders:
        (line,) = (folder / "log").read_text().splitlines()
        assert line.endswith(f"WARNING from {folder.parent.name}")
    said = [line for line in shown.getvalue().splitlines() if not line.endswith(": started")]
    assert sorted(said) == ["0: from one", "0: from other"]


def test_what_another_thread_says_goes_into_the_log_of_a_run_alone(tmp_path: Path) -> None:
    with log_to_file(tmp_path / "log"):
        thread = threading.Thread(target=LOGGER.info, args=("from a thread of a part",))
        thread.start()
        thread.join()
    assert "from a thread of a part" in (tmp_path / "log").read_text()


def test_the_line_of_a_sweep_counts_and_promises(monkeypatch: Patch) -> None:
    now = [0.0]
    monkeypatch.setattr("evoros.session.progress.time.monotonic", lambda: now[0])
    display = SweepProgress(4, shown=False)
    assert display.line(79) == "0 of 4 done | 0:00:00 elapsed"
    flown: Any = (type("Flown", (), {"time_s": 30.0}),)
    with display.job() as one:
        now[0] += 100.0  # to compile; is no measure of what follows
        one.start(1)
        one.begin(0, 10, 0)
        for _ in range(5):
            now[0] += 1.0
            one.mission(None, flown)  # type: ignore[arg-type]
        line = display.line(79)
        assert line == "0 of 4 done | 1 running | missions 5 | 30 simulated s/s | 0:00:35 left"
    with display.job():
        assert display.line(79).startswith("1 of 4 done | 1 running | ")
    display.skip()  # two of three have run, in 5 s
    assert display.line(79) == "3 of 4 done | missions 5 | 30 simulated s/s | 0:00:02 left"


def test_levels_and_logging_to_nowhere_are_as_before() -> None:
    level = LOGGER.level
    with log_everything():
        assert LOGGER.isEnabledFor(logging.DEBUG)
    assert LOGGER.level == level
