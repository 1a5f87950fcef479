"""MPI jobs under real faults: a rank killed, stopped or unfit; calls that crash and hang."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from executor_calls import alive, noted, wait_until
from helpers import TINY, content, resume, start, tiny, wait_for_missions
from mpi_cases import start_job

from evoros.base.errors import InputError
from evoros.executor.mpi import Mpi
from evoros.executor.mpi_heartbeat import FIRST_S, SILENT_S, WARN_S, Silences
from evoros.terminal.console import DONE, STOPPED

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc"),
]

LIMIT_S = 120.0
RUN = ("-m", "evoros", *TINY, "executor=mpi", "hydra.run.dir=run")
TESTS = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """A run in one process."""
    run = tmp_path_factory.mktemp("whole") / "run"
    assert tiny(run) == DONE
    return content(run)


@pytest.mark.slow
def test_a_run_in_ranks_is_the_same_and_leaves_no_process(
    whole: dict[str, str], tmp_path: Path
) -> None:
    """Nor do the folders of the user's parts matter, which only the first rank sees."""
    job = start_job(3, [*RUN, "simulator.pause_s=0.05"], tmp_path)
    wait_for_missions(tmp_path / "run", 4)
    ranks = ranks_of(job)
    assert len(ranks) == 3
    _, errors = job.communicate(timeout=LIMIT_S)
    assert job.returncode == DONE, errors
    assert content(tmp_path / "run") == whole
    assert wait_until(lambda: not any(map(alive, ranks)), LIMIT_S)


@pytest.mark.slow
def test_a_killed_rank_ends_the_job_and_the_run_goes_on_without_mpi(
    whole: dict[str, str], tmp_path: Path
) -> None:
    job = start_job(3, [*RUN, "simulator.pause_s=0.05"], tmp_path)
    wait_for_missions(tmp_path / "run", 8)
    os.kill(ranks_of(job)[-1], signal.SIGKILL)
    _, errors = job.communicate(timeout=LIMIT_S)
    assert job.returncode not in (DONE, None)
    assert "rank 2" in errors
    assert "to continue type: evoros resume run" in errors
    assert "Traceback" not in errors
    assert resume(tmp_path / "run", "executor=serial") == DONE
    assert content(tmp_path / "run") == whole


@pytest.mark.slow
def test_a_run_that_was_not_started_as_a_job_is_told_how(tmp_path: Path) -> None:
    run = start([*TINY, "executor=mpi", "hydra.run.dir=run"], tmp_path)
    _, errors = run.communicate(timeout=LIMIT_S)
    assert run.returncode == STOPPED
    *_, line = errors.splitlines()  # behind the progress of a slow start
    assert "mpiexec -n RANKS python -m mpi4py.futures -m evoros" in line
    assert "to continue type: evoros resume run" in line


@pytest.mark.slow
def test_a_rank_with_other_software_stops_the_run_in_one_line(tmp_path: Path) -> None:
    package = tmp_path / "other" / "numba-0.0.1.dist-info"
    package.mkdir(parents=True)
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: numba\nVersion: 0.0.1\n")
    job = start_job(2, RUN, tmp_path, {"PYTHONPATH": str(package.parent)})
    _, errors = job.communicate(timeout=LIMIT_S)
    (line,) = (text for text in errors.splitlines() if text.startswith("evoros: "))
    assert "executor=mpi: rank 1 on " in line
    assert "numba 0.0.1 and not" in line
    assert job.returncode != DONE


FAULTS = """
import signal, sys
sys.path.append(sys.argv[1])
from executor_calls import die, fail, segfault, sleep_long, square
from evoros.executor.mpi import Mpi
if __name__ == "__main__":
    with Mpi(time_limit_s=4, retries=1).open() as pool:
        print(pool.workers)
        calls = [
            pool.submit(die, "killed", -signal.SIGKILL),
            pool.submit(segfault, "segfault"),
            pool.submit(sleep_long, "sleeps"),
            pool.submit(fail, "fails", ValueError),
            *(pool.submit(square, n) for n in range(9)),
        ]
        for call in calls:
            error = call.exception(120)
            print(type(error).__name__ if error else call.result(), error or "")
"""


@pytest.mark.slow
def test_faults_in_ranks_cost_only_the_calls_that_have_them(tmp_path: Path) -> None:
    (tmp_path / "faults.py").write_text(FAULTS)
    job = start_job(3, ["faults.py", str(TESTS)], tmp_path)
    output, errors = job.communicate(timeout=LIMIT_S)
    assert job.returncode == DONE, errors
    workers, *lines = output.splitlines()
    assert workers == "2"
    names = [line.partition(" ")[0] for line in lines]
    assert names[:4] == ["WorkerLost", "WorkerLost", "WorkerLost", "ValueError"]
    assert names[4:] == [str(n * n) for n in range(9)]
    for line, said in zip(lines, ("signal 9", "signal 11", "time_limit_s = 4 s"), strict=False):
        assert "lost 2 times, the last time because it" in line
        assert said in line
    for name in ("killed", "segfault", "sleeps"):
        assert len(noted(tmp_path / name)) == 2
    assert len(noted(tmp_path / "fails")) == 1


STOPPED_RANK = """
import sys
sys.path.append(sys.argv[1])
from executor_calls import process_id, stop_worker
from mpi4py.futures import MPIPoolExecutor
from evoros.base.errors import RunStopped
from evoros.executor import mpi_transport
from evoros.executor.attempts import Limits
from evoros.executor.mpi_heartbeat import Silences
from evoros.executor.remote import RemotePool
if __name__ == "__main__":
    limits = Limits(time_limit_s=60, retries=0)
    transport = mpi_transport.MpiTransport(MPIPoolExecutor(main=False), 1, Silences(3.0))
    pool = RemotePool(transport, limits, False)
    assert pool.submit(process_id).result(60)
    try:
        pool.submit(stop_worker, "tally").result(60)
    except RunStopped as error:
        print(error, flush=True)
    pool.close()
    transport.close()
"""


@pytest.mark.slow
def test_a_stopped_rank_ends_the_run_which_mpi_would_not_notice(tmp_path: Path) -> None:
    (tmp_path / "stopped.py").write_text(STOPPED_RANK)
    job = start_job(2, ["stopped.py", str(TESTS)], tmp_path)
    output, errors = job.communicate(timeout=LIMIT_S)
    assert output.startswith("executor=mpi: rank 1 on "), errors
    assert "has been silent for 3 s; start the job without its machine" in output
    assert job.returncode == STOPPED, errors


def test_silent_ranks_are_reported_once_and_then_lost(caplog: pytest.LogCaptureFixture) -> None:
    """However long their calls take; one that beats again is forgiven."""
    silences = Silences()
    assert not silences.pass_time(1.0, ["rank 1", "rank 2"], 2)
    for _ in range(int(WARN_S) + 1):
        assert not silences.pass_time(1.0, ["rank 1"], 2)
    assert [record.getMessage() for record in caplog.records] == [
        "executor=mpi: rank 2 has been silent for 15 s; the run stops if it is for 60 s"
    ]
    assert not silences.pass_time(1.0, ["rank 2", "rank 1"], 2)
    assert max(silences.by_rank.values()) == 0.0
    for _ in range(int(SILENT_S)):
        assert not silences.pass_time(1.0, ["rank 1"], 2)
    assert silences.pass_time(1.0, ["rank 1"], 2) == "rank 2 has been silent for 60 s"
    assert len(caplog.records) == 2


def test_a_rank_that_was_never_heard_is_lost_only_if_it_has_a_call() -> None:
    silences = Silences()
    assert not silences.pass_time(1.0, ["rank 1"], 1)
    for _ in range(int(FIRST_S)):
        assert not silences.pass_time(1.0, ["rank 1"], 1)
    for _ in range(int(FIRST_S)):
        assert not silences.pass_time(1.0, ["rank 1"], 2)
    assert "since it got its first call" in silences.pass_time(1.0, ["rank 1"], 2)


@pytest.mark.parametrize("values", [{"time_limit_s": 0}, {"retries": -1}, {"calls_per_worker": 0}])
def test_a_bad_value_is_refused_in_one_line(values: dict[str, float]) -> None:
    with pytest.raises(InputError, match=r"^Mpi\.\w+: must be [^\n]*$"):
        Mpi(**values)  # type: ignore[arg-type]


def ranks_of(job: "subprocess.Popen[str]") -> list[int]:
    """The processes of a job, in the order of their ranks."""
    done = subprocess.run(["pgrep", "-P", str(job.pid)], capture_output=True, text=True, check=True)
    return [int(line) for line in done.stdout.split()]
