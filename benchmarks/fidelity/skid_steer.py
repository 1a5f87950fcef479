"""Compares how a skid-steer robot turns with the resistance that the planar simulator assumes.

Robots with four wheels, of several lengths between the axles, drive circles in PyBullet or MuJoCo.
The turning resistance is the track that the robot seems to have, divided by the real one. Prints
the tables; with PyBullet also draws docs/img/skid_steer.png:

    python benchmarks/fidelity/skid_steer.py [pybullet|mujoco]
"""

import math
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from evoros.analysis.drawing.style import write_png
from evoros.base.arrays import COMMAND_SIZE, STATE_SIZE, YAW, Array
from evoros.drive.skid_steer import SkidSteer, SkidSteerDescription
from evoros.robot.loading import load_robot
from evoros.robot.model import Robot
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.protocol import Simulator, open_alone
from evoros.simulator.pybullet import PyBullet
from evoros.world.course import Course
from evoros.world.floors import GROUND
from evoros.world.model import World

TRACK_M, RADIUS_M, SPEED_MPS = 0.4, 0.08, 0.3
RATIOS = (0.4, 0.6, 0.8, 0.9, 1.0, 1.1, 1.3)  # distance of the axles, divided by the track
SPEEDS = (0.1, 0.2, 0.4, 0.8)  # [m/s], of the wheels' middle
TURNS = (0.5, 1.0, 2.0)  # curvature that the wheels would drive without slip, times the track
STEPS = (0.025, 0.0125, 0.01, 0.00625, 0.005, 0.0025)  # [s]
SAMPLE = 0.6  # the ratio at which speeds and steps are compared
COLOURS = ("#0072b2", "#e69f00", "#009e73")
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
    with open_alone(simulator.open, robot, world) as simulation:
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


def expected(robot: Robot) -> float:
    """Return the resistance that the planar simulator assumes."""
    assert isinstance(robot.drive, SkidSteer)
    return robot.drive.turning_resistance


def draw(rows: Mapping[float, Sequence[Circle]]) -> None:
    """Draw the resistance against the distance of the axles, and the rate against the heading."""
    canvas = Figure(figsize=(7.2, 3.0), layout="constrained")
    left, right = canvas.subplots(1, 2)
    ratios = np.linspace(min(RATIOS), max(RATIOS), 50)
    left.plot(ratios, 1 + ratios**2, color="0.4", lw=1, label="1 + (L / W)²: the plane")
    for index, (turn, colour) in enumerate(zip(TURNS, COLOURS, strict=True)):
        resistances = [rows[ratio][index].resistance for ratio in RATIOS]
        left.plot(RATIOS, resistances, "o", ms=4, color=colour, label=f"PyBullet, turn of {turn:g}")
    left.set(xlabel="distance of the axles L / track W", ylabel="turning resistance", ylim=(1, 5))
    left.legend(frameon=False, fontsize=7)
    for ratio, colour in zip((0.6, 0.9, 1.1), COLOURS, strict=True):
        circle = rows[ratio][1]
        slip_free = SPEED_MPS * TURNS[1] / TRACK_M
        heading, share = np.degrees(circle.headings), circle.rates * (1 + ratio**2) / slip_free
        right.plot(heading, share, lw=1, color=colour, label=f"L / W = {ratio:g}")
    right.axhline(1.0, color="0.4", lw=1)
    right.set(
        xlabel="heading [deg]", ylabel="yaw rate / that of the plane", xlim=(0, 360), ylim=(0, 2)
    )
    right.set_xticks(range(0, 361, 90))
    right.legend(frameon=False, fontsize=7, ncols=3, loc="upper center")
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    write_png(canvas, FIGURE, dpi=110)


def make_pybullet(step: float) -> PyBullet:
    """Make PyBullet with its default iterations at its default step, and more at finer ones."""
    return PyBullet(time_step=step, solver_iterations=20 if step >= 0.025 else 50)


ENGINES: dict[str, tuple[Callable[[float], Simulator], float]] = {
    "pybullet": (make_pybullet, 0.0025),
    "mujoco": (lambda step: Mujoco(time_step=step), 0.01),
}
"""The class of each engine, and the step [s] of its table."""


def main(engine: str) -> None:
    make, step = ENGINES[engine]
    print(f"L / W   plane   {engine} at {1e3 * step:g} ms, at turns of", *TURNS)
    rows: dict[float, list[Circle]] = {}
    for ratio in RATIOS:
        robot = make_robot(ratio)
        rows[ratio] = [drive_circle(make(step), robot, SPEED_MPS, turn) for turn in TURNS]
        resistances = "  ".join(f"{circle.resistance:.2f}" for circle in rows[ratio])
        print(f"{ratio:<8g}{expected(robot):<8.2f}{resistances}", flush=True)
    sample = make_robot(SAMPLE)
    for speed in SPEEDS:
        circle = drive_circle(make(step), sample, speed, 1.0)
        print(f"L / W = {SAMPLE:g}, {speed:g} m/s: {circle.resistance:.2f}", flush=True)
    for step_s in STEPS:
        circle = drive_circle(make(step_s), sample, SPEED_MPS, 1.0)
        print(f"L / W = {SAMPLE:g}, {1e3 * step_s:g} ms: {circle.resistance:.2f}", flush=True)
    if engine == "pybullet":
        draw(rows)


if __name__ == "__main__":
    main((sys.argv[1:] or ["pybullet"])[0])
