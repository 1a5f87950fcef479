"""The robots of a simulation: their number, their names, and their parts of its arrays."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from evoros.base.arrays import COMMAND_SIZE, STATE_SIZE, STRENGTH_SIZE, Array
from evoros.base.errors import SimulationError
from evoros.robot.model import Robot
from evoros.simulator.protocol import PlacedRobot

MAX_ROBOTS = 16
"""An engine has a bit of its masks for each robot."""


class Share(NamedTuple):
    """The part of one robot."""

    state: slice
    command: slice
    strength: slice  # empty if wheels cannot fail
    signals: slice


def share_arrays(robots: Sequence[Robot]) -> list[Share]:
    """Return the parts of the robots, one after another."""
    shares, end = [], 0
    for i, robot in enumerate(robots):
        start, end = end, end + robot.signal_count
        state = slice(STATE_SIZE * i, STATE_SIZE * (i + 1))
        command = slice(COMMAND_SIZE * i, COMMAND_SIZE * (i + 1))
        first = COMMAND_SIZE * len(robots) + STRENGTH_SIZE * i
        strength = slice(first, first + STRENGTH_SIZE)
        shares.append(Share(state, command, strength, slice(start, end)))
    return shares


def read_command(commands: Array, share: Share) -> tuple[float, ...]:
    """Return the speed [m/s] and steering angle [rad], and the strengths if wheels can fail."""
    return (*commands[share.command].tolist(), *commands[share.strength].tolist())


def sum_others(bit: int, index: int, count: int) -> int:
    """Return the bits of all robots but one; the first robot has ``bit``, the others the next."""
    return sum(bit << other for other in range(count) if other != index)


def check_number(robots: Sequence[PlacedRobot]) -> None:
    """Require a number of robots that engines can simulate.

    Raises:
        SimulationError: there is none, or there are too many.
    """
    if not 1 <= len(robots) <= MAX_ROBOTS:
        raise SimulationError(f"from 1 to {MAX_ROBOTS} robots can share a world, not {len(robots)}")


def describe_for_engine(robot: Robot) -> tuple[Any, ...]:
    """Return all that an engine's model of a robot depends on."""
    drive = robot.drive
    joints = (drive.steering_joints, drive.wheel_joints, drive.caster_links)
    return robot.urdf, robot.engine_text, joints, robot.exposed_links


def name_robots(robots: Sequence[PlacedRobot]) -> str:
    """Name the robots in a message; one that is not alone has its number, from 0."""
    if len(robots) == 1:
        return robots[0].robot.name
    return " and ".join(name_robot(i, placed.robot) for i, placed in enumerate(robots))


def name_robot(index: int, robot: Robot) -> str:
    """Name one of several robots in a message."""
    return f"robot {index} ({robot.name})"
