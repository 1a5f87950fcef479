"""The messages of sensors, with the types and fields that nodes of ROS get in a live mission."""

import math
from collections.abc import Sequence

from evoros.sensor.protocol import CONTACT, MOTION, WHEELS
from evoros.storage.figure_context import Beam, Signal

from .protocol import Content

RANGE, SCAN = "sensor_msgs/msg/Range", "sensor_msgs/msg/LaserScan"
IMU, TWIST = "sensor_msgs/msg/Imu", "geometry_msgs/msg/TwistStamped"
SWITCH, NUMBERS = "std_msgs/msg/Bool", "std_msgs/msg/Float64MultiArray"
_SIGNALS = {(MOTION, 6): IMU, (WHEELS, 2): TWIST, (CONTACT, 1): SWITCH}
_RADIATIONS = {"ultrasound": 0, "infrared": 1}  # of sensor_msgs/Range
WITHOUT_HEADER = (SWITCH, NUMBERS)
_NO_ORIENTATION = (-1.0, *(0.0,) * 8)


def choose_type(kind: Beam | Signal) -> str:
    """Return the type of the messages of a sensor."""
    if isinstance(kind, Beam):
        return SCAN if kind.bearings_deg else RANGE
    return _SIGNALS.get((kind.measures, len(kind.channels)), NUMBERS)


def fill_message(kind: Beam | Signal, readings: Sequence[float]) -> Content | None:
    """Return the content of a message without its header; None: the sensor is silent."""
    if isinstance(kind, Beam):
        if not any(map(math.isfinite, readings)):
            return None
        return _scan(kind, readings) if kind.bearings_deg else _range(kind, readings[0])
    if not all(map(math.isfinite, readings)):
        return None
    return _signal(choose_type(kind), readings)


def _range(beam: Beam, reading: float) -> Content:
    return {
        "radiation_type": _RADIATIONS.get(beam.radiation, 0),
        "field_of_view": math.radians(beam.fov_deg),
        "min_range": beam.range_min_m,
        "max_range": beam.range_max_m,
        "range": reading,
    }


def _scan(beam: Beam, ranges: Sequence[float]) -> Content:
    """Return a scan, from the right to the left as ROS has it."""
    first, last = (math.radians(beam.bearings_deg[end]) for end in (0, -1))
    return {
        "angle_min": first,
        "angle_max": last,
        "angle_increment": (last - first) / (len(ranges) - 1),
        "scan_time": beam.period_s,
        "range_min": beam.range_min_m,
        "range_max": beam.range_max_m,
        "ranges": ranges,
    }


def _signal(type_name: str, values: Sequence[float]) -> Content:
    if type_name == IMU:
        turning, felt = (dict(zip("xyz", part, strict=True)) for part in (values[:3], values[3:]))
        return {
            "orientation_covariance": _NO_ORIENTATION,
            "angular_velocity": turning,
            "linear_acceleration": felt,
        }
    if type_name == TWIST:
        return {"twist": {"linear": {"x": values[0]}, "angular": {"z": values[1]}}}
    return {"data": bool(values[0]) if type_name == SWITCH else values}
