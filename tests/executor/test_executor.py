"""Every executor computes; worker processes are set up as documented."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from bundled_parts import every
from executor_calls import meet, process_id, threads_of_numpy
from hydra.utils import instantiate
from omegaconf import OmegaConf

from evoros.executor.processes import Processes, available_cores, read_quota
from evoros.executor.protocol import ONE_THREAD, Pool
from evoros.files.plugins import conf_folders
from evoros.testing import ExecutorSuite

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc")


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Processes(workers=2, retries=1, time_limit_s=60).open() as pool:
        yield pool


class TestConfiguredExecutors(ExecutorSuite):
    choose = every("executor", ["dask", "processes", "serial"])

    def test_its_configuration_has_its_fields(self, request: pytest.FixtureRequest) -> None:
        name = request.node.callspec.params["choose"]
        files = (folder / "executor" / f"{name}.yaml" for folder in conf_folders())
        configuration = OmegaConf.load(next(file for file in files if file.exists()))
        assert {"_target_", *vars(self.part)} == set(configuration)


class TestOneProcess(ExecutorSuite):
    part = Processes(workers=1)


class TestThreeProcesses(ExecutorSuite):
    part = Processes(workers=3)
    bad_values = (
        *({"workers": value} for value in (-1, 1.0, "all", True, float("nan"))),
        *({"time_limit_s": value} for value in (0, -1, None, "10", float("inf"), True)),
        *({"retries": value} for value in (-1, None, 0.5, "1", False)),
        *({"calls_per_worker": value} for value in (0, -3, 2.0, "never", True)),
    )


@pytest.mark.parametrize(
    ("files", "cores"),
    [
        ({}, sys.maxsize),
        ({"cpu.max": "max 100000"}, sys.maxsize),
        ({"cpu.max": "150000 100000"}, 2),
        ({"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}, sys.maxsize),
        ({"cpu/cpu.cfs_quota_us": "50000", "cpu/cpu.cfs_period_us": "100000"}, 1),
    ],
)
def test_the_quota_of_a_container_limits_the_cores(
    files: dict[str, str], cores: int, tmp_path: Path
) -> None:
    (tmp_path / "cpu").mkdir()
    for name, text in files.items():
        (tmp_path / name).write_text(text + "\n")
    assert read_quota(tmp_path) == cores


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
