"""Contacts of robots in the plane with obstacles, pushable bodies and other robots."""

from typing import NamedTuple

from evoros.base.arrays import CONTACT, Array, Matrix
from evoros.base.compilable import compilable
from evoros.base.packing import unpack
from evoros.geometry.footprint import CENTRE_X, CENTRE_Y, CIRCLE, END, RADIUS, START
from evoros.geometry.grid import cell_at
from evoros.geometry.polygon import polygon_contact, polygon_distance, transform_polygon
from evoros.simulator.engines import planar_bodies as bodies
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines.planar_bodies import Movables, Placed, PlanarPose
from evoros.simulator.engines.planar_layout import ZONE, Memory, Plane, hull_of, pose_of, probes_of
from evoros.simulator.engines.planar_pushing import TOLERANCE_M, is_near
from evoros.simulator.engines.rays import Zone, crosses_zone

SKIN_M = 1e-3  # maximum gap [m] at which a robot still touches a body that it has pushed


class Outline(NamedTuple):
    """The outline of a robot, in a class because compiled functions must not return plain views."""

    corners: Matrix  # (k, 2) [m]


@compilable
def outline_of(parameters: Array, memory: Array, index: int) -> Outline:
    """Return the outline of a robot at its last placement."""
    places = unpack(Plane, parameters).places
    first, end = int(places[index, layout.CORNERS]), int(places[index + 1, layout.CORNERS])
    return Outline(unpack(Memory, memory).outlines[first:end])


@compilable
def place_outline(parameters: Array, memory: Array, index: int, pose: PlanarPose) -> Outline:
    """Place the outline of a robot at a pose, and return it."""
    x, y, cos, sin = pose
    outline = outline_of(parameters, memory, index)
    transform_polygon(hull_of(parameters, index).outline, x, y, cos, sin, outline.corners)
    return outline


@compilable
def touches(parameters: Array, memory: Array, index: int, pose: PlanarPose) -> bool:
    """Return True if a robot overlaps a fixed obstacle or a robot, whose contact is recorded."""
    motions = unpack(Memory, memory).motions
    touched = False
    for other in range(len(motions)):
        if other != index and overlaps_robot(parameters, memory, index, pose, other):
            motions[other, CONTACT] = 1.0
            touched = True
    robot = hull_of(parameters, index)
    x, y, _, _ = pose
    cell = cell_at(robot.grid, x, y)
    if cell < 0:
        return touched
    is_placed = False
    for entry in range(int(robot.starts[cell]), int(robot.starts[cell + 1])):
        row = robot.footprints[int(robot.entries[entry])]
        if is_far(row, robot.radius, x, y):
            continue
        if not is_placed:
            place_outline(parameters, memory, index, pose)
            is_placed = True
        polygon = robot.corners[int(row[START]) : int(row[END])]
        outline = outline_of(parameters, memory, index).corners
        if polygon_distance(outline, polygon, row[RADIUS]) <= row[RADIUS]:
            return True
    return touched


@compilable
def is_far(footprint: Array, radius: float, x: float, y: float) -> bool:
    """Return True if a footprint is too far from a robot at (x, y) [m] to touch it."""
    dx = footprint[CENTRE_X] - x
    dy = footprint[CENTRE_Y] - y
    near = radius + footprint[CIRCLE]
    return bool(dx * dx + dy * dy > near * near)


@compilable
def overlaps_robot(
    parameters: Array, memory: Array, index: int, pose: PlanarPose, other: int
) -> bool:
    """Return True if a robot at a pose overlaps another robot; place both outlines."""
    there = pose_of(memory, other)
    dx = there[0] - pose[0]
    dy = there[1] - pose[1]
    near = hull_of(parameters, index).radius + hull_of(parameters, other).radius
    if dx * dx + dy * dy > near * near:
        return False
    outline = place_outline(parameters, memory, index, pose).corners
    obstacle = place_outline(parameters, memory, other, there).corners
    return bool(polygon_distance(outline, obstacle, 0.0) <= 0.0)


@compilable
def feel_robots(parameters: Array, memory: Array, index: int, pose: PlanarPose) -> None:
    """Count touches of the contact sensors on a robot and on all robots that overlap it."""
    for other in range(len(unpack(Memory, memory).motions)):
        if other != index and overlaps_robot(parameters, memory, index, pose, other):
            outline = outline_of(parameters, memory, index).corners
            obstacle = outline_of(parameters, memory, other).corners
            feel_polygon(parameters, memory, index, pose, obstacle, 0.0)
            feel_polygon(parameters, memory, other, pose_of(memory, other), outline, 0.0)


@compilable
def feel_pressed(parameters: Array, memory: Array, index: int) -> bool:
    """Return True if bodies pushed by a robot overlap other robots; record these contacts."""
    movables = unpack(Movables, unpack(Plane, parameters).movables)
    placed = unpack(Placed, unpack(Memory, memory).movables)
    pressed = False
    for other in range(len(unpack(Memory, memory).motions)):
        robot = hull_of(parameters, other)
        pose = pose_of(memory, other)
        for i in range(len(placed.levels)):
            body = movables.bodies[i]
            reach = robot.radius + body[bodies.BODY_RADIUS]
            if other == index or placed.levels[i] == 0.0:
                continue
            if not is_near(placed, i, pose[0], pose[1], reach):
                continue
            outline = place_outline(parameters, memory, other, pose).corners
            for p in range(int(body[bodies.FIRST_PART]), int(body[bodies.END_PART])):
                part = movables.parts[p]
                if part[bodies.BOTTOM] >= robot.height or part[bodies.TOP] <= 0.0:
                    continue
                polygon = placed.corners[int(part[bodies.START]) : int(part[bodies.END])]
                radius = part[bodies.RADIUS]
                if polygon_contact(outline, polygon, 0.0, radius)[0] > TOLERANCE_M:
                    feel_polygon(parameters, memory, other, pose, polygon, radius)
                    unpack(Memory, memory).motions[other, CONTACT] = 1.0
                    pressed = True
    return pressed


@compilable
def feel(parameters: Array, memory: Array, index: int, pose: PlanarPose) -> None:
    """Count a touch for each contact zone that an obstacle or pushable body touches."""
    probes = probes_of(parameters, index).contact
    place_outline(parameters, memory, index, pose)
    touched = int(unpack(Plane, parameters).places[index, layout.TOUCHES])
    for i in range(len(probes)):
        zone = zone_of(probes[i])
        if feels_fixed(parameters, memory, index, pose, zone) or feels_bodies(
            parameters, memory, index, pose, zone
        ):
            unpack(Memory, memory).touches[touched + i] += 1.0


@compilable
def feel_polygon(
    parameters: Array, memory: Array, index: int, pose: PlanarPose, polygon: Array, radius: float
) -> None:
    """Count a touch for each contact zone of a robot at a pose that a rounded polygon overlaps."""
    probes = probes_of(parameters, index).contact
    touched = int(unpack(Plane, parameters).places[index, layout.TOUCHES])
    outline = outline_of(parameters, memory, index).corners
    for i in range(len(probes)):
        contact = polygon_contact(outline, polygon, 0.0, radius)
        if lies_in_zone(contact, zone_of(probes[i]), pose):
            unpack(Memory, memory).touches[touched + i] += 1.0


@compilable
def zone_of(probe: Array) -> Zone:
    """Return the contact zone of a probe."""
    zone = probe[ZONE:]
    return Zone(zone[0], zone[1], zone[2], zone[3], zone[4], zone[5])


@compilable
def feels_fixed(parameters: Array, memory: Array, index: int, pose: PlanarPose, zone: Zone) -> bool:
    """Return True if a fixed obstacle overlaps the outline within a contact zone."""
    robot = hull_of(parameters, index)
    cell = cell_at(robot.grid, pose[0], pose[1])
    if cell < 0:
        return False
    outline = outline_of(parameters, memory, index).corners
    for entry in range(int(robot.starts[cell]), int(robot.starts[cell + 1])):
        row = robot.footprints[int(robot.entries[entry])]
        if is_far(row, robot.radius, pose[0], pose[1]):
            continue
        polygon = robot.corners[int(row[START]) : int(row[END])]
        if lies_in_zone(polygon_contact(outline, polygon, 0.0, row[RADIUS]), zone, pose):
            return True
    return False


@compilable
def feels_bodies(
    parameters: Array, memory: Array, index: int, pose: PlanarPose, zone: Zone
) -> bool:
    """Return True if a pushable body touches the outline within a contact zone."""
    parts = unpack(Movables, unpack(Plane, parameters).movables).parts
    corners = unpack(Placed, unpack(Memory, memory).movables).corners
    height = hull_of(parameters, index).height
    outline = outline_of(parameters, memory, index).corners
    for p in range(len(parts)):
        part = parts[p]
        if part[bodies.BOTTOM] >= height or part[bodies.TOP] <= 0.0:
            continue
        polygon = corners[int(part[bodies.START]) : int(part[bodies.END])]
        contact = polygon_contact(outline, polygon, SKIN_M, part[bodies.RADIUS])
        if lies_in_zone(contact, zone, pose):
            return True
    return False


@compilable
def lies_in_zone(
    contact: tuple[float, float, float, float, float, float], zone: Zone, pose: PlanarPose
) -> bool:
    """Return True if a contact of a robot at a pose lies in a contact zone."""
    depth, nx, ny, along, low, high = contact
    if depth <= 0.0:
        return False
    x, y, cos, sin = pose
    # End points of the contact relative to the robot's origin, along the world axes.
    ax = along * nx - low * ny - x
    ay = along * ny + low * nx - y
    bx = along * nx - high * ny - x
    by = along * ny + high * nx - y
    ahead, aside = cos * ax + sin * ay, cos * ay - sin * ax
    return crosses_zone(zone, ahead, aside, cos * bx + sin * by, cos * by - sin * bx)
