"""Mission briefings for external programs, as plain values."""

from collections.abc import Iterator
from typing import Any

from evoros.controller.protocol import Briefing
from evoros.drive.protocol import Drive
from evoros.sensor.protocol import RangeSensor, Sensor, find_field, sees, sensor_bearings

VERSION = 1  # protocol version, see docs/programs.md


def describe_briefing(briefing: Briefing) -> dict[str, Any]:
    """Return the mission-dependent part of the first line sent to a program."""
    return {
        "evoros": VERSION,
        "robot": briefing.robot.name,
        "sensors": list(_describe_sensors(briefing)),
        "drive": describe_drive(briefing.robot.drive),
        "home": list(map(float, briefing.home)),
        "route": briefing.route.tolist(),
        "acceptance_m": float(briefing.acceptance_m),
        "time_limit_s": float(briefing.time_limit_s),
        "seed": briefing.seed,
    }


def describe_drive(drive: Drive) -> dict[str, float]:
    """Describe a drive for a program's briefing."""
    return {
        "wheelbase_m": float(drive.wheelbase_m),
        "steering_limit_rad": float(drive.steering_limit),
        "max_speed_mps": float(drive.max_speed_mps),
        "rear_axle_x_m": float(drive.rear_axle_x_m),
        "turn_ratio": float(drive.turn_ratio),
    }


def _describe_sensors(briefing: Briefing) -> Iterator[dict[str, Any]]:
    robot = briefing.robot
    poses = robot.sensor_poses.tolist()
    for (name, mount), pose in zip(robot.named_mounts(), poses, strict=True):
        sensor = robot.sensors[mount.sensor]
        yield {
            "name": name,
            "type": mount.sensor,
            "pose": pose,
            **(_describe_beams(sensor) if sees(sensor) else {}),
            "period_s": float(sensor.period_s),
            **_describe_channels(sensor),
        }


def _describe_beams(sensor: RangeSensor) -> dict[str, Any]:
    low, high = find_field(sensor)
    return {
        "range_min_m": float(sensor.range_min_m),
        "range_max_m": float(sensor.range_max_m),
        "field_of_view_rad": high - low,
        **({"radiation": sensor.radiation} if sensor.radiation else {}),
    }


def _describe_channels(sensor: Sensor) -> dict[str, Any]:
    """Describe the channels of a sensor; several ranges also have bearings, left positive."""
    if sees(sensor):
        bearings = sensor_bearings(sensor)
        return {"bearings_rad": bearings} if len(bearings) > 1 else {}
    names = (f"{channel.name}_{channel.unit}".strip("_") for channel in sensor.channels)
    return {"measures": sensor.measures, "channels": list(names)}
