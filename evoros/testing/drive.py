"""Conformance tests for drives."""

import math
from collections.abc import Iterator
from functools import cached_property
from itertools import product
from typing import Any

from evoros.drive.protocol import Drive, DriveDescription
from evoros.formats.urdf.tree import Urdf
from evoros.testing.part import PartSuite

SPEEDS = -9.0, -0.2, 0.0, 0.1, 0.3, 9.0
STEERINGS = -9.0, -0.4, 0.0, 0.2, 9.0
NUMBERS = "max_speed_mps", "speed_limit_offset_m", "steering_limit", "wheelbase_m", "turn_ratio"


class DriveSuite(PartSuite):
    """Conformance tests for the description of a drive; ``urdf`` is a robot with this drive."""

    part: DriveDescription
    protocol = DriveDescription

    @cached_property
    def urdf(self) -> Urdf:
        """The description of a robot with this drive."""
        raise NotImplementedError("set `urdf`")

    def use(self, part: Any, seed: int) -> Iterator[Any]:
        """Fit the drive, and compute targets for commands, some of them beyond the limits."""
        drive = part.fit(self.lend(self.urdf))
        yield [getattr(drive, name) for name in (*NUMBERS, "rear_axle_x_m")]
        yield drive.steering_joints, drive.wheel_joints, drive.caster_links
        for speed, steering in product(SPEEDS, STEERINGS):
            yield drive.targets(speed / seed, steering / seed)

    def fit(self) -> Drive:
        """Return the drive fitted to the robot."""
        return self.part.fit(self.urdf)

    def test_its_numbers_are_possible(self) -> None:
        """Numbers are finite; limits and lengths are positive, and offsets are not negative."""
        drive = self.fit()
        for name in NUMBERS:
            value = getattr(drive, name)
            low = 0.0 if name == "speed_limit_offset_m" else math.nextafter(0.0, 1.0)
            assert low <= value < math.inf, f"{name} must not be {value}"
        assert drive.steering_limit < math.pi / 2, "steering_limit must be below pi/2"
        assert math.isfinite(drive.rear_axle_x_m), "rear_axle_x_m must be finite"

    def test_each_joint_has_a_finite_target(self) -> None:
        """Each command yields an angle for each steering joint and a rate for each wheel joint."""
        drive = self.fit()
        for speed, steering in product(SPEEDS, STEERINGS):
            angles, rates = drive.targets(speed, steering)
            call = f"targets({speed}, {steering}) must return"
            count, wheels = len(drive.steering_joints), len(drive.wheel_joints)
            assert len(angles) == count, f"{call} one angle per steering joint, not {len(angles)}"
            assert len(rates) == wheels, f"{call} one rate per wheel joint, not {len(rates)}"
            finite = all(map(math.isfinite, (*angles, *rates)))
            assert finite, f"{call} finite values, not {angles}, {rates}"

    def test_commands_beyond_the_limits_are_clipped(self) -> None:
        """Commands beyond full speed or full lock have the same targets as the limit."""
        drive = self.fit()
        for side in (-1.0, 1.0):
            lock, full = side * drive.steering_limit, drive.max_speed_mps
            turned, driven = drive.targets(full, lock), drive.targets(full, 0.0)
            assert drive.targets(full, 2.0 * lock) == turned, "clip angles beyond steering_limit"
            assert drive.targets(9.0 * full, 0.0) == driven, "clip speeds beyond max_speed_mps"

    def test_a_robot_that_shall_stand_has_wheels_that_stand(self) -> None:
        """At speed 0, all wheel rates are 0."""
        drive = self.fit()
        for steering in STEERINGS:
            rates = drive.targets(0.0, steering)[1]
            assert not any(rates), f"targets(0, {steering}) must return rates of 0, not {rates}"
