"""Compares how a skid-steer robot turns with the resistance that the planar simulator assumes.

Robots with four wheels, of several lengths between the axles, drive circles in PyBullet. Each row is
the track that the robot seems to have, divided by the real one. Prints the tables and draws
docs/img/skid_steer.png:

    python benchmarks/fidelity/skid_steer.py
"""

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from evoros.base.arrays import COMMAND_SIZE, STATE_SIZE, YAW, Array
from evoros.drive.skid_steer import SkidSteer, SkidSteerDescription
from evoros.robot.loading import load_robot
from evoros.robot.model import Robot
from evoros.simulator.protocol import Simulator
from evoros.simulator.pybullet import PyBullet
from evoros.world.course import Course
from evoros.world.floors import GROUND
from evoros.world.model import World

TRACK_M, RADIUS_M, SPEED_MPS = 0.4, 0.08, 0.3
RATIOS = (0.4, 0.6, 0.8, 1.0, 1.2, 1.5)  # distance of the axles, divided by the track
SPEEDS = (0.05, 0.15, 0.3, 0.6)  # [m/s], of the wheels' middle
TURNS = (0.5, 1.0, 2.0, 4.0)  # curvature that the wheels would drive without slip, times the track
SETTLE_S, PIECE_S, LIMIT_S = 2.0, 0.1, 60.0
FIGURE = Path(__file__).parents[2] / "docs" / "img" / "skid_steer.png"

WHEEL = """
<link name="{name}"><inertial><mass value="0.5"/><inertia ixx="0.0012" ixy="0" ixz="0" iyy="0.0016"
iyz="0" izz="0.0012"/></inertial><collision><origin rpy="1.5707963267948966 0 0"/><geometry>
<cylinder radius="{radius}" length="0.05"/></geometry></collision></link>
<joint name="{name}_joint" type="continuous"><parent link="base"/><child link="{name}"/>
<origin xyz="{x} {y} {radius}"/><axis xyz="0 1 0"/><limit effort="20" velocity="50"/></joint>"""
BODY = """
<robot name="skid"><link name="base"><inertial><origin xyz="0 0 0.12"/><mass value="10"/>
<inertia ixx="0.15" ixy="0" ixz="0" iyy="0.25" iyz="0" izz="0.35"/></inertial><collision>
<origin xyz="0 0 0.2"/><geometry><box size="{length} 0.3 0.1"/></geometry></collision></link>"""


class Circle(NamedTuple):
    """A steady turn in an engine."""

    resistance: float  # track that the robot seems to have, divided by the real one
    headings: Array  # (n,) [rad]
    rates: Array  # (n,) [rad/s] at these headings


def make_robot(ratio: float) -> Robot:
    """Make a robot whose axles are ``ratio`` times as far apart as its wheels."""
    x, y = ratio * TRACK_M / 2, TRACK_M / 2
    places = {"fl": (x, y), "rl": (-x, y), "fr": (x, -y), "rr": (-x, -y)}
    wheels = [
        WHEEL.format(name=name, x=place[0], y=place[1], radius=RADIUS_M)
        for name, place in places.items()
    ]
    text = BODY.format(length=2 * x) + "".join(wheels) + "</robot>"
    drive = SkidSteerDescription(
        left_wheel_joints=["fl_joint", "rl_joint"],
        right_wheel_joints=["fr_joint", "rr_joint"],
        wheelbase_m=TRACK_M,
        steering_limit_rad=1.5,
        max_speed_mps=5.0,
        wheel_separation_multiplier=1.0,
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "skid.urdf"
        path.write_text(text)
        return load_robot(str(path), drive)


def drive_circle(simulator: Simulator, robot: Robot, speed: float, turn: float) -> Circle:
    """Drive a whole circle at a curvature, times the track, that wheels without slip would drive.

    The engine's friction depends on the heading, so that only whole circles are comparable.
    """
    course = Course(0.0, 0.0, 0.0, 0.0, [[50.0, 0.0]], 1.0, 1.0, "forward", True)
    world = World("empty", (GROUND,), course, "benchmark", "")
    command, state = np.zeros(COMMAND_SIZE), np.zeros(STATE_SIZE)
    command[:] = speed, math.atan(turn)  # the wheelbase is the track
    headings, times = [], []
    with simulator.open(robot, world) as simulation:
        simulation.advance(command, SETTLE_S)
        time, heading, before = 0.0, 0.0, None
        while heading < 2.0 * math.pi and time < LIMIT_S:
            simulation.observe(state)
            if before is not None:
                heading += math.remainder(state[YAW] - before, 2.0 * math.pi)
            before = float(state[YAW])
            headings.append(heading)
            times.append(time)
            simulation.advance(command, PIECE_S)
            time += PIECE_S
    turned = np.array(headings)
    rates = np.gradient(turned, times)
    slip_free = speed * turn / TRACK_M
    return Circle(slip_free * times[-1] / float(turned[-1]), turned, rates)


def expected(ratio: float) -> float:
    """Return the resistance that the planar simulator assumes."""
    drive = make_robot(ratio).drive
    assert isinstance(drive, SkidSteer)
    return drive.turning_resistance


def main() -> None:
    fine = PyBullet(time_step=0.0025, solver_iterations=50)
    print("L / W   1 + (L/W)^2   plane   PyBullet at 2.5 ms, at turns of", *TURNS)
    rows: dict[float, list[Circle]] = {}
    for ratio in RATIOS:
        robot = make_robot(ratio)
        rows[ratio] = [drive_circle(fine, robot, SPEED_MPS, turn) for turn in TURNS]
        found = "  ".join(f"{circle.resistance:.3f}" for circle in rows[ratio])
        print(f"{ratio:<8g}{1 + ratio**2:<14.3f}{expected(ratio):<8.3f}{found}")
    square = make_robot(1.0)
    print("\nL / W = 1 at a turn of 2, by speed")
    for speed in SPEEDS:
        print(f"{speed:g} m/s: {drive_circle(fine, square, speed, 2.0).resistance:.3f}")
    print("\nL / W = 1 at a turn of 2, by step and iterations")
    for step, iterations in ((0.025, 20), (0.0125, 50), (0.01, 50), (0.005, 50), (0.0025, 50), (0.001, 50)):
        simulator = PyBullet(time_step=step, solver_iterations=iterations)
        print(f"{1e3 * step:g} ms, {iterations}: {drive_circle(simulator, square, SPEED_MPS, 2.0).resistance:.3f}")


if __name__ == "__main__":
    main()
