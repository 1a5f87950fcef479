"""Missions on open ground in which parts of the robot fail, for tests."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from world_cases import GROUND, square, world_of

from evoros.base.arrays import DRIVE_SPEED, STEERING, Array
from evoros.config.compose import compose
from evoros.controller.protocol import Controller, StartedLayer
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import Mission, Outcome
from evoros.mission.rollout import run_mission
from evoros.robot.model import Robot

NOW = ("failure.onset.earliest_s=0", "failure.onset.latest_s=0")


class Wish(NamedTuple):
    speed: float  # [m/s]
    steering: float  # [rad]


def wish(parameters: Wish, command: Array) -> bool:
    command[DRIVE_SPEED], command[STEERING] = parameters.speed, parameters.steering
    return True


@dataclass(frozen=True)
class Steady(Controller):
    """Sends one command, whatever the robot does."""

    speed: float
    steering: float = 0.0
    period_s: float = 0.1
    localization: Mapping[str, Any] = field(default_factory=dict)
    modes = ("steady",)

    @contextmanager
    def open(self, robot: Robot, rng: Any) -> Iterator[Sequence[StartedLayer]]:
        yield [StartedLayer(wish, Wish(self.speed, self.steering))]


def first_mission(experiment: Experiment) -> Mission:
    """The first mission of the design in the middle of the space."""
    design = experiment.space.decode(np.full(experiment.space.size, 0.5))
    return experiment.plan.evaluation(0, 0, design)[0]


@cache
def configured(*overrides: str) -> Experiment:
    return compose(["simulator=planar", "controller/avoidance=blind", *overrides]).build()


def fly(
    *overrides: str,
    controller: Any = None,
    simulator: Any = None,
    failure: Any = None,
    seed: int = 0,
    **course: Any,
) -> tuple[Outcome, pd.DataFrame]:
    """Run a mission on open ground; all that is not given is configured."""
    experiment = configured(*overrides)
    fields = {"direction": "forward", "time_limit_s": 60.0} | course
    world = world_of(GROUND, course=square(**fields))
    members = experiment.scenario.members
    if controller is not None:
        members = tuple(replace(member, controller=controller) for member in members)
    given = {"simulator": simulator, "failure": failure}
    parts = {name: part for name, part in given.items() if part is not None}
    scenario = replace(experiment.scenario, members=members, world={"open": world}, **parts)
    mission = replace(first_mission(experiment), world="open", draws=f"{seed}")
    (outcome, *_), track = run_mission(scenario, mission)
    table = pd.DataFrame(track, columns=scenario.name_columns(mission.design, "open"))
    assert np.isfinite(table["x_m"]).all()
    return outcome, table


def fit_circle(x: Array, y: Array) -> float:
    """The radius [m] of the circle nearest to some points."""
    matrix = np.stack([x, y, np.ones(len(x))], axis=1)
    a, b, c = np.linalg.lstsq(matrix, x * x + y * y, rcond=None)[0]
    return math.sqrt(c + (a * a + b * b) / 4.0)


def measure_circle(track: pd.DataFrame, robot: Robot) -> float:
    """The radius [m] of the rear axle's way, once the robot turns steadily."""
    late = track[track["time_s"] > 5.0]
    yaw, axle = late["yaw_rad"].to_numpy(), robot.drive.rear_axle_x_m
    x, y = late["x_m"] + axle * np.cos(yaw), late["y_m"] + axle * np.sin(yaw)
    return fit_circle(x.to_numpy(), y.to_numpy())
