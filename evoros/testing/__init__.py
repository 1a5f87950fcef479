"""Conformance suites: tests that all parts of a kind must pass, inherited by a test class.

    from evoros.testing import FilterSuite

    class TestDazzle(FilterSuite):
        part = Dazzle()

pytest then runs the tests of the suite on the part. evoros tests its parts this way, and never
imports this package at run time.
"""

from evoros.testing.allocation import AllocationSuite
from evoros.testing.controller import (
    ControllerSuite,
    EstimatorSuite,
    LayerSuite,
    LiveControllerSuite,
)
from evoros.testing.design import RegionSuite
from evoros.testing.drive import DriveSuite
from evoros.testing.executor import ExecutorSuite
from evoros.testing.failure import (
    AdaptiveFailureSuite,
    FailureSuite,
    SystematicFailureSuite,
    place_sensors,
)
from evoros.testing.filter import FilterSuite
from evoros.testing.fitness import FitnessSuite, MeasureSuite
from evoros.testing.observer import ObserverSuite
from evoros.testing.optimizer import OptimizerSuite
from evoros.testing.part import DescriptionSuite, PartSuite
from evoros.testing.requirement import require
from evoros.testing.rules import RuleSuite
from evoros.testing.sensor import ContactSensorSuite, RangeSensorSuite, SignalSensorSuite
from evoros.testing.simulator import SimulatorSuite

__all__ = [
    "AdaptiveFailureSuite", "AllocationSuite", "ContactSensorSuite", "ControllerSuite",
    "DescriptionSuite", "DriveSuite", "EstimatorSuite", "ExecutorSuite", "FailureSuite",
    "FilterSuite", "FitnessSuite", "LayerSuite", "LiveControllerSuite", "MeasureSuite",
    "ObserverSuite", "OptimizerSuite", "PartSuite", "RangeSensorSuite", "RegionSuite", "RuleSuite",
    "SignalSensorSuite", "SimulatorSuite", "SystematicFailureSuite", "place_sensors", "require",
]  # fmt: skip
