"""Pictures of a mission: the robot and its obstacles in PyBullet, ground and fans around them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageChops

from evoros.base.arrays import Array
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.footprint import bottom_height, top_height
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.simulator.engines.pybullet_viewer import NO_BODY, Scene
from evoros.simulator.engines.pybullet_viewer import Colour as Shade
from evoros.storage.figure_context import FigureContext
from evoros.world.model import World

from .camera import Camera, Floats, Pixels
from .captions import CLEAR, FAILED, NEAR, Colour
from .fans import Fan, blend
from .ground import GOAL, RING, Ground
from .motion import Motion

Flags = NDArray[np.bool_]
CUT_M = 0.6
"""Obstacles are shown up to this height [m]: what is higher would hide the robot."""
FIXED, MOVABLE = (0.56, 0.61, 0.68), (0.82, 0.65, 0.42)
_FINER = 2  # so many times as many pixels are rendered, in each direction
_AROUND_M = 8.0  # of ground around the mission that is painted
_TRACK_M, _TRACK_PX = 0.04, 2.0  # the least width of the path
_STUMP_M = 0.3  # shown of a sensor that is silent


@dataclass(frozen=True)
class Eye:
    """A sensor that is shown."""

    link: str  # of the robot
    frame: Array  # (4, 4): in the robot's frame
    half_rad: float  # half its opening
    range_m: float
    near_m: float  # readings below are marked


@dataclass(frozen=True, eq=False)
class Footage:
    """A mission at some times; ``picture`` must be called in the order of the times."""

    scene: Scene
    moves: Motion
    eyes: Sequence[Eye]
    readings: Array  # (n, sensors) [m] at these times; NaN: silent
    failed: Flags  # (n, sensors) whether it has failed
    goals: Array  # (n, 2) [m], the next waypoint; NaN: none
    setting: FigureContext
    ground: Ground

    def picture(self, number: int, camera: Camera) -> Pixels:
        """(h, w, 3) uint8."""
        moves = self.moves
        x, y, yaw = (float(each[number]) for each in (moves.x_m, moves.y_m, moves.yaw_rad))
        pose = Pose.from_rpy((x, y, 0.0), 0.0, 0.0, yaw)
        self.scene.move(
            pose.position,
            pose.quaternion,
            {name: float(angles[number]) for name, angles in moves.joints.items()},
        )
        states = self.states(number)
        for eye, colour in zip(self.eyes, states, strict=True):
            red, green, blue = (part / 255 for part in colour)
            self.scene.paint(eye.link, (red, green, blue))
        self._leave_track(number, camera)
        drawn, depth = self._solids(self._floor(number, (x, y, yaw), camera), camera)
        for fan in self._fans(number, _matrix(pose), states):
            blend(drawn, depth, camera, fan)
        return np.clip(np.round(drawn), 0, 255).astype(np.uint8)

    def _leave_track(self, number: int, camera: Camera) -> None:
        back = slice(max(number - 2, 0), number + 1)  # one step twice, so that no joint is seen
        points = np.stack([self.moves.x_m[back], self.moves.y_m[back]], axis=1)
        depth = float((camera.pixels @ [*points[-1], 0.0, 1.0])[2])
        width = max(_TRACK_M, _TRACK_PX * depth / camera.pixels_per_radian)
        self.ground.track(points, width)

    def states(self, number: int) -> list[Colour]:
        """The colour of each sensor at a time."""
        readings, failed = self.readings[number], self.failed[number]
        return [
            FAILED if broken or np.isnan(reading) else NEAR if reading < eye.near_m else CLEAR
            for eye, reading, broken in zip(self.eyes, readings, failed, strict=True)
        ]

    def _fans(self, number: int, robot: Array, states: Sequence[Colour]) -> list[Fan]:
        """Those that are to be noticed last, over the others."""
        fans = []
        for eye, reading, colour in zip(self.eyes, self.readings[number], states, strict=True):
            reach, most = (_STUMP_M, _STUMP_M) if np.isnan(reading) else (reading, eye.range_m)
            fans.append(Fan(robot @ eye.frame, eye.half_rad, float(reach), most, colour))
        return sorted(fans, key=lambda fan: (CLEAR, FAILED, NEAR).index(fan.colour))

    def _floor(self, number: int, place: tuple[float, float, float], camera: Camera) -> Image.Image:
        """The ground and the sky, as if nothing stood there."""
        ground = self.ground.copy()
        ground.shadow(self.setting.parts, *place)
        goal = self.goals[number]
        if np.isfinite(goal).all():
            ground.ring(goal.tolist(), 0.3, GOAL, 0.08)
        return ground.seen(camera)

    def _solids(self, floor: Image.Image, camera: Camera) -> tuple[Floats, Floats]:
        """The picture (h, w, 3) float32 with what stands on the floor, and depths (h, w) [m]."""
        finer = camera.scaled(_FINER)
        seen = self.scene.render(finer.view, finer.projection, finer.size, finer.light.tolist())
        solid = seen.bodies != NO_BODY
        colours = Image.frombuffer("RGBX", finer.size, seen.colours).reduce(_FINER).convert("RGB")
        free = Image.fromarray(np.where(solid, np.uint8(0), np.uint8(255))).reduce(_FINER)
        # Where nothing is, PyBullet's picture is white: take away what the floor is not.
        missing = ImageChops.multiply(ImageChops.invert(floor), Image.merge("RGB", [free] * 3))
        drawn = ImageChops.subtract(colours, missing)
        part = (slice(_FINER // 2, None, _FINER),) * 2
        depth = np.where(solid[part], camera.depth(seen.depth[part]), np.float32(np.inf))
        return np.asarray(drawn, dtype=np.float32).copy(), depth


def _matrix(pose: Pose) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.position
    return matrix


def eyes(robot: Urdf, setting: FigureContext, count: int, near_m: float | None) -> list[Eye]:
    """The sensors of a robot, in the order of the readings.

    ``near_m`` None is half the range of each.
    """
    found = []
    for number in range(count):
        for kind, beam in setting.beams.items():
            link = f"{kind}_{number}"
            if link in robot.poses:
                half = math.radians(max(beam.fov_deg, 1.0)) / 2
                near = beam.range_max_m / 2 if near_m is None else near_m
                frame = _matrix(_levelled(robot.poses[link], half))
                found.append(Eye(link, frame, half, beam.range_max_m, near))
    if len(found) != count:
        raise robot.error(
            f"must have a link for each of the {count} sensors of the trajectory, and has "
            f"{len(found)}",
            "take the description of the robot that flew the mission",
        )
    return found


def _levelled(pose: Pose, half_rad: float) -> Pose:
    """A level frame for a sensor whose beam, if it is as high as it is wide, has level rays.

    What stands on the ground is met by these, and so lies where a level fan ends.
    """
    if abs(math.asin(min(1.0, max(-1.0, float(pose.rotation[2, 0]))))) > half_rad:
        return pose
    return Pose.from_rpy(pose.position, 0.0, 0.0, pose.yaw)


def painted(world: World, track: Array) -> Ground:
    """The ground around a mission with its course; ``track`` (n, 2) [m]."""
    points = np.vstack([track, world.course.route(True)])
    low, high = points.min(axis=0) - _AROUND_M, points.max(axis=0) + _AROUND_M
    ground = Ground(low, high, [body for body, _ in obstacles(world)])
    for corner in world.course.waypoints:
        ground.ring(corner, world.course.acceptance_m, RING, 0.03)
    return ground


def obstacles(world: World) -> list[tuple[Body, Shade]]:
    """What is shown of the world's bodies, and in which colours."""
    shown = []
    for body in world.obstacles:
        shapes = tuple(_cut(body, shape) for shape in body.shapes)
        kept = tuple(shape for shape in shapes if shape is not None)
        if kept:
            colour = FIXED if body.mass is None else MOVABLE
            shown.append((replace(body, shapes=kept), colour))
    return shown


def _cut(body: Body, shape: Shape) -> Shape | None:
    """Without what is above ``CUT_M``, if it stands upright; None: all of it is."""
    pose = body.pose @ shape.pose
    low, high = bottom_height(shape, pose), top_height(shape, pose)
    if low >= CUT_M:
        return None
    upright = np.abs(pose.rotation[2]) > 1 - 1e-6
    axes = {"box": upright, "cylinder": upright[2:]}.get(shape.kind, upright[:0])
    if high <= CUT_M or not axes.any():
        return shape
    size = list(shape.size)
    size[int(np.argmax(axes)) if shape.kind == "box" else 1] = CUT_M - low
    x, y, _ = pose.position
    middle = Pose((x, y, (low + CUT_M) / 2), pose.quaternion)
    return Shape(shape.kind, tuple(size), body.pose.inverse() @ middle)


def goals(world: World, places: Array, visited: NDArray[np.int64]) -> Array:
    """(n, 2) [m]: the next waypoint at each record; NaN behind the last.

    The direction of the course is not recorded: it is that whose first waypoint the robot at
    ``places`` (n, 2) came nearer to before it had ``visited`` (n,) one.
    """
    first = places[: int(np.count_nonzero(visited == 0)) + 1]
    routes = [world.course.route(forward) for forward in (True, False)]
    distances = [np.hypot(*(first - route[0]).T).min() for route in routes]
    route = routes[int(np.argmin(distances))]
    return np.vstack([route, [[np.nan, np.nan]]])[np.clip(visited, 0, len(route))]


def failures(times: Array, count: int, failed: Mapping[int, float]) -> Flags:
    """(n, count): whether each sensor has failed by then; ``failed`` has times [s] by sensor."""
    since = np.array([failed.get(number, np.inf) for number in range(count)])
    return np.asarray(times[:, None] >= since[None])
