"""The planar simulator's motion rules: robots move in turn, and stop before others' outlines."""

import math
from typing import NamedTuple

import numpy as np

from evoros.base import arrays, elementary
from evoros.base.arrays import (
    COMMAND_SIZE,
    CONTACT,
    SPEED,
    STATE_SIZE,
    STRENGTH_SIZE,
    YAW,
    YAW_RATE,
    Array,
    Matrix,
)
from evoros.base.compilable import compilable, inlined
from evoros.base.packing import unpack
from evoros.geometry import ray
from evoros.geometry.polygon import find_border
from evoros.geometry.shapes import Pose, Shape
from evoros.simulator.engines import planar_contact as contact
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines import planar_pushing as pushing
from evoros.simulator.engines.planar_bodies import Movables, Placed, PlanarPose
from evoros.simulator.engines.planar_layout import Drive, Memory, Plane, hull_of, pose_of
from evoros.simulator.engines.planar_pushing import BLOCKED, PUSHED, UNTOUCHED
from evoros.walkers import layout as at
from evoros.walkers.crowd import Crowd, note_touch, report_walkers
from evoros.walkers.layout import Walk, Walking
from evoros.walkers.motion import walk
from evoros.world.standing import sight_rows

NEAR_M = 1.0  # maximum distance [m] that a robot moves in a step


def place_crowd(placed: Placed, crowd: Crowd, robots: int) -> Placed:
    """Add the walkers of a mission to ``placed``, at their initial positions."""
    solids = [
        (Shape("cylinder", (radius, height)), Pose((0.0, 0.0, height / 2.0)))
        for radius, height in crowd.sizes
    ]
    rows = sight_rows(solids)[0]
    place_walkers(unpack(Walking, crowd.memory), rows)
    sights = np.concatenate([placed.sights, rows])
    return placed._replace(sights=sights, robots=np.zeros((robots, 4)), walking=crowd.memory.copy())


@compilable
def place_walkers(now: Walking, shapes: Array) -> None:
    """Move the walkers' ray shapes, the last rows of ``shapes``, to the walkers."""
    first = len(shapes) - len(now.places)
    for i in range(len(now.places)):
        shapes[first + i, ray.AT_X] = now.places[i, 0]
        shapes[first + i, ray.AT_Y] = now.places[i, 1]


@compilable
def move_walkers(parameters: Array, memory: Array) -> None:
    """Move all walkers by one step, given the current poses of the robots."""
    plane = unpack(Plane, parameters)
    placed = unpack(Placed, unpack(Memory, memory).movables)
    for i in range(len(placed.robots)):
        x, y, cos, sin = pose_of(memory, i)
        placed.robots[i, 0] = x
        placed.robots[i, 1] = y
        placed.robots[i, 2] = cos
        placed.robots[i, 3] = sin
    rule = unpack(Movables, plane.movables).walk
    walk(rule, placed.walking, placed.robots, plane.time_step)
    place_walkers(unpack(Walking, placed.walking), placed.sights)


@compilable
def meet_walkers(parameters: Array, memory: Array, index: int, pose: PlanarPose) -> int:
    """Return UNTOUCHED, PUSHED or BLOCKED for a robot at a pose among walkers; record touches."""
    movables = unpack(Movables, unpack(Plane, parameters).movables)
    placed = unpack(Placed, unpack(Memory, memory).movables)
    walkers, walking = unpack(Walk, movables.walk).walkers, unpack(Walking, placed.walking)
    hull, here = hull_of(parameters, index), pose_of(memory, index)
    result = UNTOUCHED
    for i in range(len(walkers)):
        radius = walkers[i, at.RADIUS]
        x = walking.places[i, 0]
        y = walking.places[i, 1]
        near = hull.radius + radius + NEAR_M
        if (x - pose[0]) * (x - pose[0]) + (y - pose[1]) * (y - pose[1]) > near * near:
            continue
        before = measure_gap(hull.outline, here, x, y)
        after = measure_gap(hull.outline, pose, x, y)
        if min(before, after) >= radius:
            continue
        note_touch(walking, i, index)
        contact.place_outline(parameters, memory, index, pose)
        centre = walking.places[i : i + 1]
        contact.feel_polygon(parameters, memory, index, pose, centre, radius + contact.SKIN_M)
        if after < radius and after < before:
            result = BLOCKED
        elif result == UNTOUCHED:
            result = PUSHED
    return result


@compilable
def measure_gap(outline: Array, pose: PlanarPose, x: float, y: float) -> float:
    """Return the distance [m] from (x, y) to an outline at a pose; negative inside."""
    px, py, cos, sin = pose
    dx = x - px
    dy = y - py
    gap, _, _ = find_border(outline, cos * dx + sin * dy, cos * dy - sin * dx)
    return gap


FULL_TURN = 2.0 * math.pi


class Stride(NamedTuple):
    """The motion of an unblocked robot in a step."""

    rolled: float  # [m], distance driven by the rear axle's centre
    turned: float  # [rad]
    yaw: float  # [rad], yaw after the step
    pose: PlanarPose  # after the step


def observe(parameters: Array, memory: Array, states: Array) -> None:
    """Copy the states, with any contact since the last call, and the reports of the walkers."""
    motions = unpack(Memory, memory).motions
    for i in range(len(motions)):
        for k in range(STATE_SIZE):
            states[i * STATE_SIZE + k] = motions[i, k]
        motions[i, CONTACT] = 0.0
    if len(states) > len(motions) * STATE_SIZE:
        placed = unpack(Placed, unpack(Memory, memory).movables)
        report_walkers(unpack(Walking, placed.walking), states[len(motions) * STATE_SIZE :])


def advance(parameters: Array, memory: Array, commands: Array, duration: float) -> None:
    """Drive for ``duration`` [s]; a robot stops instead of hitting something."""
    for _ in range(round(duration / unpack(Plane, parameters).time_step)):
        for i in range(len(unpack(Memory, memory).motions)):
            stride = predict(parameters, memory, i, commands)
            blocked = contact.touches(parameters, memory, i, stride.pose)
            move(parameters, memory, i, stride, blocked)


def advance_pushing(parameters: Array, memory: Array, commands: Array, duration: float) -> None:
    """Drive as in ``advance``, but also push bodies and count touches of contact sensors.

    Without these two, ``advance`` gives equal results and compiles in a quarter of the time.
    """
    for _ in range(round(duration / unpack(Plane, parameters).time_step)):
        for i in range(len(unpack(Memory, memory).motions)):
            stride = predict(parameters, memory, i, commands)
            if contact.touches(parameters, memory, i, stride.pose):
                result = BLOCKED
                contact.feel_robots(parameters, memory, i, stride.pose)
            else:
                result = push(parameters, memory, i, stride.pose)
            if result != UNTOUCHED:
                unpack(Memory, memory).motions[i, CONTACT] = 1.0
                contact.feel(parameters, memory, i, stride.pose)
            move(parameters, memory, i, stride, result == BLOCKED)


def advance_among_walkers(
    parameters: Array, memory: Array, commands: Array, duration: float
) -> None:
    """Drive as in ``advance_pushing``, among walkers, which move first in each step."""
    for _ in range(round(duration / unpack(Plane, parameters).time_step)):
        move_walkers(parameters, memory)
        for i in range(len(unpack(Memory, memory).motions)):
            stride = predict(parameters, memory, i, commands)
            met = meet_walkers(parameters, memory, i, stride.pose)
            if contact.touches(parameters, memory, i, stride.pose):
                result = BLOCKED
                contact.feel_robots(parameters, memory, i, stride.pose)
            elif met == BLOCKED:
                result = BLOCKED
            else:
                result = push(parameters, memory, i, stride.pose)
            if result != UNTOUCHED or met != UNTOUCHED:
                unpack(Memory, memory).motions[i, CONTACT] = 1.0
                contact.feel(parameters, memory, i, stride.pose)
            move(parameters, memory, i, stride, result == BLOCKED)


@compilable
def predict(parameters: Array, memory: Array, index: int, commands: Array) -> Stride:
    """Update a robot's steering and speed, and return its motion in the next step."""
    plane = unpack(Plane, parameters)
    drive, step = unpack(Drive, plane.drives[index]), plane.time_step
    motions = unpack(Memory, memory).motions
    speed, rate = roll(drive, motions, index, commands)
    # The chord of the arc driven by the rear axle deviates from the heading by half the rotation.
    half = 0.5 * rate * step
    chord = speed * step
    half_sin, half_cos = elementary.sin_cos(half)
    if abs(half) > 1e-6:
        chord = chord * half_sin / half
    x, y, cos, sin = pose_of(memory, index)
    axle = drive.rear_axle_x
    x = x + axle * cos + chord * (cos * half_cos - sin * half_sin)
    y = y + axle * sin + chord * (sin * half_cos + cos * half_sin)
    yaw = motions[index, YAW] + 2.0 * half
    if yaw > math.pi:
        yaw -= FULL_TURN
    elif yaw < -math.pi:
        yaw += FULL_TURN
    sin, cos = elementary.sin_cos(yaw)
    return Stride(speed * step, rate * step, yaw, (x - axle * cos, y - axle * sin, cos, sin))


@inlined
def roll(drive: Drive, motions: Matrix, index: int, commands: Array) -> tuple[float, float]:
    """Let steering and speed follow a command; return mean speed [m/s] and yaw rate [rad/s]."""
    # Means over the step make the motion second-order accurate.
    motion, command = motions[index], commands[index * COMMAND_SIZE :]
    wanted = min(max(command[arrays.STEERING], -drive.steering_limit), drive.steering_limit)
    motion[layout.STEERING_ANGLE] += drive.steering_gain * (wanted - motion[layout.STEERING_ANGLE])
    curvature = elementary.tan(motion[layout.STEERING_ANGLE]) / drive.wheelbase
    bend = motion[layout.CURVATURE]
    bend += drive.steering_mean * (curvature - bend)
    motion[layout.CURVATURE] = curvature
    fastest = drive.max_speed / (1.0 + abs(curvature) * drive.speed_limit_offset)
    target = min(max(command[arrays.DRIVE_SPEED], -fastest), fastest)
    speed, rate = motion[SPEED], motion[YAW_RATE]
    strength = commands[len(motions) * COMMAND_SIZE + index * STRENGTH_SIZE :]
    if len(strength) > 0:
        left, right = strength[arrays.LEFT_WHEELS], strength[arrays.RIGHT_WHEELS]
        if drive.speed_limit_offset > 0.0 and (left != 1.0 or right != 1.0):
            roll_unevenly(drive, motion, target, curvature, left, right)
            rate += drive.speed_mean * (motion[YAW_RATE] - rate)
            speed += drive.speed_mean * (motion[SPEED] - speed)
            return speed, rate
        target *= min(left, right)
    motion[SPEED] += drive.speed_gain * (target - motion[SPEED])
    motion[YAW_RATE] = motion[SPEED] * curvature
    speed += drive.speed_mean * (motion[SPEED] - speed)
    return speed, speed * bend


@compilable
def roll_unevenly(
    drive: Drive, motion: Array, target: float, curvature: float, left: float, right: float
) -> None:
    """Let speed and yaw rate follow wheels weakened on one side; see ``find_targets``."""
    half, gain = drive.speed_limit_offset, drive.speed_gain
    left *= target * (1.0 - curvature * half)
    right *= target * (1.0 + curvature * half)
    motion[SPEED] += gain * (0.5 * (left + right) - motion[SPEED])
    motion[YAW_RATE] += gain * (0.5 * (right - left) / half - motion[YAW_RATE])


@compilable
def move(parameters: Array, memory: Array, index: int, stride: Stride, blocked: bool) -> None:
    """Move a robot as predicted, or stop it if blocked."""
    motion = unpack(Memory, memory).motions[index]
    if blocked:
        motion[CONTACT] = 1.0
        motion[SPEED] = 0.0
        motion[YAW_RATE] = 0.0
        return
    motion[layout.ROLLED] += stride.rolled
    motion[layout.TURNED] += stride.turned
    motion[YAW] = stride.yaw
    motion[arrays.X], motion[arrays.Y], motion[layout.COS], motion[layout.SIN] = stride.pose


@compilable
def push(parameters: Array, memory: Array, index: int, pose: PlanarPose) -> int:
    """Push bodies in the way of a robot, but not into other robots; see ``push_bodies``."""
    robot = hull_of(parameters, index)
    outline = contact.place_outline(parameters, memory, index, pose).corners
    before = pose_of(memory, index)
    pusher = pushing.Pusher(robot.mass, robot.height, robot.radius, outline, pose, before)
    movables = unpack(Movables, unpack(Plane, parameters).movables)
    placed = unpack(Placed, unpack(Memory, memory).movables)
    result = pushing.push_bodies(movables, placed, pusher)
    if result == pushing.PUSHED and contact.feel_pressed(parameters, memory, index):
        pushing.put_back(movables, placed)
        return BLOCKED
    return result
