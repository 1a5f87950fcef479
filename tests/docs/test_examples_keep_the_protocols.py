"""Each example of a part in docs/parts passes the suite that its readers inherit."""

from functools import cached_property
from pathlib import Path
from typing import Any

import pytest
import yaml
from documents import part_files
from hydra.utils import instantiate

from evoros.config.compose import add_config_dir
from evoros.formats.urdf.expansion import read
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.observers.protocol import ObservedRun
from evoros.testing import (
    AllocationSuite,
    DriveSuite,
    ExecutorSuite,
    FailureSuite,
    FilterSuite,
    FitnessSuite,
    LayerSuite,
    LiveControllerSuite,
    MeasureSuite,
    ObserverSuite,
    OptimizerSuite,
    RangeSensorSuite,
    RegionSuite,
    SignalSensorSuite,
    SimulatorSuite,
)

USED: list[str] = []
"""The files of examples that a suite below checks."""
READ_BY_EVOROS = {"robot/cart", "world/yard", "world/course/there_and_back"}
"""Files that describe no class of the reader's own."""


def example(file: str, *keys: str, **values_of_others: Any) -> Any:
    """A fixture for a suite: run it on the part of a YAML file of a page, or on one inside.

    ``values_of_others`` are values that other files give.
    """
    USED.append(file)

    @pytest.fixture(autouse=True)
    def choose(self: Any, mine: Path) -> None:
        loaded = yaml.safe_load((add_config_dir("mine") / f"{file}.yaml").read_text())
        values = {key: value for key, value in loaded.items() if key != "defaults"}
        for key in keys:
            values = values[key]
        self.part = instantiate(values, **values_of_others, _convert_="all")

    return choose


def test_every_example_has_a_suite() -> None:
    given = {Path(path) for path in part_files() if path.endswith(".yaml")}
    names = {str(path.relative_to("mine").with_suffix("")) for path in given}
    assert names == {*USED, *READ_BY_EVOROS}


class TestDrive(DriveSuite):
    choose = example(
        "drive/worn",
        steering_joints=["front_left_steering_joint", "front_right_steering_joint"],
        front_wheel_joints=["front_left_wheel_joint", "front_right_wheel_joint"],
        rear_wheel_joints=["rear_left_wheel_joint", "rear_right_wheel_joint"],
        steering_limit_rad=0.6,
        max_speed_mps=0.4,
    )

    @cached_property
    def urdf(self) -> Urdf:
        return read_tree(read("erle_rover/erle_rover.xacro")[1], "rover.urdf")


class TestRegion(RegionSuite):
    choose = example("design/rim", "regions", "rim")


class TestRangeSensor(RangeSensorSuite):
    choose = example("sensor/laser")


class TestSignalSensor(SignalSensorSuite):
    choose = example("sensor/tripmeter")
    simulated_by_gazebo = False


class TestFilter(FilterSuite):
    choose = example("filter/dazzle")


class TestFailure(FailureSuite):
    choose = example("failure/frontal")


class TestFailureOfParts(FailureSuite):
    choose = example("failure/blow")


class TestLayer(LayerSuite):
    choose = example("controller/navigation/direct")


class TestLiveController(LiveControllerSuite):
    choose = example("controller/outside")


class TestSimulator(SimulatorSuite):
    choose = example("simulator/kinematic")


class TestFitness(FitnessSuite):
    choose = example("fitness/careful")


class TestMeasure(MeasureSuite):
    choose = example("measure/foremost")


class TestOptimizer(OptimizerSuite):
    choose = example("optimizer/hill_climber")


class TestAllocation(AllocationSuite):
    choose = example("allocation/second_look")


class TestExecutor(ExecutorSuite):
    choose = example("executor/standard")


class TestObserver(ObserverSuite):
    choose = example("observers/notebook", "notebook")

    def read(self, run: ObservedRun) -> Any:
        (file,) = (run.origin / "notebook").glob(f"*_{run.id}.txt")
        return file.read_text()
