"""Conformance tests for design regions."""

import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np

from evoros.base import elementary
from evoros.design.protocol import ANGLES, POSITION, BoundRegion, RegionDescription, SensorPose
from evoros.robot.model import Robot
from evoros.testing.part import PartSuite
from evoros.testing.subjects import example_experiment

SHARES = 0.0, 0.25, 0.5, 1.0


class RegionSuite(PartSuite):
    """Conformance tests for a region of sensors, on the rover of the default configuration."""

    part: RegionDescription
    protocol = RegionDescription

    @cached_property
    def robot(self) -> Robot:
        """The robot with the region; override if the region requires a different robot."""
        return example_experiment().robot

    def bind(self, part: RegionDescription) -> BoundRegion:
        """Return the region bound to the robot."""
        sensors = list(example_experiment().design.sensors.values())
        return part.bind(self.lend(self.robot), False, "design.regions.example", sensors)

    def use(self, part: RegionDescription, seed: int) -> Iterator[object]:
        """Bind the region and place several sensors in it."""
        region, rng = self.bind(part), np.random.default_rng(seed)
        yield dict(region.ranges), region.link, region.area()
        for _ in range(5):
            drawn = {name: float(rng.uniform(*ends)) for name, ends in region.ranges.items()}
            yield region.place(self.lend(drawn))

    def place_some(self) -> Iterator[SensorPose]:
        """Place sensors at equal fractions of all ranges."""
        region = self.bind(self.part)
        for share in SHARES:
            ranges = region.ranges.items()
            yield region.place({name: low + share * (high - low) for name, (low, high) in ranges})

    def test_its_ranges_are_those_of_a_pose(self) -> None:
        """Each range is named after a pose coordinate, and has its minimum first."""
        for name, (low, high) in self.bind(self.part).ranges.items():
            assert name in (*POSITION, *ANGLES), f"{name} must be one of {(*POSITION, *ANGLES)}"
            assert -math.inf < low <= high < math.inf, f"{name} must not range from {low} to {high}"

    def test_its_link_can_carry_sensors(self) -> None:
        """The link is a sensor link of the robot, also for the area in figures."""
        region = self.bind(self.part)
        assert region.link in self.robot.sensor_links, f"{region.link!r} must be a sensor link"
        assert region.area().link == region.link

    def test_its_places_are_finite_and_on_the_robot(self) -> None:
        """Poses are finite, and sensors extend beyond the robot by at most ``overhang_m``."""
        link = self.bind(self.part).link
        x, y, _, yaw = self.robot.sensor_links[link]
        low, high = self.robot.outline.min(axis=0), self.robot.outline.max(axis=0)
        for pose in self.place_some():
            numbers = (*pose.position, pose.yaw_deg, pose.pitch_deg)
            assert all(map(math.isfinite, numbers)), f"a pose must be finite, not {pose}"
            along, aside, _ = pose.position
            place = np.array([
                x + along * elementary.cos(yaw) - aside * elementary.sin(yaw),
                y + along * elementary.sin(yaw) + aside * elementary.cos(yaw),
            ])  # fmt: skip
            beyond, limit = float(np.maximum(low - place, place - high).max()), self.part.overhang_m
            assert beyond <= limit + 1e-9, f"{pose} must not protrude by {beyond:g} m"
