"""Robots in a world as the server of Gazebo's physics opens them."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

from evoros.geometry.footprint import bottom_height
from evoros.geometry.inertia import joint_moments
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.robot.model import Robot
from evoros.simulator.engines.gazebo_robot import format_robot
from evoros.simulator.engines.gazebo_shapes import (
    GROUND,
    OBSTACLE,
    SOLID,
    WALKER,
    Inertial,
    Solid,
    format_link,
    format_numbers,
    format_pose,
)
from evoros.simulator.engines.mujoco_bodies import MAX_FRICTION
from evoros.simulator.engines.servos import lag_gain
from evoros.simulator.engines.set_down import home_frame
from evoros.simulator.engines.walking import GAP_M as WALKER_GAP_M
from evoros.simulator.protocol import PlacedRobot
from evoros.world.floors import ground_height
from evoros.world.model import KEPT_WORLDS, World
from evoros.world.standing import GAP_M

WALKER_KG = 80.0


class Settings(NamedTuple):
    """The settings of the engine, besides robots and world."""

    time_step: float  # [s]
    wheel_friction: float
    steering_lag_s: float


@lru_cache(maxsize=KEPT_WORLDS)
def hold_standing(world: World, robots: int) -> World:
    """Return the world with bodies fixed that nothing moves before a mission ends.

    DART computes each body that could move in every step, also at rest. Missions of one robot that
    end at the first contact push nothing, so that only bodies in the air move.
    """
    if not (world.course.end_on_collision and world.is_level and robots == 1):
        return world
    return replace(world, bodies=tuple(map(_hold, world.bodies)))


def _hold(body: Body) -> Body:
    if body.mass is None or _bottom(body) > GAP_M:
        return body
    return replace(body, mass=None, inertia=None)


def _bottom(body: Body) -> float:
    return min(bottom_height(shape, body.pose @ shape.pose) for shape in body.shapes)


def describe_scene(robots: Sequence[PlacedRobot], world: World, settings: Settings) -> bytes:
    """Return what the server reads to open robots in a world.

    Raises:
        SimulationError: SDF has not what a robot has.
    """
    sizes = () if world.crowd is None else world.crowd.sizes
    parts = [_format_walker(i, *size) for i, size in enumerate(sizes)]
    parts.append(_format_fixed([body for body in world.bodies if body.mass is None]))
    movable = (body for body in world.bodies if body.mass is not None)
    parts += [_format_movable(body, i) for i, body in enumerate(movable)]
    for i, (robot, home) in enumerate(robots):
        frame = _set_down(robot, home, world)
        parts.append(format_robot(robot, i, frame, settings.wheel_friction))
    models, meshes = [text for text, _ in parts], [mesh for _, more in parts for mesh in more]
    gain = lag_gain(settings.time_step, settings.steering_lag_s)
    head = f"{format_numbers([settings.time_step, world.gravity_mps2, gain])} {len(meshes)}"
    sdf = f'<sdf version="1.9"><world name="scene">{"".join(models)}</world></sdf>'
    return "\n".join([head, *meshes, sdf]).encode()


def _set_down(robot: Robot, home: tuple[float, float, float, float], world: World) -> Pose:
    """Return the pose of the root link at a home, with the wheels on the ground.

    DART takes seconds to raise a robot out of the ground into which a fall has pressed it.
    """
    x, y, _, yaw = home
    (px, py, pz), (qx, qy, qz, qw) = home_frame(robot, (x, y, 0.0, yaw), world)
    pose = Pose((px, py, pz), (qx, qy, qz, qw))
    if not world.is_level:
        return pose
    corners = (pose.transform((a, b, 0.0)) for a, b in robot.outline.tolist())
    heights = (ground_height(world.bodies, (a, b)) for a, b, _ in corners)
    top = max((height for height in heights if height is not None), default=0.0)
    return Pose((x, y, top), pose.quaternion)


def _format_fixed(bodies: Sequence[Body]) -> tuple[str, list[str]]:
    """Return one model of all fixed bodies: DART visits each model in every step."""
    solids = [
        Solid(
            GROUND if body.is_ground else OBSTACLE,
            shape,
            body.pose @ shape.pose,
            min(body.friction, MAX_FRICTION),
        )
        for body in bodies
        for shape in body.shapes
    ]
    link, meshes = format_link("fixed", "link0", Pose(), None, solids)
    return f'<model name="fixed"><static>true</static>{link}</model>', meshes


def _format_movable(body: Body, index: int) -> tuple[str, list[str]]:
    """Return the model of a body that can move."""
    mass, model = body.mass or 0.0, f"body{index}"
    moments = body.inertia or joint_moments(body.shapes, mass)
    inertial = Inertial(mass, Pose(), (*moments, 0.0, 0.0, 0.0))
    friction = min(body.friction, MAX_FRICTION)
    solids = [Solid(SOLID, shape, shape.pose, friction) for shape in body.shapes]
    link, meshes = format_link(model, "link0", Pose(), inertial, solids)
    return f'<model name="{model}">{format_pose(body.pose)}{link}</model>', meshes


def _format_walker(index: int, radius: float, height: float) -> tuple[str, list[str]]:
    """Return the model of a walker, which slides along two axes."""
    model, frame = f"walker{index}", Pose((0.0, 0.0, height / 2.0 + WALKER_GAP_M))
    inertial = Inertial(WALKER_KG, Pose(), (WALKER_KG, WALKER_KG, WALKER_KG, 0.0, 0.0, 0.0))
    cylinder = Solid(WALKER, Shape("cylinder", (radius, height)), Pose(), MAX_FRICTION)
    carrier, _ = format_link(model, "carrier", Pose(), inertial, [])
    link, meshes = format_link(model, "link0", Pose(), inertial, [cylinder])
    ends = (("x", "world", "carrier", "1 0 0"), ("y", "carrier", "link0", "0 1 0"))
    joints = [
        f'<joint name="{name}" type="prismatic"><parent>{parent}</parent><child>{child}</child>'
        f"<axis><xyz>{axis}</xyz></axis></joint>"
        for name, parent, child, axis in ends
    ]
    return (
        f'<model name="{model}">{format_pose(frame)}{carrier}{link}{"".join(joints)}</model>',
        meshes,
    )
