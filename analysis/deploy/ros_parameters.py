"""Parameter files of ROS 2: the controller's values, and the sensors and drive of a champion."""

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import yaml

from evoros.storage.figure_context import Beam, Signal

from .ardupilot import is_ardupilot
from .champion import Champion

CONTROLLER = "controller."
PARAMETERS = "controller.parameters"
"""The key of what a program outside of evoros was given."""
MAX_SPEED, STEERING_LIMIT = "robot.drive.max_speed_mps", "robot.drive.steering_limit_rad"
"""The keys of a drive that may evolve."""
RANGE_TOPIC = "controller.topics.range"
"""The key of the topic on which nodes got the readings of a sensor, whose name is a field of it."""
_LAYERS = ("controller.avoidance.", "controller.avoidance_period_s")
"""The layers beside ArduPilot; the other values start it, and some may be secret."""
_SCALARS = (bool, int, float, str)


def controller_parameters(champion: Champion) -> tuple[dict[str, Any], list[str]]:
    """Return the parameters of the controller, and the keys that no parameter can hold.

    A program has the parameters of its missions; any other controller has its configuration.
    """
    values = champion.values
    prefix = f"{PARAMETERS}." if has_own_parameters(champion) else ""
    start = prefix or CONTROLLER
    named = {
        key.removeprefix(prefix): value
        for key, value in values.items()
        if key.startswith(start) and not key.endswith("_target_")
    }
    if is_ardupilot(champion):  # its own parameters are in files of their own
        named = {key: v for key, v in named.items() if key.startswith(_LAYERS)}
    return _nest(named)


def has_own_parameters(champion: Champion) -> bool:
    """Whether the controller is a program to which ROS parameters were given."""
    keys = champion.values
    given = PARAMETERS in keys or any(key.startswith(f"{PARAMETERS}.") for key in keys)
    return given and not is_ardupilot(champion)


def robot_parameters(champion: Champion) -> tuple[dict[str, Any], list[str]]:
    """Return the parameters that tell nodes of the sensors and the drive, as in a mission.

    Poses are x, y, z [m], yaw and pitch [rad] in the robot's frame: left and nose up positive.
    """
    sensors, topic = champion.sensors, champion.values.get(RANGE_TOPIC)
    named: dict[str, Any] = {"evoros.sensors": [sensor.link for sensor in sensors]}
    for sensor in sensors:
        angles = math.radians(sensor.yaw_deg), math.radians(sensor.pitch_deg)
        for name, value in (
            ("type", sensor.type),
            ("pose", [*sensor.position_m, *angles]),
            ("period_s", sensor.kind.period_s),
            *_describe_kind(sensor.kind),
            *([] if topic is None else [("topic", topic.replace("{sensor}", sensor.link))]),
        ):
            named[f"evoros.{sensor.link}.{name}"] = value
    evolved = {key: value for _, key, value in champion.genes}
    drive = dict[str, float | None](champion.record.context.drive)
    drive |= {"max_speed_mps": evolved.get(MAX_SPEED, drive.get("max_speed_mps"))}
    if STEERING_LIMIT in evolved:  # of a wheel, from which only the drive itself computes its own
        drive["steering_limit_rad"] = None
    named |= {f"evoros.drive.{name}": value for name, value in drive.items()}
    return _nest(named)


def _describe_kind(kind: Beam | Signal) -> Iterator[tuple[str, Any]]:
    """Yield what nodes are told of a type of sensor, under the names of the missions."""
    if not isinstance(kind, Beam):
        yield "measures", kind.measures
        yield "channels", [f"{name}_{unit}".strip("_") for name, unit in kind.channels]
        return
    yield "range_min_m", kind.range_min_m
    yield "range_max_m", kind.range_max_m
    yield "field_of_view_rad", math.radians(kind.fov_deg)
    if kind.radiation != Beam.radiation:
        yield "radiation", kind.radiation
    if kind.bearings_deg:
        yield "bearings_rad", [math.radians(bearing) for bearing in kind.bearings_deg]


def write_parameter_file(
    parameters: Mapping[str, Any], left_out: Iterable[str], head: Iterable[str]
) -> str:
    """Return the text of a file whose parameters apply to each node that is started with it."""
    lines = [f"# {line}" for line in head]
    lines += [f"# Left out, for ROS has no such parameter: {key}" for key in left_out]
    tree = {"/**": {"ros__parameters": dict(parameters)}}
    return "\n".join(lines) + "\n" + yaml.safe_dump(tree, sort_keys=False)


def _nest(named: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Turn dotted keys into mappings; return them and the keys of values that do not fit."""
    tree: dict[str, Any] = {}
    left_out = []
    for key, value in named.items():
        fitting = _fit(value)
        if fitting is None:
            left_out.append(key)
            continue
        *above, last = key.split(".")
        node = tree
        for name in above:
            node = node.setdefault(name, {})
        node[last] = fitting
    return tree, left_out


def _fit(value: Any) -> Any:
    """Return a scalar, or a list of scalars of one type, as ROS 2 can hold it, or None."""
    if isinstance(value, _SCALARS):
        return value
    if not isinstance(value, list) or not value:
        return None
    kinds = {type(item) for item in value}
    if kinds == {int, float}:
        return [float(item) for item in value]
    return value if len(kinds) == 1 and kinds <= set(_SCALARS) else None
