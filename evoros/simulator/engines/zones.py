"""The zones in which contact sensors feel, and whether a contact lies in one."""

from typing import NamedTuple

from evoros.base.compilable import compilable
from evoros.robot.model import Robot
from evoros.sensor.protocol import feels


class Zone(NamedTuple):
    """The zone of a mounted contact sensor, seen from above, in the robot's frame."""

    x: float  # [m], of the mount
    y: float  # [m], of the mount
    cos: float  # of the direction in which the sensor faces
    sin: float
    depth: float  # [m]
    width: float  # [m]


ZONE_SIZE = len(Zone._fields)


def find_zones(robot: Robot) -> dict[int, Zone]:
    """Find the zones of a robot, by the number of the mount."""
    zones, frames = {}, robot.sensor_frames
    for index, sensor in enumerate(robot.mounted_sensors()):
        if feels(sensor):
            x, y, across = float(frames[index, 0, 3]), float(frames[index, 1, 3]), frames[index]
            # Along its left axis, which a pitch leaves level.
            cos, sin = float(across[1, 1]), -float(across[0, 1])
            zones[index] = Zone(x, y, cos, sin, float(sensor.depth_m), float(sensor.width_m))
    return zones


@compilable
def crosses_zone(zone: Zone, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether the way from a to b, in the robot's frame [m], has a point in a zone."""
    x, y, cos, sin, depth, width = zone
    start = 0.0
    end = 1.0
    ahead = cos * (ax - x) + sin * (ay - y) + depth
    aside = cos * (ay - y) - sin * (ax - x)
    forward = cos * (bx - ax) + sin * (by - ay)
    leftward = cos * (by - ay) - sin * (bx - ax)
    half = 0.5 * width
    for side in range(3):
        # How far inside an edge the way begins, and how far it goes further inside.
        if side == 0:
            inside = ahead
            gain = forward
        elif side == 1:
            inside = half - aside
            gain = -leftward
        else:
            inside = half + aside
            gain = leftward
        if gain == 0.0:
            if inside < 0.0:
                return False
        elif gain > 0.0:
            start = max(start, -inside / gain)
        else:
            end = min(end, -inside / gain)
    return start <= end
