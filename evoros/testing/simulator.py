"""Conformance tests for simulators."""

import math
from collections.abc import Iterator
from functools import cached_property
from importlib.metadata import version

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import CONTACT, STATE_SIZE, Array
from evoros.robot.model import Robot
from evoros.sensor.protocol import sees
from evoros.simulator.protocol import Simulator, open_alone
from evoros.testing.part import PartSuite
from evoros.testing.subjects import example_robot, example_world
from evoros.world.model import World

TICKS, TICK_S = 30, 0.1


class SimulatorSuite(PartSuite):
    """Conformance tests for a simulator, in which a rover drives curves among boxes."""

    part: Simulator
    protocol = Simulator
    together = False  # some engines support only one simulation at a time

    @cached_property
    def robot(self) -> Robot:
        """The robot with its sensors; override if the simulator requires a different robot."""
        return example_robot()

    @cached_property
    def world(self) -> World:
        """The world; override if the simulator requires a different world."""
        return example_world()

    def use(self, part: Simulator, seed: int) -> Iterator[tuple[Array, Array]]:
        """Drive for three seconds; yield state and signals."""
        robot, world, rng = (
            self.lend(self.robot),
            self.lend(self.world),
            np.random.default_rng(seed),
        )
        speed, phase = rng.uniform(0.2, 0.35), rng.uniform(0.0, 6.0)
        with open_alone(part.open, robot, world) as simulation:
            for tick in range(TICKS):
                state = np.full(STATE_SIZE, math.nan)
                signals = np.full(robot.signal_count, math.nan)
                simulation.observe(state)
                simulation.sense(signals)
                yield state, signals
                command = np.array([speed, 0.5 * elementary.sin(phase + 0.4 * tick)])
                simulation.advance(self.lend(command), TICK_S)

    def test_its_time_step_is_possible(self) -> None:
        """The time step is finite and positive."""
        assert 0 < self.part.time_step < math.inf, f"time_step is {self.part.time_step}"

    def test_its_packages_are_installed(self) -> None:
        """All packages are installed."""
        for name in self.part.packages:
            assert version(name), f"{name} must be an installed package"

    def test_states_and_signals_are_filled_with_finite_values(self) -> None:
        """``observe`` and ``sense`` fill every value."""
        for state, signals in self.use(self.part, 1):
            assert np.isfinite(state).all(), f"the state must be finite, not {state}"
            assert np.isfinite(signals).all(), f"signals must be finite, not {signals}"
            assert state[CONTACT] >= 0.0, f"the contact flag must not be {state[CONTACT]}"

    def test_ranges_are_within_the_limits_of_their_sensors(self) -> None:
        """Ranges are within the limits of their sensors."""
        robot = self.robot
        for _, signals in self.use(self.part, 1):
            for sensor, place in zip(robot.mounted_sensors(), robot.signal_layout, strict=True):
                if sees(sensor):
                    low, high = signals[place].min(), signals[place].max()
                    assert low >= sensor.range_min_m, f"{low} m is below range_min_m"
                    assert high <= sensor.range_max_m, f"{high} m is above range_max_m"

    def test_the_robot_starts_at_home_and_drives(self) -> None:
        """The robot starts at home and then moves."""
        x, y, _, yaw = self.world.course.home
        (first, _), *_, (last, _) = self.use(self.part, 1)
        at_home = np.allclose(first[:3], (x, y, yaw), atol=0.05)
        assert at_home, f"the robot must start at home, not at {first[:3]}"
        assert math.dist(first[:2], last[:2]) > 0.1, f"the robot must move, but ends at {last[:2]}"

    def test_a_mission_does_not_depend_on_another_world(self) -> None:
        """A simulation is independent of earlier simulations."""
        alone = self.record(self.part, 1)
        with open_alone(self.part.open, example_robot(0.3), example_world("blocks")) as other:
            other.advance(np.array([0.3, 0.2]), 1.0)
        again = self.record(self.part, 1)
        assert again == alone, "a mission in another world must not change the results"
