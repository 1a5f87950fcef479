"""The parameters of ArduPilot Rover that follow from the robot and the mission."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from evoros.base.errors import InputError
from evoros.controller.protocol import Briefing
from evoros.robot.model import Robot

MAX_RANGE_FINDERS = 6
"""As many as a state of the JSON backend can carry."""
SIMULATED = 100
"""The type of a range finder that the simulation feeds."""
OCTANTS = 8
EVEN_THROTTLE = 50
DEFAULT_GAIN, GREATEST_GAIN = 1.0, 6.0
"""Of the velocity: what ArduPilot has by default, and at most."""


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
    curvature = drive.turn_ratio * math.tan(drive.steering_limit) / drive.wheelbase_m
    derived = {
        "WP_SPEED": speed,
        # The throttle in proportion to the speed, so that all of it is the greatest speed.
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


def _describe_range_finders(robot: Robot) -> Iterator[tuple[str, float]]:
    """Yield the parameters of the range finders, forward, right, down; their limits by two names.

    Versions until 4.6 name the limits in centimetres, and each version passes over the others'.
    """
    poses = robot.sensor_poses().tolist()[:MAX_RANGE_FINDERS]
    for number, (mount, (x, y, z, yaw, _)) in enumerate(zip(robot.mounts, poses, strict=False), 1):
        sensor, name = robot.sensors[mount.sensor], f"RNGFND{number}_"
        yield f"{name}TYPE", SIMULATED
        yield f"{name}ORIENT", round(-yaw / (2.0 * math.pi) * OCTANTS) % OCTANTS
        yield f"{name}POS_X", x
        yield f"{name}POS_Y", -y
        yield f"{name}POS_Z", -z
        for limit, metres in (("MIN", sensor.range_min_m), ("MAX", sensor.range_max_m)):
            yield f"{name}{limit}", metres
            yield f"{name}{limit}_CM", 100.0 * metres


def write_parameters(parameters: Mapping[str, float]) -> str:
    """Write a file of parameters."""
    return "".join(f"{name} {float(value):.9g}\n" for name, value in parameters.items())
