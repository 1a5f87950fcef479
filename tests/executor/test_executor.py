"""Every executor computes; worker processes are set up as documented."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from executor_calls import meet, process_id, square, threads_of_numpy
from hydra.utils import instantiate
from omegaconf import OmegaConf

from evoros.base.errors import InputError
from evoros.executor.processes import Processes, available_cores
from evoros.executor.protocol import Executor, Pool
from evoros.executor.serial import Serial
from evoros.executor.threads import ONE_THREAD
from evoros.files.resources import bundled_folder

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc")

FOLDER = bundled_folder("conf") / "executor"
CONFIGURATIONS = sorted(path for path in FOLDER.glob("*.yaml") if path.stem != "mpi")
"""All but that of MPI, which needs a job; test_mpi.py starts some."""


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Processes(workers=2, retries=1, time_limit_s=60).open() as pool:
        yield pool


@pytest.mark.parametrize("path", CONFIGURATIONS, ids=lambda path: path.stem)
def test_each_configuration_builds_an_executor_that_computes(path: Path) -> None:
    configuration = OmegaConf.load(path)
    executor = instantiate(configuration, _convert_="all")
    assert isinstance(executor, Executor)
    assert {"_target_", *vars(executor)} == set(configuration)
    with executor.open() as pool:
        assert pool.workers >= 1
        assert pool.submit(square, 7).result() == 49
        with pytest.raises(ZeroDivisionError):
            pool.submit(divmod, 1, 0).result()


@pytest.mark.parametrize("executor", [Processes(workers=1), Processes(workers=3), Serial()])
def test_results_are_those_of_plain_calls_in_the_order_of_submission(executor: Executor) -> None:
    with executor.open() as pool:
        futures = [pool.submit(square, n) for n in range(40)]
        assert [future.result() for future in futures] == [square(n) for n in range(40)]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *[("workers", value) for value in (-1, 1.0, "all", True, float("nan"))],
        *[("time_limit_s", value) for value in (0, -1, None, "10", float("inf"), True)],
        *[("retries", value) for value in (-1, None, 0.5, "1", False)],
        *[("calls_per_worker", value) for value in (0, -3, 2.0, "never", True)],
    ],
)
def test_a_bad_value_is_refused_in_one_line_that_names_it(key: str, value: object) -> None:
    with pytest.raises(InputError) as refusal:
        Processes(**{key: value})  # type: ignore[arg-type]
    text = str(refusal.value)
    assert "\n" not in text
    assert f"Processes.{key}: must be" in text
    assert repr(value) in text


def test_no_number_of_workers_means_the_cores_that_this_process_may_use() -> None:
    assert Processes(workers=0).workers == available_cores()
    assert instantiate({"_target_": "evoros.executor.processes.Processes", "workers": None}) == (
        Processes()
    )
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        assert Processes().workers == 1
    finally:
        os.sched_setaffinity(0, cores)


def test_as_many_calls_as_workers_run_at_the_same_time(pool: Pool, tmp_path: Path) -> None:
    here, there = str(tmp_path / "here"), str(tmp_path / "there")
    meetings = [pool.submit(meet, here, there), pool.submit(meet, there, here)]
    assert all(meeting.result(60) for meeting in meetings)


def test_numeric_libraries_get_one_thread_in_workers_and_keep_theirs_here(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "5")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    before = dict(os.environ)
    with Processes(workers=1).open() as pool:
        assert pool.submit(threads_of_numpy).result(60) == dict.fromkeys(ONE_THREAD, "1")
    assert dict(os.environ) == before


def test_a_fresh_process_takes_over_after_so_many_calls() -> None:
    with Processes(workers=1, calls_per_worker=2).open() as pool:
        ids = [pool.submit(process_id).result(60) for _ in range(5)]
    assert [ids.index(pid) for pid in ids] == [0, 0, 2, 2, 4]


def test_a_class_in_a_folder_on_the_path_reaches_the_workers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "users_own_part.py").write_text(
        "class Part:\n    def __init__(self, n):\n        self.n = n\n"
        "    def doubled(self):\n        return Part(2 * self.n)\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    part = __import__("users_own_part").Part(4)
    with Processes(workers=1).open() as pool:
        assert pool.submit(part.doubled).result(60).n == 8
