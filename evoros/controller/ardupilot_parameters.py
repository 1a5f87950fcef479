"""The parameters of ArduPilot Rover that follow from the robot and the mission."""

from collections.abc import Iterator, Mapping
from typing import Any

from evoros.base import elementary
from evoros.base.errors import InputError
from evoros.controller.protocol import Briefing
from evoros.controller.range_finders import (
    AXES,
    LIMITS,
    OCTANTS,
    ORIENTATION,
    count_octants,
    name_limit,
    name_parameter,
    to_body,
)
from evoros.robot.model import Robot
from evoros.sensor.protocol import RangeSensor, sees

MAX_RANGE_FINDERS = 6
"""The number that a state of the JSON backend can carry."""
SIMULATED = 100
"""The type of a range finder that the simulation feeds."""
EVEN_THROTTLE = 50
DEFAULT_GAIN, GREATEST_GAIN = 1.0, 6.0
"""Gains of the velocity: ArduPilot's default and maximum."""


def derive_parameters(briefing: Briefing, given: Mapping[str, Any]) -> dict[str, float]:
    """Return the parameters that follow from the robot and the mission, without those given.

    Raises:
        InputError: the given speed on the route is not positive.
    """
    drive = briefing.robot.drive
    speed = float(given.get("WP_SPEED", drive.max_speed_mps))
    if speed <= 0.0:
        raise InputError(
            f"controller.parameters.WP_SPEED: must be greater than 0, not {speed:g}; set it to the "
            f"speed on the route [m/s], for example 0.3"
        )
    curvature = drive.turn_ratio * elementary.tan(drive.steering_limit) / drive.wheelbase_m
    derived = {
        "WP_SPEED": speed,
        # The throttle in proportion to the speed, so that full throttle is the maximum speed.
        "CRUISE_SPEED": drive.max_speed_mps * EVEN_THROTTLE / 100,
        "CRUISE_THROTTLE": EVEN_THROTTLE,
        "WP_RADIUS": 0.5 * briefing.acceptance_m,
        "TURN_RADIUS": 1.0 / curvature,
        # The part of full lock that a rate needs; the default of 0.2 turns slow robots too wide.
        "ATC_STR_RAT_FF": 1.0 / (speed * curvature),
        # ArduPilot divides the lateral acceleration by 1 m/s at least, and a slow robot is slower.
        "PSC_VEL_P": min(max(1.0 / speed, DEFAULT_GAIN), GREATEST_GAIN),
        **dict(_describe_range_finders(briefing.robot)),
    }
    return {name: value for name, value in derived.items() if name not in given}


def list_range_finders(robot: Robot) -> list[tuple[int, RangeSensor]]:
    """List the mounts that the autopilot is told: the first ones with a single range."""
    return [
        (mount, sensor)
        for mount, sensor in enumerate(robot.mounted_sensors())
        if sees(sensor) and len(sensor.channels) == 1
    ][:MAX_RANGE_FINDERS]


def _describe_range_finders(robot: Robot) -> Iterator[tuple[str, float]]:
    """Yield the parameters of the range finders.

    The limits have the names of all versions, because each ignores the others' names.
    """
    poses = robot.sensor_poses.tolist()
    for index, (mount, sensor) in enumerate(list_range_finders(robot), 1):
        instance, (x, y, z, yaw, _) = str(index), poses[mount]
        yield name_parameter(instance, "TYPE"), SIMULATED
        yield name_parameter(instance, ORIENTATION), count_octants(yaw) % OCTANTS
        for axis, value in zip(AXES, to_body((x, y, z)), strict=True):
            yield name_parameter(instance, axis), value
        for limit, value in zip(LIMITS, (sensor.range_min_m, sensor.range_max_m), strict=True):
            yield name_parameter(instance, name_limit(limit, metres=True)), value
            yield name_parameter(instance, name_limit(limit, metres=False)), 100.0 * value


def write_parameters(parameters: Mapping[str, float]) -> str:
    """Write a file of parameters."""
    return "".join(f"{name} {float(value):.9g}\n" for name, value in parameters.items())
