"""The decisions of the nodes of the tests: keep off near things, else steer to the goal. No ROS."""

import math
from collections.abc import Mapping, Sequence

SPEED_MPS = 0.5


class Avoider:
    """Knows the last reading of each sensor, the pose and the goal."""

    def __init__(
        self, yaws: Mapping[str, float], lock: float, wheelbase: float, reach: float
    ) -> None:
        self._yaws, self._lock, self._wheelbase, self._reach = yaws, lock, wheelbase, reach
        self._readings: dict[str, float] = {}
        self._goal: tuple[float, float] | None = None
        self._pose: tuple[float, float, float] | None = None

    def hear_range(self, sensor: str, reading: float) -> None:
        self._readings[sensor] = reading

    def hear_goal(self, x: float, y: float) -> None:
        self._goal = x, y

    def hear_pose(self, x: float, y: float, z: float, w: float) -> None:
        """The last two are of the quaternion of the yaw."""
        self._pose = x, y, 2.0 * math.atan2(z, w)

    def decide(self) -> tuple[float, float] | None:
        """Speed [m/s] and yaw rate [rad/s]; None without a goal or a pose."""
        if self._goal is None or self._pose is None:
            return None
        return SPEED_MPS, SPEED_MPS * math.tan(
            self._steering(self._goal, self._pose)
        ) / self._wheelbase

    def _steering(self, goal: Sequence[float], pose: Sequence[float]) -> float:
        near = {
            sensor: self._reach - reading
            for sensor, reading in self._readings.items()
            if reading < self._reach
        }
        if near:  # away from the side that is nearer
            left = sum(amount for sensor, amount in near.items() if self._yaws[sensor] > 0.0)
            right = sum(amount for sensor, amount in near.items() if self._yaws[sensor] <= 0.0)
            return max(-1.0, min(1.0, right - left)) * self._lock
        error = math.atan2(goal[1] - pose[1], goal[0] - pose[0]) - pose[2]
        return max(-self._lock, min(self._lock, 1.5 * math.remainder(error, 2.0 * math.pi)))
