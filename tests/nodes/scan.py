"""The decisions of a node of the tests by a scan: keep off the nearer side. No ROS."""

from collections.abc import Sequence

NEAR_M, SPEED_MPS, STEERING_RAD = 1.5, 0.3, 0.5


def steer(ranges: Sequence[float], closed: bool) -> tuple[float, float]:
    """Return speed [m/s] and steering angle [rad]; ``ranges`` are from the right to the left."""
    right, left = (min(half) for half in (ranges[: len(ranges) // 2], ranges[len(ranges) // 2 :]))
    if closed:
        return -SPEED_MPS, 0.0
    if min(right, left) > NEAR_M:
        return SPEED_MPS, 0.0
    return SPEED_MPS, STEERING_RAD if right < left else -STEERING_RAD
