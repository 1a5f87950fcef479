"""Renders pictures of a mission with robots, obstacles, ground and sensor fans."""

# VTK (pyvista 0.49) renders such a picture off screen in about 5 ms, but needs 806 MB, and loads
# EGL and a Mesa driver from the system, which pip does not install and containers lack. This
# renderer requires only packages from pip.

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.analysis.tables.readings import WalkerTrack
from evoros.base.arrays import Array
from evoros.geometry.footprint import bottom_height, top_height
from evoros.geometry.polyhedron import clip_polyhedron, convex_polyhedron, placed_corners
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.plugins.recordings.video.blending import blend, compiled, compose
from evoros.plugins.recordings.video.camera import NEAR_M, Camera, Floats, Pixels, to_matrix
from evoros.plugins.recordings.video.ground import GOAL, RING, Ground
from evoros.plugins.recordings.video.motion import Motion
from evoros.plugins.recordings.video.scene import Scene
from evoros.plugins.recordings.video.sensors import SILENT_M, ShownSensor
from evoros.plugins.recordings.video.surfaces import Colour
from evoros.storage.figure_context import FigureContext, Part
from evoros.world.model import World
from evoros.world.standing import standing_obstacles

_ARC = 13  # number of points on the arc of a fan, for its bounding box


class Fan(NamedTuple):
    """The field of view of a sensor, in the x-y plane of its frame, centred on x."""

    frame: Array  # (4, 4) sensor frame in the world
    half_rad: float  # half of the field of view
    reach_m: Array  # (k,) readings of equal sectors, right to left
    range_m: float
    colour: Pixels  # (3,)


def _blend_fan(picture: Floats, depth: Floats, camera: Camera, fan: Fan) -> None:
    """Blend a fan into ``picture`` (h, w, 3) wherever it is nearer than ``depth`` [m]."""
    plane = camera.plane(fan.frame)
    box = _bounding_box(plane, fan, camera.size)
    if box is None or abs(np.linalg.det(plane)) < 1e-9:  # invisible or seen edge-on
        return
    heights = fan.frame[2, [0, 1, 3]]
    shape = np.array([fan.half_rad, fan.range_m, camera.pixels_per_radian, *heights])
    colour, reach = (np.asarray(values, dtype=float) for values in (fan.colour, fan.reach_m))
    compiled(blend)(picture, depth, box, np.linalg.inv(plane), shape, reach, colour)


def _bounding_box(plane: Array, fan: Fan, size: tuple[int, int]) -> NDArray[np.int64] | None:
    """Return the top, bottom, left and right ends of the pixels that a fan may cover."""
    angles = np.linspace(-fan.half_rad, fan.half_rad, _ARC)
    # the margin covers the bulge of the arc between sampled points
    reach = (1.04 if fan.half_rad > 1.0 else 1.03) * float(fan.reach_m.max())
    arc = [[reach * np.cos(a), reach * np.sin(a), 1.0] for a in angles]
    corners = np.array([[0.0, 0.0, 1.0], *arc]) @ plane.T
    points = _clip_to_front(corners)
    if not len(points):
        return None
    low = np.floor(points.min(axis=0) - 2).astype(int).clip(0, size)
    high = np.ceil(points.max(axis=0) + 2).astype(int).clip(0, size)
    if (low >= high).any():
        return None
    return np.array([low[1], high[1], low[0], high[0]])


def _clip_to_front(corners: Array) -> Array:
    """Return a polygon (n, 3), clipped in front of the camera, as columns and rows (k, 2)."""
    clipped = []
    for corner, following in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if corner[2] >= NEAR_M:
            clipped.append(corner)
        if (corner[2] >= NEAR_M) != (following[2] >= NEAR_M):
            share = (NEAR_M - corner[2]) / (following[2] - corner[2])
            clipped.append(corner + share * (following - corner))
    points = np.array(clipped).reshape(-1, 3)
    return np.asarray(points[:, :2] / points[:, 2:])


CUT_M = 0.6  # height [m] at which obstacles are cut off, because taller ones would hide the robot
FIXED, MOVABLE = (0.56, 0.61, 0.68), (0.82, 0.65, 0.42)
_THIN_M = 1e-4  # thickness [m] below which a cut polyhedron is shown uncut
_OVERSAMPLING = 2  # rendered pixels per pixel of the picture, in each direction
_AROUND_M = 8.0  # margin [m] of the painted ground around the path and the course
_TRACK_M, _TRACK_PX = 0.04, 2.0  # minimum widths of the path [m, px]


class Other(NamedTuple):
    """Another robot of the mission, drawn without sensors."""

    motion: Motion
    parts: Sequence[Part]  # parts that cast shadows


@dataclass(frozen=True, eq=False)
class Renderer:
    """Renders a mission at n times; call ``render`` in the order of the times."""

    scene: Scene  # the robot of ``motion`` comes first
    motion: Motion
    sensors: Sequence[ShownSensor]
    goals: Array  # (n, 2) [m], next waypoint; NaN after the last
    context: FigureContext
    ground: Ground
    others: Sequence[Other] = ()
    walkers: Sequence[Array] = ()  # positions (n, 2) [m] of each walker

    def render(self, index: int, camera: Camera) -> Pixels:
        """Return the picture (h, w, 3) at a time index."""
        motions = [self.motion, *(other.motion for other in self.others)]
        for robot, motion in zip(self.scene.robots, motions, strict=True):
            joints = {name: float(angles[index]) for name, angles in motion.joints.items()}
            robot.move(_frame(motion, index), joints)
        self.scene.move_walkers([places[index] for places in self.walkers])
        for sensor in self.sensors:
            self.scene.robots[0].paint(sensor.link, sensor.colours[index] / 255)
        self._extend_track(index, camera)
        picture, depth = self._render_solids(*self._project_floor(index, camera), camera)
        for fan in self._make_fans(index, _frame(self.motion, index)):
            _blend_fan(picture, depth, camera, fan)
        return np.rint(picture, out=picture).clip(0, 255, out=picture).astype(np.uint8)

    def _extend_track(self, index: int, camera: Camera) -> None:
        steps = slice(max(index - 2, 0), index + 1)  # overlapping strokes hide their joints
        points = np.stack([self.motion.x_m[steps], self.motion.y_m[steps]], axis=1)
        depth = float((camera.pixels @ [*points[-1], 0.0, 1.0])[2])
        width = max(_TRACK_M, _TRACK_PX * depth / camera.pixels_per_radian)
        self.ground.extend_track(points, width)

    def _make_fans(self, index: int, robot: Array) -> list[Fan]:
        fans = []
        for sensor in sorted(self.sensors, key=lambda sensor: sensor.states[index]):
            if sensor.view is None:
                continue
            ranges, view = sensor.readings[index], sensor.view
            silent = np.isnan(ranges)
            reach = np.where(silent, min(SILENT_M, view.range_m), ranges)
            range_m = SILENT_M if silent.all() else view.range_m
            frame, colour = robot @ view.frame, sensor.colours[index]
            fans.append(Fan(frame, view.half_rad, reach, range_m, colour))
        return fans

    def _project_floor(self, index: int, camera: Camera) -> tuple[Pixels, Pixels]:
        with self.ground.painted():
            for motion, parts in ((self.motion, self.context.parts), *self.others):
                self.ground.draw_shadow(parts, *motion.pose(index))
            goal = self.goals[index]
            if np.isfinite(goal).all():
                self.ground.draw_ring(goal.tolist(), 0.3, GOAL, 0.08)
            return self.ground.project(camera)

    def _render_solids(self, floor: Pixels, fog: Pixels, camera: Camera) -> tuple[Floats, Floats]:
        """Return the picture (h, w, 3) of solids on the floor, and the depths (h, w) [m]."""
        width, height = camera.size
        seen = self.scene.render(replace(camera, size=(2 * width, 2 * height)))
        picture, depth = (
            np.empty((height, width, 3), np.float32),
            np.empty((height, width), np.float32),
        )
        compiled(compose)(floor, fog, seen.colours, seen.nearness, picture, depth)
        return picture, depth


def _frame(motion: Motion, index: int) -> Array:
    x, y, yaw = motion.pose(index)
    return to_matrix(Pose.from_rpy((x, y, 0.0), 0.0, 0.0, yaw))


def paint_ground(world: World, track: Array) -> Ground:
    """Paint the ground and the course around a mission; ``track`` (n, 2) [m] is the path."""
    points = np.vstack([track, world.course.route(True)])
    low, high = points.min(axis=0) - _AROUND_M, points.max(axis=0) + _AROUND_M
    ground = Ground(low, high, [body for body, _ in cut_obstacles(world)])
    for corner in world.course.waypoints:
        ground.draw_ring(corner, world.course.acceptance_m, RING, 0.03)
    return ground


def shape_walkers(walkers: Sequence[WalkerTrack]) -> list[Shape]:
    """Return the walkers as cylinders on the ground, cut off at ``CUT_M``."""
    sizes = [(walker.radius_m, min(walker.height_m, CUT_M)) for walker in walkers]
    return [Shape("cylinder", size, Pose((0.0, 0.0, size[1] / 2))) for size in sizes]


def cut_obstacles(world: World) -> list[tuple[Body, Colour]]:
    """Return the bodies of a world, cut off at ``CUT_M``, with their colours."""
    shown = []
    for body in standing_obstacles(world):
        cut = (_cut(body, shape) for shape in body.shapes)
        shapes = tuple(shape for shape in cut if shape is not None)
        if shapes:
            colour = FIXED if body.mass is None else MOVABLE
            shown.append((replace(body, shapes=shapes), colour))
    return shown


def _cut(body: Body, shape: Shape) -> Shape | None:
    """Cut off an upright shape or a polyhedron at ``CUT_M``; None if entirely above."""
    pose = body.pose @ shape.pose
    low, high = bottom_height(shape, pose), top_height(shape, pose)
    if low >= CUT_M:
        return None
    if shape.kind == "convex" and high > CUT_M > low + _THIN_M:
        return _cut_polyhedron(shape, pose)
    upright = np.abs(pose.rotation[2]) > 1 - 1e-6
    axes = {"box": upright, "cylinder": upright[2:]}.get(shape.kind, upright[:0])
    if high <= CUT_M or not axes.any():
        return shape
    size = list(shape.size)
    size[int(np.argmax(axes)) if shape.kind == "box" else 1] = CUT_M - low
    x, y, _ = pose.position
    middle = Pose((x, y, (low + CUT_M) / 2), pose.quaternion)
    return Shape(shape.kind, tuple(size), body.pose.inverse() @ middle)


def _cut_polyhedron(shape: Shape, pose: Pose) -> Shape:
    solid = convex_polyhedron(shape.corners)
    corners = placed_corners(solid.corners, pose.rotation, pose.position)
    kept = clip_polyhedron(corners, solid.edges, -math.inf, CUT_M)
    local = placed_corners(kept - np.array(pose.position), pose.rotation.T, (0.0, 0.0, 0.0))
    return replace(shape, corners=tuple((x, y, z) for x, y, z in local.tolist()))


def find_goals(world: World, places: Array, visited: NDArray[np.int64]) -> Array:
    """Return the next waypoint (n, 2) [m] at each record; NaN after the last waypoint."""
    # The waypoint first approached determines the direction of the route.
    first = places[: int(np.count_nonzero(visited == 0)) + 1]
    routes = [world.course.route(forward) for forward in (True, False)]
    distances = [np.hypot(*(first - route[0]).T).min() for route in routes]
    route = routes[int(np.argmin(distances))]
    return np.vstack([route, [[np.nan, np.nan]]])[np.clip(visited, 0, len(route))]
