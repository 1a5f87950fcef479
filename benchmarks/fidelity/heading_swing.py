"""Measures how late positions make ArduPilot's steering law weave on a straight leg.

Drives the rover in PyBullet along a long leg. It starts beside the leg and at an angle to it, as
after a corner. Prints a table of the heading and draws docs/img/weave.png:

    python benchmarks/fidelity/heading_swing.py
"""

import math
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from evoros.analysis.drawing.style import write_png
from evoros.base.arrays import Array
from evoros.config.compose import compose
from evoros.controller.rover import Rover
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.filter.delay import Delay
from evoros.filter.hold import Hold
from evoros.filter.protocol import Filter
from evoros.mission.mission import HEADING, TIME, Mission
from evoros.mission.rollout import run_mission
from evoros.world.course import Course
from evoros.world.model import World

SETTLED_S = 20.0  # time to return to the leg, which does not count
SECONDS = 60.0
ROBOTS = ("erle_rover", "erle_rover_as_run")
FIGURE = Path(__file__).parents[2] / "docs" / "img" / "weave.png"


def leg(experiment: Experiment) -> World:
    """Empty ground with one waypoint far ahead; the rover starts turned away from it."""
    ground = tuple(body for body in experiment.world["boxes"].bodies if body.is_ground)
    course = Course(0.0, 0.0, 0.08, 0.5, [[100.0, -0.5]], 1.0, SECONDS, "forward", True)
    return World("leg", ground, course, "weave", "")


def heading(robot: str, lag_s: float, hold_s: float) -> Array:
    """The time [s] and heading [deg] of a mission (n, 2)."""
    overrides = [f"robot={robot}", "controller=rover_l1", "controller/avoidance=blind"]
    experiment = compose(overrides).build()
    late: dict[str, Filter] = {"hold": Hold(hold_s)} if hold_s else {}
    controller = experiment.controller
    assert isinstance(controller, Rover)
    controller = replace(controller, localization=late | {"delay": Delay(lag_s)})
    member = replace(experiment.members[0], controller=controller)
    world = {"leg": leg(experiment)}
    scenario = replace(experiment.scenario, members=(member,), world=world)
    mission = Mission(0, 0, Design(()), "leg", 0, "evaluation", "weave")
    _, track = run_mission(scenario, mission)
    return np.column_stack((track[:, TIME], np.degrees(track[:, HEADING])))


def swing(track: Array) -> str:
    """Minimum and maximum heading [deg] once settled, and the period [s] of the weaving."""
    time, angle = track[track[:, 0] >= SETTLED_S].T
    above = angle > angle.mean()
    rising = time[1:][above[1:] & ~above[:-1]]
    period = float(np.diff(rising).mean()) if len(rising) > 1 else math.nan
    return f"{angle.min():+7.1f} .. {angle.max():+6.1f}  {period:5.1f}"


def draw(lags: tuple[float, ...]) -> Figure:
    """Draw a panel for each lag, with the paper's sweep behind it."""
    with mpl.rc_context({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=(6.3, 5.2), layout="constrained")
        panels = figure.subplots(len(lags), 1, sharex=True, sharey=True)
        for axes, lag in zip(panels, lags, strict=True):
            axes.axhspan(-30, 30, color="0.93", linewidth=0)
            axes.axhline(0, color="0.6", linewidth=0.6)
            axes.plot(*heading(ROBOTS[0], lag, 0.5).T, color="#0072b2", linewidth=1.3)
            axes.set_title(f"positions twice a second, {lag:g} s late", loc="left", fontsize=9)
            axes.set(yticks=(-30, 0, 30), ylim=(-60, 60), xlim=(0, SECONDS))
        panels[0].text(59, -27, "the paper's sweep, 60 deg", color="0.4", fontsize=8, ha="right")
        panels[-1].set_xlabel("time [s]")
        figure.supylabel("heading against the leg [deg]", fontsize=9)
    return figure


def main() -> None:
    print(f"heading [deg] from {SETTLED_S:g} to {SECONDS:g} s, and period of the weaving [s]")
    print(f"{'lag':>6} {'at':>6}   " + "   ".join(f"{robot:>24}" for robot in ROBOTS))
    for hold in (0.0, 0.5):
        for lag in (0.0, 0.4, 0.8, 0.9, 1.0):
            cells = [f"{swing(heading(robot, lag, hold)):>24}" for robot in ROBOTS]
            print(f"{lag:4.1f} s {1 / (hold or 0.1):3.0f} Hz   " + "   ".join(cells))
    FIGURE.parent.mkdir(parents=True, exist_ok=True)
    write_png(draw((0.0, 0.4, 0.8, 0.9)), FIGURE)


if __name__ == "__main__":
    main()
