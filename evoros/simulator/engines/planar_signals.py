"""The signals of the planar simulator for sensors that cast no rays.

The motion and the rolling of the wheels are exact, because the wheels do not slip.
"""

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import SPEED, YAW, YAW_RATE, Array, X, Y
from evoros.base.compilable import compilable
from evoros.geometry.contact import polygon_contact
from evoros.geometry.grid import cell_at
from evoros.geometry.outlines import (
    CENTRE_X,
    CENTRE_Y,
    CIRCLE,
    END,
    FOOTPRINT_SIZE,
    RADIUS,
    START,
)
from evoros.robot.model import Robot
from evoros.sensor import signals as signal
from evoros.sensor.protocol import CONTACT, MOTION, WHEELS
from evoros.simulator.engines import planar_bodies as bodies
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines.planar_bodies import memory_views, part_of
from evoros.simulator.engines.planar_layout import block
from evoros.simulator.engines.zones import crosses_zone, find_zones

SKIN_M = 1e-3
"""How near a body that was pushed is to the robot that touches it, at most."""

# A mounted sensor is a row of the block PROBES: what it measures, where its signal is, then the
# place (3,) [m] and the quaternion (4,) of its frame and the gravity [m/s2], or its zone.
KIND, PLACE, FRAME, PROBE_GRAVITY = 0, 1, 2, 9
KINDS = {MOTION: 0, WHEELS: 1, CONTACT: 2}
PROBE_SIZE = layout.PROBE_SIZE


def probe_rows(robot: Robot, gravity: float) -> Array:
    """Return the block PROBES for a robot, in a world with this gravity [m/s2]."""
    zones, rows = find_zones(robot), []
    for number, sensor in enumerate(robot.mounted_sensors()):
        if sensor.measures not in KINDS:
            continue
        place, row = robot.signal_layout[number].start, np.zeros(PROBE_SIZE)
        row[[KIND, PLACE]] = KINDS[sensor.measures], place
        if sensor.measures == MOTION:
            x, y, z, yaw, pitch = robot.sensor_poses[number].tolist()
            row[FRAME : PROBE_GRAVITY + 1] = (x, y, z, *_face(yaw, pitch), gravity)
        elif sensor.measures == CONTACT:
            row[FRAME : FRAME + 6] = zones[number]
        rows.append(row)
    return np.array(rows).reshape(-1, PROBE_SIZE)


def _face(yaw: float, pitch: float) -> tuple[float, float, float, float]:
    """Return the quaternion of a yaw to the left and then a pitch, nose up [rad]."""
    sy, cy = elementary.sin_cos(yaw / 2)
    sp, cp = elementary.sin_cos(pitch / 2)
    return cy * cp, sy * sp, -cy * sp, sy * cp


@compilable
def touch_memory(parameters: Array) -> int:
    """Return where the memory has the number of touches of each probe."""
    return layout.PLACED_OUTLINE + len(block(parameters, layout.OUTLINE))


@compilable
def fill_signals(parameters: Array, memory: Array, signals: Array) -> None:
    """Write the signal of each probe at its place."""
    probes = block(parameters, layout.PROBES).reshape((-1, PROBE_SIZE))
    touches = touch_memory(parameters)
    for i in range(len(probes)):
        place = int(probes[i, PLACE])
        if probes[i, KIND] == 0.0:
            fill_motion(parameters, memory, probes[i], signals[place:])
        elif probes[i, KIND] == 1.0:
            signals[place + signal.DISTANCE] = memory[layout.ROLLED]
            signals[place + signal.TURN] = memory[layout.TURNED]
        else:
            signals[place + signal.TOUCHES] = memory[touches + i]


@compilable
def fill_motion(parameters: Array, memory: Array, probe: Array, motion: Array) -> None:
    """Write how a probe's frame moves."""
    yaw = memory[YAW]
    sin, cos = elementary.sin_cos(yaw)
    px = probe[FRAME]
    py = probe[FRAME + 1]
    motion[signal.POSITION] = memory[X] + cos * px - sin * py
    motion[signal.POSITION + 1] = memory[Y] + sin * px + cos * py
    motion[signal.POSITION + 2] = probe[FRAME + 2]
    # The turn of the robot about the vertical, times that of the frame on the robot.
    z, w = elementary.sin_cos(0.5 * yaw)
    qw = probe[FRAME + 3]
    qx = probe[FRAME + 4]
    qy = probe[FRAME + 5]
    qz = probe[FRAME + 6]
    motion[signal.ORIENTATION] = w * qw - z * qz
    motion[signal.ORIENTATION + 1] = w * qx - z * qy
    motion[signal.ORIENTATION + 2] = w * qy + z * qx
    motion[signal.ORIENTATION + 3] = w * qz + z * qw
    # The rear axle moves as the robot heads.
    ahead = memory[SPEED] - memory[YAW_RATE] * py
    aside = memory[YAW_RATE] * (px - parameters[layout.REAR_AXLE_X])
    motion[signal.VELOCITY] = cos * ahead - sin * aside
    motion[signal.VELOCITY + 1] = sin * ahead + cos * aside
    motion[signal.VELOCITY + 2] = 0.0
    motion[signal.TURNING] = 0.0
    motion[signal.TURNING + 1] = 0.0
    motion[signal.TURNING + 2] = memory[YAW_RATE]
    motion[signal.GRAVITY] = probe[PROBE_GRAVITY]


@compilable
def feel(
    parameters: Array, memory: Array, outline: Array, x: float, y: float, cos: float, sin: float
) -> None:
    """Count a touch for each zone that has a part of a contact of the robot's ``outline``.

    The robot is, or would be, at x, y [m] with a heading of this cosine and sine.
    """
    probes = block(parameters, layout.PROBES).reshape((-1, PROBE_SIZE))
    touches = touch_memory(parameters)
    for i in range(len(probes)):
        if probes[i, KIND] == 2.0:
            zone = probes[i, FRAME : FRAME + 6]
            felt = feel_fixed(parameters, zone, outline, x, y, cos, sin)
            if not felt and len(block(parameters, layout.PUSHING)):
                felt = feel_bodies(parameters, memory, zone, outline, x, y, cos, sin)
            if felt:
                memory[touches + i] += 1.0


@compilable
def feel_outline(
    parameters: Array,
    memory: Array,
    outline: Array,
    other: Array,
    radius: float,
    x: float,
    y: float,
    cos: float,
    sin: float,
) -> None:
    """Count a touch for each zone in which another rounded polygon overlaps this outline."""
    probes = block(parameters, layout.PROBES).reshape((-1, PROBE_SIZE))
    touches = touch_memory(parameters)
    for i in range(len(probes)):
        if probes[i, KIND] == 2.0:
            zone = probes[i, FRAME : FRAME + 6]
            if meets(zone, outline, other, 0.0, radius, x, y, cos, sin):
                memory[touches + i] += 1.0


@compilable
def feel_fixed(
    parameters: Array, zone: Array, outline: Array, x: float, y: float, cos: float, sin: float
) -> bool:
    """Whether the outline overlaps an obstacle that stays, somewhere in a zone."""
    cell = cell_at(block(parameters, layout.GRID), x, y)
    if cell < 0:
        return False
    starts = block(parameters, layout.CONTACT_STARTS)
    entries = block(parameters, layout.CONTACT_ENTRIES)
    footprints = block(parameters, layout.FOOTPRINTS).reshape((-1, FOOTPRINT_SIZE))
    corners = block(parameters, layout.CORNERS).reshape((-1, 2))
    for entry in range(int(starts[cell]), int(starts[cell + 1])):
        row = footprints[int(entries[entry])]
        dx = row[CENTRE_X] - x
        dy = row[CENTRE_Y] - y
        near = parameters[layout.OUTLINE_RADIUS] + row[CIRCLE]
        if dx * dx + dy * dy > near * near:
            continue
        polygon = corners[int(row[START]) : int(row[END])]
        if meets(zone, outline, polygon, 0.0, row[RADIUS], x, y, cos, sin):
            return True
    return False


@compilable
def feel_bodies(
    parameters: Array,
    memory: Array,
    zone: Array,
    outline: Array,
    x: float,
    y: float,
    cos: float,
    sin: float,
) -> bool:
    """Whether a body that can be pushed touches the outline, somewhere in a zone."""
    pushing = block(parameters, layout.PUSHING)
    start = touch_memory(parameters) + len(block(parameters, layout.PROBES)) // PROBE_SIZE
    _, _, _, corners, _ = memory_views(pushing, memory[start:])
    parts = part_of(pushing, bodies.PARTS).reshape((-1, bodies.PART_SIZE))
    for p in range(len(parts)):
        part = parts[p]
        if part[bodies.BOTTOM] >= pushing[bodies.HEIGHT] or part[bodies.TOP] <= 0.0:
            continue
        polygon = corners[int(part[bodies.START]) : int(part[bodies.END])]
        if meets(zone, outline, polygon, SKIN_M, part[bodies.RADIUS], x, y, cos, sin):
            return True
    return False


@compilable
def meets(
    zone: Array,
    outline: Array,
    polygon: Array,
    skin: float,
    radius: float,
    x: float,
    y: float,
    cos: float,
    sin: float,
) -> bool:
    """Whether the outline, with a skin [m] around it, meets a rounded polygon within a zone."""
    depth, nx, ny, along, low, high = polygon_contact(outline, polygon, skin, radius)
    if depth <= 0.0:
        return False
    # The ends of the contact in the world, from the robot's origin.
    ax = along * nx - low * ny - x
    ay = along * ny + low * nx - y
    bx = along * nx - high * ny - x
    by = along * ny + high * nx - y
    return crosses_zone(
        zone[0], zone[1], zone[2], zone[3], zone[4], zone[5],
        cos * ax + sin * ay, cos * ay - sin * ax, cos * bx + sin * by, cos * by - sin * bx,
    )  # fmt: skip
