"""The rules of motion of the planar simulator, over the arrays of ``planar_layout``.

In each step, the robots move one after another, in their order. A robot does not push another one:
instead of a step into the present outline of another robot, it stops. The rules give the same bits
compiled and interpreted, and robots that are far apart move as each would alone.
"""

import math

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
)
from evoros.base.compilable import compilable
from evoros.base.packing import unpack
from evoros.simulator.engines import planar_contact as contact
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines import planar_pushing as pushing
from evoros.simulator.engines import planar_walkers as walkers
from evoros.simulator.engines.planar_bodies import Movables, Placed, PlanarPose
from evoros.simulator.engines.planar_layout import Drive, Memory, Plane, hull_of, pose_of
from evoros.simulator.engines.planar_pushing import BLOCKED, UNTOUCHED
from evoros.walkers.layout import Walking
from evoros.walkers.reports import report_walkers

FULL_TURN = 2.0 * math.pi


def observe(parameters: Array, memory: Array, states: Array) -> None:
    """Copy the states of all robots and clear their contacts, which are those since last time.

    The walkers follow, as ``evoros.walkers.layout`` has them.
    """
    motions = unpack(Memory, memory).motions
    for i in range(len(motions)):
        for k in range(STATE_SIZE):
            states[i * STATE_SIZE + k] = motions[i, k]
        motions[i, CONTACT] = 0.0
    if len(states) > len(motions) * STATE_SIZE:
        placed = unpack(Placed, unpack(Memory, memory).movables)
        report_walkers(unpack(Walking, placed.walking), states[len(motions) * STATE_SIZE :])


def advance(parameters: Array, memory: Array, commands: Array, duration: float) -> None:
    """Drive for ``duration`` [s]; a robot that would drive into something stops instead."""
    for _ in range(round(duration / unpack(Plane, parameters).time_step)):
        for i in range(len(unpack(Memory, memory).motions)):
            yaw, pose = predict(parameters, memory, i, commands)
            blocked = contact.touches(parameters, memory, i, pose)
            move(parameters, memory, i, yaw, pose, blocked)


def advance_pushing(parameters: Array, memory: Array, commands: Array, duration: float) -> None:
    """Drive as ``advance`` does, push bodies, and count touches of contact sensors.

    Bodies that can be pushed are no obstacles as long as they can. ``advance`` has the same results
    without such bodies and sensors, and compiles in a quarter of the time.
    """
    for _ in range(round(duration / unpack(Plane, parameters).time_step)):
        for i in range(len(unpack(Memory, memory).motions)):
            yaw, pose = predict(parameters, memory, i, commands)
            if contact.touches(parameters, memory, i, pose):
                result = BLOCKED
                contact.feel_robots(parameters, memory, i, pose)
            else:
                result = push(parameters, memory, i, pose)
            if result != UNTOUCHED:
                unpack(Memory, memory).motions[i, CONTACT] = 1.0
                contact.feel(parameters, memory, i, pose)
            move(parameters, memory, i, yaw, pose, result == BLOCKED)


def advance_among_walkers(
    parameters: Array, memory: Array, commands: Array, duration: float
) -> None:
    """Drive as ``advance_pushing`` does, among walkers, which move first in each step."""
    for _ in range(round(duration / unpack(Plane, parameters).time_step)):
        walkers.move_walkers(parameters, memory)
        for i in range(len(unpack(Memory, memory).motions)):
            yaw, pose = predict(parameters, memory, i, commands)
            met = walkers.meet_walkers(parameters, memory, i, pose)
            if contact.touches(parameters, memory, i, pose):
                result = BLOCKED
                contact.feel_robots(parameters, memory, i, pose)
            elif met == BLOCKED:
                result = BLOCKED
            else:
                result = push(parameters, memory, i, pose)
            if result != UNTOUCHED or met != UNTOUCHED:
                unpack(Memory, memory).motions[i, CONTACT] = 1.0
                contact.feel(parameters, memory, i, pose)
            move(parameters, memory, i, yaw, pose, result == BLOCKED)


@compilable
def predict(
    parameters: Array, memory: Array, index: int, commands: Array
) -> tuple[float, PlanarPose]:
    """Return the yaw [rad] and the pose of a robot after a step. The servos have moved on."""
    plane = unpack(Plane, parameters)
    drive, step = unpack(Drive, plane.drives[index]), plane.time_step
    motions = unpack(Memory, memory).motions
    motion, command = motions[index], commands[index * COMMAND_SIZE :]
    wanted = min(max(command[arrays.STEERING], -drive.steering_limit), drive.steering_limit)
    motion[layout.STEERING_ANGLE] += drive.steering_gain * (wanted - motion[layout.STEERING_ANGLE])
    curvature = elementary.tan(motion[layout.STEERING_ANGLE]) / drive.wheelbase
    fastest = drive.max_speed / (1.0 + abs(curvature) * drive.speed_limit_offset)
    target = min(max(command[arrays.DRIVE_SPEED], -fastest), fastest)
    strength = commands[len(motions) * COMMAND_SIZE :]
    if len(strength) == 0:
        motion[SPEED] += drive.speed_gain * (target - motion[SPEED])
        motion[YAW_RATE] = motion[SPEED] * curvature
    else:
        roll_weakly(drive, motion, target, curvature, strength[index * STRENGTH_SIZE :])
    # The rear axle moves along an arc, whose chord points half the turn to the side.
    half = 0.5 * motion[YAW_RATE] * step
    chord = motion[SPEED] * step
    half_sin, half_cos = elementary.sin_cos(half)
    if abs(half) > 1e-6:
        chord = chord * half_sin / half
    x, y, cos, sin = pose_of(memory, index)
    axle = drive.rear_axle_x
    x = x + axle * cos + chord * (cos * half_cos - sin * half_sin)
    y = y + axle * sin + chord * (sin * half_cos + cos * half_sin)
    yaw = motion[YAW] + 2.0 * half
    if yaw > math.pi:
        yaw -= FULL_TURN
    elif yaw < -math.pi:
        yaw += FULL_TURN
    sin, cos = elementary.sin_cos(yaw)
    return yaw, (x - axle * cos, y - axle * sin, cos, sin)


@compilable
def roll_weakly(
    drive: Drive, motion: Array, target: float, curvature: float, strength: Array
) -> None:
    """Let speed and yaw rate follow those of wheels with a strength; see ``find_targets``."""
    left, right = strength[arrays.LEFT_WHEELS], strength[arrays.RIGHT_WHEELS]
    gain, half = drive.speed_gain, drive.speed_limit_offset
    if half == 0.0 or (left == 1.0 and right == 1.0):
        motion[SPEED] += gain * (min(left, right) * target - motion[SPEED])
        motion[YAW_RATE] = motion[SPEED] * curvature
        return
    left = left * target * (1.0 - curvature * half)
    right = right * target * (1.0 + curvature * half)
    motion[SPEED] += gain * (0.5 * (left + right) - motion[SPEED])
    motion[YAW_RATE] += gain * (0.5 * (right - left) / half - motion[YAW_RATE])


@compilable
def move(
    parameters: Array, memory: Array, index: int, yaw: float, pose: PlanarPose, blocked: bool
) -> None:
    """Move a robot to where ``predict`` says, or stop it if it is blocked."""
    motion = unpack(Memory, memory).motions[index]
    step = unpack(Plane, parameters).time_step
    if blocked:
        motion[CONTACT] = 1.0
        motion[SPEED] = 0.0
        motion[YAW_RATE] = 0.0
        return
    motion[layout.ROLLED] += motion[SPEED] * step
    motion[layout.TURNED] += motion[YAW_RATE] * step
    motion[YAW] = yaw
    motion[arrays.X], motion[arrays.Y], motion[layout.COS], motion[layout.SIN] = pose


@compilable
def push(parameters: Array, memory: Array, index: int, pose: PlanarPose) -> int:
    """Push the bodies in a robot's way, but not into other robots; see ``push_bodies``."""
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
