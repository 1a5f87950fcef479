"""``executor=gpu``: machines without a GPU, and the same bytes by its kernel on this machine."""

import logging
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from fixture_types import Log, Patch
from mission_cases import COMBINATIONS, SHORT, experiment_of, missions, same
from proposal_sites import is_of

from evoros.base.errors import InputError, RunStopped
from evoros.cli.main import evoros
from evoros.compilation.device import DeviceError, Host
from evoros.dispatch import calls
from evoros.dispatch.calls import Asked, pack, run_batches
from evoros.dispatch.dispatcher import Dispatcher
from evoros.executor.processes import Processes
from evoros.executor.protocol import BatchPool
from evoros.mission.batch import Batcher
from evoros.mission.rollout import run_mission
from evoros.plugins.gpu import executor as gpu
from evoros.plugins.gpu.cuda import import_driver, require_gpu
from evoros.plugins.gpu.executor import Gpu, GpuBatches, Joining, Part
from evoros.plugins.gpu.tests.gpu_cases import Result, StandInDriver
from evoros.terminal.console import STOPPED
from evoros.testing import ExecutorSuite

SMALL = ["optimizer.population_size=4", "optimizer.generations=2", "figures=[]", *SHORT]
TOGETHER = ["executor=gpu", "executor.device=cpu"]


class TestGpu(ExecutorSuite):
    part = Gpu(workers=1, device="cpu")
    bad_values = ({"device": "tpu"}, {"missions": 0}, {"fallback": "wait"})


@pytest.mark.parametrize(
    ("driver", "reason"),
    [
        (StandInDriver(gpus=0), "no GPU was found"),
        (object(), "cuInit: 'object' object has no attribute 'cuInit'"),
    ],
    ids=["no GPU", "no driver"],
)
def test_a_machine_without_a_gpu_is_found_at_the_start(driver: Any, reason: str) -> None:
    with pytest.raises(DeviceError) as caught:
        require_gpu(driver)
    assert str(caught.value) == reason


def test_a_driver_that_reports_none_is_asked_no_more() -> None:
    driver = StandInDriver()
    driver.errors["cuInit"] = Result.CUDA_ERROR_NO_DEVICE
    with pytest.raises(DeviceError, match=r"^cuInit of the driver reports CUDA_ERROR_NO_DEVICE$"):
        require_gpu(driver)


def test_the_package_is_named_where_it_is_not_installed(monkeypatch: Patch) -> None:
    monkeypatch.setitem(sys.modules, "cuda", None)
    monkeypatch.setitem(sys.modules, "cuda.bindings", None)
    with pytest.raises(InputError, match=r"^executor=gpu: needs .* pip install 'evoros\[gpu\]'$"):
        import_driver()


@pytest.fixture
def lacking(monkeypatch: Patch) -> None:
    monkeypatch.setattr(gpu, "_find_lack", lambda: "there is no GPU")


@pytest.mark.usefixtures("lacking")
def test_without_a_gpu_missions_run_on_the_cpu_and_one_line_says_so(caplog: Log) -> None:
    with caplog.at_level(logging.WARNING), Gpu(workers=1).open() as pool:
        assert not isinstance(pool, BatchPool)
    (record,) = caplog.records
    assert record.getMessage().startswith("executor.device=gpu: there is no GPU; missions run on")


@pytest.mark.usefixtures("lacking")
def test_or_the_run_stops_and_can_be_resumed() -> None:
    with (
        pytest.raises(RunStopped, match=r"^executor\.device=gpu: there is no GPU; resume .*"),
        Gpu(workers=1, fallback="stop").open(),
    ):
        raise AssertionError


class Failing:
    """A batcher whose device falls off; counts how often it was asked."""

    asked = 0

    def run(self, *arguments: Any) -> None:
        self.asked += 1
        raise DeviceError("cuCtxSynchronize of the driver reports CUDA_ERROR_ECC_UNCORRECTABLE")


@pytest.fixture
def failing(monkeypatch: Patch) -> Failing:
    device = Failing()
    monkeypatch.setattr(calls, "_open_batcher", lambda name: device)
    monkeypatch.setattr(calls, "_notes", {})
    return device


def call(fallback: str, device: str = "gpu") -> Any:
    experiment = experiment_of(*COMBINATIONS[1])
    batches = GpuBatches(device, 8, fallback)
    chosen = missions(experiment, 1)
    (answer,) = run_batches(batches, [Asked(chosen, 1e9, True)], pack(experiment.scenario))
    return answer


def test_a_gpu_that_falls_off_is_replaced_by_the_cpu(failing: Failing) -> None:
    experiment = experiment_of(*COMBINATIONS[1])
    alone = [run_mission(experiment.scenario, mission) for mission in missions(experiment, 1)]
    for _ in range(2):
        answer = call("cpu")
        assert all(map(same, answer.results, alone))
        assert answer.note.startswith("executor.device=gpu: cuCtxSynchronize of the driver rep")
        assert answer.note.endswith("missions run on the CPU, as with executor=processes")
    assert failing.asked == 1


def test_or_ends_the_run_which_can_be_resumed(failing: Failing) -> None:
    for _ in range(2):
        with pytest.raises(RunStopped, match=r"cuCtxSynchronize of the driver reports ") as told:
            call("stop")
        assert is_of(str(told.value), "evoros/plugins/gpu/executor.py executor.fallback=cpu")
    note = call("cpu").note
    assert is_of(note, "evoros/plugins/gpu/executor.py executor=processes")
    experiment = experiment_of(*COMBINATIONS[1], "executor=processes", "executor.workers=1")
    with experiment.executor.open() as pool:
        assert pool.submit(abs, -1).result(60) == 1


def test_a_call_runs_missions_together(monkeypatch: Patch) -> None:
    monkeypatch.setattr(calls, "_open_batcher", lambda name: Batcher(Host()))
    experiment = experiment_of(*COMBINATIONS[1])
    answer = call("cpu", "cpu")
    assert answer.note == ""
    assert answer.timed == len(answer.results) == len(missions(experiment, 1))
    for mission, result in zip(missions(experiment, 1), answer.results, strict=True):
        assert same(result, run_mission(experiment.scenario, mission))


class InProcess:
    """A pool that runs batches in this process; keeps how many missions each call had."""

    workers, shares_files = 1, True
    batches = GpuBatches("gpu", 4, "cpu")

    def __init__(self) -> None:
        self.sizes: list[int] = []

    def join(
        self, function: Any, run: object, share: float, shared: Any, asked: Asked
    ) -> "Future[Any]":
        self.sizes.append(len(asked.missions))
        future: Future[Any] = Future()
        future.set_result(function(self.batches, [asked], shared)[0])
        return future

    def submit(self, function: Any, /, *args: Any) -> "Future[Any]":
        raise AssertionError


def test_calls_grow_to_whole_launches(monkeypatch: Patch) -> None:
    monkeypatch.setattr(calls, "_open_batcher", lambda name: Batcher(Host()))
    monkeypatch.setattr(calls, "_notes", {})
    pool, experiment = InProcess(), experiment_of(*COMBINATIONS[1])
    results = list(Dispatcher(pool, "stop").run(experiment.scenario, missions(experiment, 8)))
    assert sum(map(len, results)) == sum(pool.sizes) == len(missions(experiment, 8))
    assert max(pool.sizes) == pool.batches.missions


@pytest.mark.usefixtures("failing")
def test_what_workers_note_is_told_once(caplog: Log) -> None:
    pool, experiment = InProcess(), experiment_of(*COMBINATIONS[1])
    results = list(Dispatcher(pool, "stop").run(experiment.scenario, missions(experiment, 8)))
    assert sum(map(len, results)) == len(missions(experiment, 8))
    assert len(pool.sizes) > 1
    (line,) = [r.getMessage() for r in caplog.records if "executor.device" in r.getMessage()]
    assert line.endswith("missions run on the CPU, as with executor=processes")


@pytest.mark.slow
def test_a_run_has_the_same_bytes(tmp_path: Path) -> None:
    tables = []
    for name, executor in (("alone", ["serial"]), ("together", ["gpu", "executor.device=cpu"])):
        chosen = [f"executor={executor[0]}", *executor[1:], f"hydra.run.dir={tmp_path / name}"]
        assert evoros([*SMALL, *chosen]) == 0
        tables.append((tmp_path / name / "missions.csv").read_bytes())
        assert "one after another" not in (tmp_path / name / "evoros.log").read_text()
    assert tables[0] == tables[1]


class Thread:
    """A worker that is a thread of this process; it begins once so many runs have asked it."""

    workers, shares_files = 1, True

    def __init__(self, runs: int) -> None:
        self._wanted, self._runs = runs, list[object]()
        self._changed, self._thread = threading.Condition(), ThreadPoolExecutor(1)

    def note(self, run: object) -> None:
        with self._changed:
            self._runs += [run] if all(run is not other for other in self._runs) else []
            self._changed.notify_all()

    def submit(self, function: Any, /, *args: Any) -> "Future[Any]":
        return self._thread.submit(self._call, function, *args)

    def _call(self, function: Any, /, *args: Any) -> Any:
        with self._changed:
            self._changed.wait_for(lambda: len(self._runs) >= self._wanted, timeout=60)
        return function(*args)


@dataclass
class Launches:
    """The launches of a command with a worker in this process, as their numbers of missions."""

    monkeypatch: Patch
    sizes: list[int] = field(default_factory=list)

    def run(self, arguments: list[str], runs: int) -> int:
        """Run a command, whose worker waits for so many runs; return its status."""
        worker, add, launch = Thread(runs), Joining.add, Host.launch
        self.sizes.clear()

        @contextmanager
        def opened(executor: Processes) -> Iterator[Thread]:
            yield worker

        def noted(joining: Joining, part: Part) -> Any:
            worker.note(part.run)
            return add(joining, part)

        def counted(host: Host, *call: Any) -> None:
            self.sizes.append(call[-1])
            launch(host, *call)

        with self.monkeypatch.context() as patch:
            patch.setattr(Processes, "open", opened)
            patch.setattr(Joining, "add", noted)
            patch.setattr(Host, "launch", counted)
            return evoros(arguments)


def tables_of(sweep: Path) -> set[bytes]:
    """The missions of the runs in a folder."""
    return {table.read_bytes() for table in sweep.glob("*/missions.csv")}


@pytest.mark.slow
def test_a_sweep_launches_missions_of_all_its_runs_together(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    launches, alone, missions_alone = Launches(monkeypatch), 0, 0
    for seed in (0, 1, 2):
        folder = f"hydra.run.dir={tmp_path / 'alone' / str(seed)}"
        assert launches.run([*SMALL, *TOGETHER, f"seed={seed}", folder], 1) == 0
        alone, missions_alone = alone + len(launches.sizes), missions_alone + sum(launches.sizes)
    serial = ["executor=serial", "seed=0,1,2", f"hydra.sweep.dir={tmp_path / 'serial'}"]
    assert evoros(["-m", *SMALL, *serial]) == 0
    sweep = f"hydra.sweep.dir={tmp_path / 'sweep'}"
    assert launches.run(["-m", *SMALL, *TOGETHER, "seed=0,1,2", sweep], 3) == 0
    assert len(launches.sizes) < alone
    assert sum(launches.sizes) == missions_alone
    assert len(tables_of(tmp_path / "sweep")) == 3
    assert tables_of(tmp_path / "sweep") == tables_of(tmp_path / "alone")
    assert tables_of(tmp_path / "sweep") == tables_of(tmp_path / "serial")


@pytest.mark.slow
def test_a_run_of_a_sweep_that_fails_leaves_the_others_alone(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    run = Batcher.run

    def fail(batcher: Batcher, asked: Any) -> Any:
        for scenario, _ in asked:
            if any(place.course.time_limit_s == 7.0 for place in scenario.world.values()):
                raise ZeroDivisionError
        return run(batcher, asked)

    monkeypatch.setattr(Batcher, "run", fail)
    sweep = ["course.time_limit_s=5,6,7", f"hydra.sweep.dir={tmp_path / 'sweep'}"]
    assert Launches(monkeypatch).run(["-m", *SMALL, *TOGETHER, *sweep], 3) == STOPPED
    sweep = ["course.time_limit_s=5,6", f"hydra.sweep.dir={tmp_path / 'serial'}"]
    assert evoros(["-m", *SMALL, "executor=serial", *sweep]) == 0
    assert len(tables_of(tmp_path / "serial")) == 2
    assert tables_of(tmp_path / "serial") < tables_of(tmp_path / "sweep")
