"""A champion's range finders as parameters of ArduPilot."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

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
from evoros.storage.figure_context import Beam

from .champion import Champion, MountedSensor, Triple

INSTANCES = "123456789A"
"""The range finders that ArduPilot can have, as their parameters name them."""
_EIGHTH_DEG = 360.0 / OCTANTS
DIRECTIONS = (
    *("forward", "forward right", "right", "back right"),
    *("back", "back left", "left", "forward left"),
)
"""The values of ``RNGFNDn_ORIENT`` from 0, clockwise from above."""
_CONTROLLER = "evoros.controller.ardupilot.ArduPilot"
_PARAMETERS = "controller.parameters."


@dataclass(frozen=True)
class RangeFinder:
    """A sensor as ArduPilot describes it, in its body frame: x forward, y right, z down."""

    instance: str  # a character of INSTANCES
    link: str
    position_m: Triple  # relative to the centre of mass, or to the IMU
    orientation: int  # the nearest of DIRECTIONS
    yaw_error_deg: float  # of the sensor from that direction, left positive
    pitch_deg: float  # of the sensor, which ArduPilot takes as level
    minimum_m: float
    maximum_m: float


def is_ardupilot(champion: Champion) -> bool:
    """Whether ArduPilot itself drove the missions."""
    return bool(champion.values.get("controller._target_") == _CONTROLLER)


def list_flown(champion: Champion) -> Iterator[str]:
    """Yield lines with ArduPilot's parameters in the missions; only those that evolved take effect.

    The others suit a simulation, in which no failsafe is needed.
    """
    if not is_ardupilot(champion):
        return
    evolved = {key for _, key, _ in champion.genes}
    for key, value in champion.values.items():
        if key.startswith(_PARAMETERS) and value is not None:
            name = key.removeprefix(_PARAMETERS)
            yield f"{name} {value}" if key in evolved else f"# in the simulation: {name} {value}"


def list_range_finders(sensors: Sequence[MountedSensor], origin_m: Triple) -> list[RangeFinder]:
    """Convert the first ten sensors with a single range; ``origin_m`` is ArduPilot's origin."""
    return [
        _convert(instance, sensor, beam, origin_m)
        for instance, (sensor, beam) in zip(INSTANCES, list_single(sensors), strict=False)
    ]


def list_single(sensors: Sequence[MountedSensor]) -> list[tuple[MountedSensor, Beam]]:
    """List the sensors that measure a single range."""
    pairs = ((sensor, sensor.kind) for sensor in sensors)
    return [(s, kind) for s, kind in pairs if isinstance(kind, Beam) and not kind.bearings_deg]


def _convert(instance: str, sensor: MountedSensor, beam: Beam, origin_m: Triple) -> RangeFinder:
    x, y, z = (place - zero for place, zero in zip(sensor.position_m, origin_m, strict=True))
    eighths = count_octants(math.radians(sensor.yaw_deg))
    forward, right, down = to_body((x, y, z))
    return RangeFinder(
        instance=instance,
        link=sensor.link,
        position_m=(_round(forward), _round(right), _round(down)),
        orientation=eighths % OCTANTS,
        yaw_error_deg=sensor.yaw_deg + _EIGHTH_DEG * eighths,
        pitch_deg=sensor.pitch_deg,
        minimum_m=beam.range_min_m,
        maximum_m=beam.range_max_m,
    )


def _round(metres: float) -> float:
    """Return a length in tenths of a millimetre, without a negative zero."""
    return round(metres, 4) + 0.0


def write_parameters(
    finders: Iterable[RangeFinder], head: Iterable[str], flown: Iterable[str], metres: bool
) -> str:
    """Return the text of a parameter file.

    ArduPilot 4.7 and later have ``_MIN`` and ``_MAX`` in ``metres``, earlier versions ``_MIN_CM``
    and ``_MAX_CM`` in whole centimetres. ``head`` has lines of comment, ``flown`` further lines.
    """
    lines = [f"# {line}" if line else "#" for line in head]
    for finder in finders:
        lines += ["#", f"# {finder.link}: {describe_orientation(finder)}"]
        lines += [
            f"{name_parameter(finder.instance, name)} {value}"
            for name, value in _rows(finder, metres)
        ]
    return "\n".join([*lines, *flown]) + "\n"


def describe_orientation(finder: RangeFinder) -> str:
    """Return the direction that ArduPilot knows, and how far the sensor is off it."""
    off = f"{abs(finder.yaw_error_deg):.1f} deg"
    side = "to the left" if finder.yaw_error_deg > 0.0 else "to the right"
    level = f"pitched {'up' if finder.pitch_deg > 0.0 else 'down'} {abs(finder.pitch_deg):.1f} deg"
    return (
        f"taken as {DIRECTIONS[finder.orientation]}; the sensor looks {off} {side} of it and is "
        f"{level if finder.pitch_deg else 'level'}"
    )


def _rows(finder: RangeFinder, metres: bool) -> Iterator[tuple[str, str]]:
    for axis, value in zip(AXES, finder.position_m, strict=True):
        yield axis, f"{value:.4f}"
    yield ORIENTATION, f"{finder.orientation}"
    for limit, value in zip(LIMITS, (finder.minimum_m, finder.maximum_m), strict=True):
        text = f"{value:.3f}" if metres else f"{_centimetres(limit, value)}"
        yield name_limit(limit, metres), text


def _centimetres(limit: str, metres: float) -> int:
    """Return whole centimetres inside the sensor's range, as far as 16 bits hold them."""
    hundredths = round(100.0 * metres, 6)
    whole = math.ceil(hundredths) if limit == "MIN" else math.floor(hundredths)
    return min(whole, 2**15 - 1)
