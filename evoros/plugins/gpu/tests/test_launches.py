"""Batches of missions on a GPU: launches, the memory that they take, and errors of the driver."""

import pytest
from mission_cases import COMBINATIONS, assert_same, experiment_of, missions, run_together, same

from evoros.compilation.device import DeviceError
from evoros.mission.batch import Batcher, NoKernel
from evoros.mission.rollout import run_mission
from evoros.plugins.gpu.tests.gpu_cases import Result, StandInDriver, open_stand_in

TOO_OLD = " (the driver is too old; install a newer driver)"


def test_missions_of_several_experiments_are_one_launch() -> None:
    driver = StandInDriver()
    runner = Batcher(open_stand_in(driver))
    experiments = [experiment_of(*COMBINATIONS[k]) for k in (1, 0)]
    experiments.insert(1, experiment_of("simulator=physics"))
    asked = [(one.scenario, missions(one, 1)) for one in experiments]
    answers = runner.run(asked)
    assert isinstance(answers[1], NoKernel)
    for k in (0, 2):
        answer, alone = answers[k], [run_mission(asked[k][0], one) for one in asked[k][1]]
        assert isinstance(answer, list)
        assert all(map(same, answer, alone))
    assert driver.launches == [len(asked[0][1]) + len(asked[2][1])]
    assert not driver.taken


def test_a_gpu_is_driven_by_the_functions_of_its_driver() -> None:
    driver = StandInDriver()
    experiment = experiment_of(*COMBINATIONS[1])
    assert_same(experiment, Batcher(open_stand_in(driver)))
    assert driver.launches == [len(missions(experiment, 2))]
    assert not driver.taken


def test_too_many_missions_for_the_memory_are_launched_in_parts() -> None:
    driver = StandInDriver()
    experiment = experiment_of(*COMBINATIONS[1])
    runner, chosen = Batcher(open_stand_in(driver)), missions(experiment, 2)
    taken: list[int] = []
    take = driver.cuMemAlloc
    driver.cuMemAlloc = lambda size: taken.append(size) or take(size)  # type: ignore[method-assign,func-returns-value]
    assert_same(experiment, runner)
    driver.memory_size = taken[0] // 2
    driver.launches.clear()
    assert_same(experiment, runner)
    assert len(driver.launches) > 1
    assert sum(driver.launches) == len(chosen)
    driver.memory_size = 1
    with pytest.raises(DeviceError, match="cuMemAlloc of the driver reports CUDA_ERROR_OUT_OF_M"):
        run_together(runner, experiment, chosen)


def test_a_gpu_that_fails_gives_an_error_of_one_line_and_no_result() -> None:
    driver = StandInDriver()
    experiment = experiment_of(*COMBINATIONS[1])
    runner, chosen = Batcher(open_stand_in(driver)), missions(experiment, 1)
    for function, error, fix in (
        ("cuModuleLoadData", Result.CUDA_ERROR_UNSUPPORTED_PTX_VERSION, TOO_OLD),
        ("cuLaunchKernel", Result.CUDA_ERROR_ILLEGAL_ADDRESS, ""),
        ("cuCtxSynchronize", Result.CUDA_ERROR_ILLEGAL_ADDRESS, ""),
        ("cuMemcpyDtoH", Result.CUDA_ERROR_ILLEGAL_ADDRESS, ""),
    ):
        driver.errors = {function: error}
        with pytest.raises(DeviceError) as caught:
            run_together(runner, experiment, chosen)
        assert str(caught.value) == f"{function} of the driver reports {error.name}{fix}"
        assert not driver.taken
