"""Pictures of a mission: robot and obstacles, with the ground and fans around them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageChops

from evoros.base.arrays import Array
from evoros.geometry.footprint import bottom_height, top_height
from evoros.geometry.polyhedron import clip_polyhedron, convex_polyhedron, placed_corners
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.storage.figure_context import FigureContext, Part
from evoros.world.model import World
from evoros.world.standing import standing_obstacles

from ..tables.walkers import WalkerTrack
from .camera import Camera, Floats, Pixels, to_matrix
from .captions import CLEAR, FAILED, NEAR, Colour
from .fans import Fan, blend_fan
from .faults import Flags
from .ground import GOAL, RING, Ground
from .motion import Motion
from .scene import Scene
from .sensors import SILENT_M, ShownSensor, classify_sensors, colour_sensors
from .surfaces import Colour as Shade

CUT_M = 0.6
"""Obstacles are shown up to this height [m]; higher ones would hide the robot."""
FIXED, MOVABLE = (0.56, 0.61, 0.68), (0.82, 0.65, 0.42)
_THIN_M = 1e-4  # a polyhedron that would be cut to less is shown whole
_OVERSAMPLING = 2  # rendered pixels per pixel, in each direction
_AROUND_M = 8.0  # width of the ground around the mission
_TRACK_M, _TRACK_PX = 0.04, 2.0  # minimum width of the path


class Other(NamedTuple):
    """Another robot of the mission, which is shown without its sensors."""

    motion: Motion
    parts: Sequence[Part]  # that cast its shadow


@dataclass(frozen=True, eq=False)
class Renderer:
    """Renders a mission at n times; ``render`` must be called in the order of the times."""

    scene: Scene  # with the robot of ``motion`` first, then the others
    motion: Motion
    sensors: Sequence[ShownSensor]
    ended: Flags  # (n, sensors) whether its readings have ended
    errors: Array  # (n, sensors) how far its error is shown, 0 to 1
    goals: Array  # (n, 2) [m] of the next waypoint; NaN: none
    context: FigureContext
    ground: Ground
    others: Sequence[Other] = ()
    walkers: Sequence[Array] = ()  # (n, 2) [m], of each walker

    def render(self, index: int, camera: Camera) -> Pixels:
        """Return the picture (h, w, 3) at a time."""
        motions = [self.motion, *(other.motion for other in self.others)]
        for robot, motion in zip(self.scene.robots, motions, strict=True):
            frame = _frame(motion, index)
            joints = {name: float(angles[index]) for name, angles in motion.joints.items()}
            robot.move(frame, joints)
        self.scene.move_walkers([places[index] for places in self.walkers])
        for sensor, colour in zip(self.sensors, self.colour_sensors(index), strict=True):
            red, green, blue = (part / 255 for part in colour)
            self.scene.robots[0].paint(sensor.link, (red, green, blue))
        self._extend_track(index, camera)
        floor = self._project_floor(index, camera)
        picture, depth = self._render_solids(floor, camera)
        for fan in self._make_fans(index, _frame(self.motion, index)):
            blend_fan(picture, depth, camera, fan)
        return np.clip(np.round(picture), 0, 255).astype(np.uint8)

    def colour_sensors(self, index: int) -> list[Colour]:
        """Return the colour of each sensor at a time."""
        return colour_sensors(self.sensors, self.ended, self.errors, index)

    def _extend_track(self, index: int, camera: Camera) -> None:
        steps = slice(max(index - 2, 0), index + 1)  # overlapping, so that no joint is visible
        points = np.stack([self.motion.x_m[steps], self.motion.y_m[steps]], axis=1)
        depth = float((camera.pixels @ [*points[-1], 0.0, 1.0])[2])
        width = max(_TRACK_M, _TRACK_PX * depth / camera.pixels_per_radian)
        self.ground.extend_track(points, width)

    def _make_fans(self, index: int, robot: Array) -> list[Fan]:
        """Make the fans in the order of drawing, the most important ones last."""
        fans: list[tuple[int, Fan]] = []
        states = classify_sensors(self.sensors, self.ended, index)
        colours = self.colour_sensors(index)
        for sensor, state, colour in zip(self.sensors, states, colours, strict=True):
            if sensor.view is None:
                continue
            ranges, view = sensor.readings[index], sensor.view
            silent = np.isnan(ranges)
            reach = np.where(silent, min(SILENT_M, view.range_m), ranges)
            range_m = SILENT_M if silent.all() else view.range_m
            fan = Fan(robot @ view.frame, view.half_rad, reach, range_m, colour)
            fans.append(((CLEAR, FAILED, NEAR).index(state), fan))
        return [fan for _, fan in sorted(fans, key=lambda pair: pair[0])]

    def _project_floor(self, index: int, camera: Camera) -> Image.Image:
        """Return the ground with the robots' shadows and the goal, and the sky."""
        ground = self.ground.copy()
        for motion, parts in ((self.motion, self.context.parts), *self.others):
            ground.draw_shadow(parts, *motion.pose(index))
        goal = self.goals[index]
        if np.isfinite(goal).all():
            ground.draw_ring(goal.tolist(), 0.3, GOAL, 0.08)
        return ground.project(camera)

    def _render_solids(self, floor: Image.Image, camera: Camera) -> tuple[Floats, Floats]:
        """Return the picture (h, w, 3) of the solids on the floor, and the depths (h, w) [m]."""
        fine = camera.scale(_OVERSAMPLING)
        seen = self.scene.render(fine)
        solid = np.isfinite(seen.depth)
        colours = Image.fromarray(seen.colours).reduce(_OVERSAMPLING)
        free = Image.fromarray(np.where(solid, np.uint8(0), np.uint8(255))).reduce(_OVERSAMPLING)
        # The background of the solids is white, so subtract what the floor lacks to white.
        missing = ImageChops.multiply(ImageChops.invert(floor), Image.merge("RGB", [free] * 3))
        picture = ImageChops.subtract(colours, missing)
        part = (slice(_OVERSAMPLING // 2, None, _OVERSAMPLING),) * 2
        return np.asarray(picture, dtype=np.float32).copy(), seen.depth[part]


def _frame(motion: Motion, index: int) -> Array:
    """Return the frame (4, 4) of a robot's root link at a time."""
    x, y, yaw = motion.pose(index)
    return to_matrix(Pose.from_rpy((x, y, 0.0), 0.0, 0.0, yaw))


def paint_ground(world: World, track: Array) -> Ground:
    """Paint the ground around a mission with its course; ``track`` (n, 2) [m]."""
    points = np.vstack([track, world.course.route(True)])
    low, high = points.min(axis=0) - _AROUND_M, points.max(axis=0) + _AROUND_M
    ground = Ground(low, high, [body for body, _ in cut_obstacles(world)])
    for corner in world.course.waypoints:
        ground.draw_ring(corner, world.course.acceptance_m, RING, 0.03)
    return ground


def shape_walkers(walkers: Sequence[WalkerTrack]) -> list[Shape]:
    """Return the cylinders of walkers, cut at ``CUT_M``, on the ground."""
    heights = [min(walker.height_m, CUT_M) for walker in walkers]
    return [
        Shape("cylinder", (walker.radius_m, height), Pose((0.0, 0.0, height / 2)))
        for walker, height in zip(walkers, heights, strict=True)
    ]


def cut_obstacles(world: World) -> list[tuple[Body, Shade]]:
    """Return the bodies of a world, cut at ``CUT_M``, and their colours."""
    shown = []
    for body in standing_obstacles(world):
        cut = (_cut(body, shape) for shape in body.shapes)
        shapes = tuple(shape for shape in cut if shape is not None)
        if shapes:
            colour = FIXED if body.mass is None else MOVABLE
            shown.append((replace(body, shapes=shapes), colour))
    return shown


def _cut(body: Body, shape: Shape) -> Shape | None:
    """Cut an upright shape or a polyhedron at ``CUT_M``; None: all of it is higher."""
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
    """Return the next waypoint (n, 2) [m] at each record; NaN after the last.

    The direction is not recorded: its first waypoint is the one that the robot came nearer to.
    """
    first = places[: int(np.count_nonzero(visited == 0)) + 1]
    routes = [world.course.route(forward) for forward in (True, False)]
    distances = [np.hypot(*(first - route[0]).T).min() for route in routes]
    route = routes[int(np.argmin(distances))]
    return np.vstack([route, [[np.nan, np.nan]]])[np.clip(visited, 0, len(route))]
