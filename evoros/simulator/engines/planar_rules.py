"""The rules of motion of the planar simulator, over the arrays of ``planar_layout``.

In each step, the robots move in order. A robot does not push another one but stops before a step
into its present outline. The rules give the same bits compiled and interpreted, and robots that are
far apart move as if alone.
"""

import math
from typing import NamedTuple

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
from evoros.simulator.engines import planar_contact as contact
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines import planar_pushing as pushing
from evoros.simulator.engines import planar_walkers as walkers
from evoros.simulator.engines.planar_bodies import Movables, Placed, PlanarPose
from evoros.simulator.engines.planar_layout import Drive, Memory, Plane, hull_of, pose_of
from evoros.simulator.engines.planar_pushing import BLOCKED, UNTOUCHED
from evoros.walkers.crowd import report_walkers
from evoros.walkers.layout import Walking

FULL_TURN = 2.0 * math.pi


class Stride(NamedTuple):
    """The motion of a robot in a step, if nothing blocks it."""

    rolled: float  # [m], of the rear axle's centre
    turned: float  # [rad]
    yaw: float  # [rad], after the step
    pose: PlanarPose  # after the step


def observe(parameters: Array, memory: Array, states: Array) -> None:
    """Copy the states of all robots and clear their contacts, which are since the last call.

    Reports of walkers follow, see ``evoros.walkers.layout``.
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
            stride = predict(parameters, memory, i, commands)
            blocked = contact.touches(parameters, memory, i, stride.pose)
            move(parameters, memory, i, stride, blocked)


def advance_pushing(parameters: Array, memory: Array, commands: Array, duration: float) -> None:
    """Drive like ``advance``, push bodies, and count touches of contact sensors.

    Pushable bodies are no obstacles while they can move. Without such bodies and sensors,
    ``advance`` has the same results and compiles in a quarter of the time.
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
    """Drive like ``advance_pushing`` among walkers, which move first in each step."""
    for _ in range(round(duration / unpack(Plane, parameters).time_step)):
        walkers.move_walkers(parameters, memory)
        for i in range(len(unpack(Memory, memory).motions)):
            stride = predict(parameters, memory, i, commands)
            met = walkers.meet_walkers(parameters, memory, i, stride.pose)
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
    """Return a robot's motion in a step, after updating its servos."""
    plane = unpack(Plane, parameters)
    drive, step = unpack(Drive, plane.drives[index]), plane.time_step
    motions = unpack(Memory, memory).motions
    speed, rate = roll(drive, motions, index, commands)
    # The rear axle moves along an arc whose chord points half the turn to the side.
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
    """Let steering and speed follow a command; return the mean speed [m/s] and yaw rate [rad/s].

    Means over the step make the motion second order in the step; final values would be first order.
    """
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
    """Let speed and yaw rate follow wheels whose sides have a strength; see ``find_targets``."""
    half, gain = drive.speed_limit_offset, drive.speed_gain
    left *= target * (1.0 - curvature * half)
    right *= target * (1.0 + curvature * half)
    motion[SPEED] += gain * (0.5 * (left + right) - motion[SPEED])
    motion[YAW_RATE] += gain * (0.5 * (right - left) / half - motion[YAW_RATE])


@compilable
def move(parameters: Array, memory: Array, index: int, stride: Stride, blocked: bool) -> None:
    """Move a robot as predicted, or stop it if it is blocked."""
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
