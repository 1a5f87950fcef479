"""Parameters of a champion's controller, sensors and drive, for ROS 2 and ArduPilot."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from evoros.controller import ardupilot_parameters
from evoros.plugins.deploy.champion import Champion, MountedSensor, Triple
from evoros.storage.figure_context import Beam, Signal

INSTANCES = "123456789A"  # characters that number the range finders in ArduPilot's parameters
_EIGHTH_DEG = 360.0 / ardupilot_parameters.OCTANTS
_DIRECTIONS = (
    *("forward", "forward right", "right", "back right"),
    *("back", "back left", "left", "forward left"),
)
"""The directions for ``RNGFNDn_ORIENT`` 0, 1, and so on, clockwise in top view."""
_ARDUPILOT = "evoros.plugins.ardupilot.controller.ArduPilot"
CONTROLLER = "controller."
PARAMETERS = "controller.parameters"  # key of the parameters passed to an external program
MAX_SPEED, STEERING_LIMIT = "robot.drive.max_speed_mps", "robot.drive.steering_limit_rad"
"""Keys of the drive that may evolve."""
RANGE_TOPIC = "controller.topics.range"  # key of a sensor's topic, which contains {sensor}
_LAYERS = ("controller.avoidance.", "controller.avoidance_period_s")  # keys of the avoidance layer
_SCALARS = (bool, int, float, str)


def controller_parameters(champion: Champion) -> tuple[dict[str, Any], list[str]]:
    """Return the controller's parameters, and the keys of values that ROS cannot represent."""
    values = champion.values
    prefix = f"{PARAMETERS}." if has_own_parameters(champion) else ""
    start = prefix or CONTROLLER
    named = {
        key.removeprefix(prefix): value
        for key, value in values.items()
        if key.startswith(start) and not key.endswith("_target_")
    }
    if _is_ardupilot(champion):  # written to separate files for ArduPilot
        named = {key: v for key, v in named.items() if key.startswith(_LAYERS)}
    return _nest(named)


def has_own_parameters(champion: Champion) -> bool:
    """Return True if the controller is a program that receives ROS parameters."""
    keys = champion.values
    given = PARAMETERS in keys or any(key.startswith(f"{PARAMETERS}.") for key in keys)
    return given and not _is_ardupilot(champion)


def robot_parameters(champion: Champion) -> tuple[dict[str, Any], list[str]]:
    """Return the parameters that describe the sensors and the drive to nodes, as in missions.

    Poses are x, y, z [m], yaw (left positive) and pitch (nose up) [rad] in the robot's frame.
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
    if STEERING_LIMIT in evolved:  # a wheel's limit, which only the drive can compute
        drive["steering_limit_rad"] = None
    named |= {f"evoros.drive.{name}": value for name, value in drive.items()}
    return _nest(named)


def _describe_kind(kind: Beam | Signal) -> Iterator[tuple[str, Any]]:
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


def write_ros_file(
    parameters: Mapping[str, Any], left_out: Iterable[str], head: Iterable[str]
) -> str:
    """Return the content of a parameter file for all nodes started with the file."""
    lines = [f"# {line}" for line in head]
    lines += [f"# Left out, because ROS has no such parameter type: {key}" for key in left_out]
    tree = {"/**": {"ros__parameters": dict(parameters)}}
    return "\n".join(lines) + "\n" + yaml.safe_dump(tree, sort_keys=False)


def _nest(named: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Convert dotted keys to nested mappings; also return the keys that ROS cannot represent."""
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
    """Return a value as a ROS 2 parameter (scalar or homogeneous list), or None if impossible."""
    if isinstance(value, _SCALARS):
        return value
    if not isinstance(value, list) or not value:
        return None
    kinds = {type(item) for item in value}
    if kinds == {int, float}:
        return [float(item) for item in value]
    return value if len(kinds) == 1 and kinds <= set(_SCALARS) else None


@dataclass(frozen=True)
class RangeFinder:
    """A sensor in ArduPilot's body frame: x forward, y right, z down."""

    instance: str  # a character of INSTANCES
    link: str
    position_m: Triple  # relative to the centre of mass or the IMU
    orientation: int  # index in _DIRECTIONS of the nearest direction
    yaw_error_deg: float  # deviation from that direction, left positive
    pitch_deg: float  # nose up positive; ArduPilot assumes 0
    minimum_m: float
    maximum_m: float


def _is_ardupilot(champion: Champion) -> bool:
    return bool(champion.values.get("controller._target_") == _ARDUPILOT)


def list_flown(champion: Champion) -> Iterator[str]:
    """Yield a line for each ArduPilot parameter set in missions, as a comment unless evolved."""
    if not _is_ardupilot(champion):
        return
    evolved = {key for _, key, _ in champion.genes}
    for key, value in champion.values.items():
        if key.startswith(f"{PARAMETERS}.") and value is not None:
            name = key.removeprefix(f"{PARAMETERS}.")
            yield f"{name} {value}" if key in evolved else f"# in the simulation: {name} {value}"


def list_range_finders(sensors: Sequence[MountedSensor], origin_m: Triple) -> list[RangeFinder]:
    """Convert the first ten single-range sensors to range finders, relative to ``origin_m``."""
    single = zip(INSTANCES, list_single(sensors), strict=False)
    return [_convert(instance, *mounted, origin_m) for instance, mounted in single]


def list_single(sensors: Sequence[MountedSensor]) -> list[tuple[MountedSensor, Beam]]:
    """List the sensors that measure a single range."""
    pairs = ((sensor, sensor.kind) for sensor in sensors)
    return [(s, kind) for s, kind in pairs if isinstance(kind, Beam) and not kind.bearings_deg]


def _convert(instance: str, sensor: MountedSensor, beam: Beam, origin_m: Triple) -> RangeFinder:
    x, y, z = (place - zero for place, zero in zip(sensor.position_m, origin_m, strict=True))
    eighths = ardupilot_parameters.count_octants(math.radians(sensor.yaw_deg))
    forward, right, down = ardupilot_parameters.to_body((x, y, z))
    return RangeFinder(
        instance=instance,
        link=sensor.link,
        position_m=(_round(forward), _round(right), _round(down)),
        orientation=eighths % ardupilot_parameters.OCTANTS,
        yaw_error_deg=sensor.yaw_deg + _EIGHTH_DEG * eighths,
        pitch_deg=sensor.pitch_deg,
        minimum_m=beam.range_min_m,
        maximum_m=beam.range_max_m,
    )


def _round(metres: float) -> float:
    return round(metres, 4) + 0.0


def write_ardupilot_file(
    finders: Iterable[RangeFinder], head: Iterable[str], flown: Iterable[str], metres: bool
) -> str:
    """Return the text of an ArduPilot parameter file for range finders.

    It starts with ``head`` as comments, and ends with ``flown``, the lines from ``list_flown``.
    If ``metres`` (from ArduPilot 4.7 on), ranges are _MIN and _MAX [m], else _MIN_CM and _MAX_CM.
    """
    lines = [f"# {line}" if line else "#" for line in head]
    for finder in finders:
        lines += ["#", f"# {finder.link}: {describe_orientation(finder)}"]
        lines += [
            f"{ardupilot_parameters.name_parameter(finder.instance, name)} {value}"
            for name, value in _rows(finder, metres)
        ]
    return "\n".join([*lines, *flown]) + "\n"


def describe_orientation(finder: RangeFinder) -> str:
    """Describe the ArduPilot direction of a sensor, and its deviation from that direction."""
    off = f"{abs(finder.yaw_error_deg):.1f} deg"
    side = "to the left" if finder.yaw_error_deg > 0.0 else "to the right"
    level = f"pitched {'up' if finder.pitch_deg > 0.0 else 'down'} {abs(finder.pitch_deg):.1f} deg"
    return (
        f"set as {_DIRECTIONS[finder.orientation]}; the sensor points {off} {side} of that and is "
        f"{level if finder.pitch_deg else 'level'}"
    )


def _rows(finder: RangeFinder, metres: bool) -> Iterator[tuple[str, str]]:
    for axis, value in zip(ardupilot_parameters.AXES, finder.position_m, strict=True):
        yield axis, f"{value:.4f}"
    yield ardupilot_parameters.ORIENTATION, f"{finder.orientation}"
    limits = finder.minimum_m, finder.maximum_m
    for limit, value in zip(ardupilot_parameters.LIMITS, limits, strict=True):
        text = f"{value:.3f}" if metres else f"{_centimetres(limit, value)}"
        yield ardupilot_parameters.name_limit(limit, metres), text


def _centimetres(limit: str, metres: float) -> int:
    """Return a limit in whole centimetres within the sensor's range, as a 16-bit number."""
    hundredths = round(100.0 * metres, 6)
    whole = math.ceil(hundredths) if limit == "MIN" else math.floor(hundredths)
    return min(whole, 2**15 - 1)
