"""Helpers for tests of ROS nodes: a short drive and its expected steps."""

import json
import math
import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias
from uuid import uuid4

import numpy as np
import pytest
from helpers import ROOT
from nodes.avoid import Avoider
from robot_cases import load

from evoros.base.arrays import COMMAND_SIZE, Array
from evoros.controller.protocol import Briefing, LiveController, Pilot
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar

NODES = ROOT / "tests" / "nodes"
PERIOD_S, SENSOR_TICKS, TICKS, SONARS = 0.1, 2, 40, 6
RANGE_MAX_M, REACH_M = 4.5, 1.0
SILENT, LOST = range(20, 25), range(30, 33)
"""The ticks in which the second sonar and the localization are silent."""

STYLES = ("callback", "each_range", "rate", "timer")
"""Names for what a test node waits for before it decides."""

Steps: TypeAlias = list[tuple[int, float, float]]
"""The mode, the speed and the steering angle after each tick."""


@cache
def brief() -> Briefing:
    """The bundled rover with six sonars that measure in every second tick, and two legs."""
    sonar = Sonar(0.06, RANGE_MAX_M, 30.0, 3, period_s=SENSOR_TICKS * PERIOD_S)
    yaws = np.linspace(75.0, -75.0, SONARS)
    mounts = [Mount("sonar", "base_link", 0.1, 0.0, 0.166, float(yaw), 0.0) for yaw in yaws]
    robot = load().with_sensors(mounts, {"sonar": sonar})
    route = np.array([[1.0, 0.5], [2.0, -2.0]])
    return Briefing(robot, (0.0, 0.0, 0.0, 0.0), route, 0.3, 60.0, 4_000_000_000)


def fly(controller: LiveController, phase: float = 0.0, ticks: int = TICKS) -> Steps:
    """The steps of a short drive; ``phase`` changes what the sonars see."""
    with controller.launch(brief()) as pilot:
        return drive(pilot, phase, ticks)


def drive(pilot: Pilot, phase: float = 0.0, ticks: int = TICKS) -> Steps:
    """Drive a car by what the pilot commands; nothing but the commands changes its way."""
    briefing = brief()
    points = [briefing.home[:2], *map(tuple, briefing.route.tolist())]
    wheelbase = briefing.robot.drive.wheelbase_m
    (x, y, yaw), command = (0.0, 0.0, 0.0), np.zeros(COMMAND_SIZE)
    readings, legs, steps = np.zeros(SONARS), len(briefing.route), []
    leg = 0
    for tick in range(ticks):
        speed, steering = command.tolist()
        rate = speed * math.tan(steering) / wheelbase
        x, y = x + PERIOD_S * speed * math.cos(yaw), y + PERIOD_S * speed * math.sin(yaw)
        yaw += PERIOD_S * rate
        if math.dist((x, y), points[leg + 1]) < briefing.acceptance_m:
            leg = min(leg + 1, legs - 1)
        if tick % SENSOR_TICKS == 0:
            readings = 2.2 + 2.0 * np.sin(phase + x + 2.0 * y + np.arange(SONARS))
            readings[1] = math.nan if tick in SILENT else readings[1]
        state = np.array([x, y, yaw, speed, rate, 0.0])
        if tick in LOST:
            state[:4] = math.nan
        ends = np.array([*points[leg], *points[leg + 1]])
        mode = pilot.exchange(round(tick * PERIOD_S, 9), state, ends, readings, command)
        steps.append((mode, float(command[0]), float(command[1])))
    return steps


class Algorithm:
    """The algorithm of the nodes of the tests in this process, as a node of this style runs it."""

    def __init__(self, style: str, first_end: int) -> None:
        robot = brief().robot
        self._first_end = first_end  # the tick in which a Rate or Timer first ends
        self._style, self._wheelbase = style, robot.drive.wheelbase_m
        yaws = {f"sonar_{i}": yaw for i, yaw in enumerate(robot.sensor_poses[:, 3].tolist())}
        lock = float(robot.drive.steering_limit)
        self._avoider = Avoider(yaws, lock, self._wheelbase, REACH_M)

    def exchange(
        self, time: float, state: Array, leg: Array, readings: Array, command: Array
    ) -> int:
        tick = round(time / PERIOD_S)
        decisions = []
        self._avoider.hear_goal(leg[2], leg[3])
        if tick % SENSOR_TICKS == 0:
            for index, reading in enumerate(readings.tolist()):
                if not math.isnan(reading):
                    self._avoider.hear_range(f"sonar_{index}", float(np.float32(reading)))
                    decisions += self._decide("each_range")
        x, y, yaw = state[:3].tolist()
        if not math.isnan(x):
            self._avoider.hear_pose(x, y, math.sin(yaw / 2), math.cos(yaw / 2))
            decisions += self._decide("callback")
        if tick >= self._first_end:
            decisions += self._decide("rate") + self._decide("timer")
        if not decisions:
            return 0
        speed, rate = decisions[-1]
        command[:] = speed, math.atan(self._wheelbase * rate / speed)
        return 1

    def _decide(self, style: str) -> list[tuple[float, float]]:
        decision = self._avoider.decide() if style == self._style else None
        return [] if decision is None else [decision]


def expect(style: str, phase: float = 0.0, ticks: int = TICKS, first_end: int = 1) -> Steps:
    """Return the steps that are expected of a node of a style.

    A Rate or Timer of ROS 1 begins with the clock and ends after its period. One of ROS 2 begins
    at time 0, when the node starts, so that its period is over as soon as there is a clock.
    """
    return drive(Algorithm(style, first_end), phase, ticks)


def fly_at_once(controllers: Mapping[str, LiveController]) -> dict[str, Steps]:
    """The steps of a short drive of each, all at the same time."""
    with ThreadPoolExecutor(len(controllers)) as pool:
        flights = {name: pool.submit(fly, controller) for name, controller in controllers.items()}
        return {name: flight.result() for name, flight in flights.items()}


@contextmanager
def real_time() -> Iterator[None]:
    """Processes that run without a pause until they wait, if the system allows it.

    A thread that is woken then runs at once, whatever the one does that has woken it.
    """
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


@contextmanager
def require_nothing_left() -> Iterator[None]:
    """Require that no bridge and no node that is started within runs afterwards.

    Other tests may run at the same time, so their processes are told apart by a variable.
    """
    mark = f"EVOROS_TESTS={uuid4()}"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(*mark.split("="))
        yield
    assert list(_find_processes(mark)) == []


def _find_processes(mark: str) -> Iterator[str]:
    """Yield the commands of all processes with a variable that run a node or a bridge."""
    folders = (str(NODES), str(ROOT / "evoros" / "plugins" / "ros"))
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            words = (folder / "cmdline").read_text(errors="replace").split("\0")
            marked = mark.encode() in (folder / "environ").read_bytes().split(b"\0")
            if marked and any(word.startswith(folders) for word in words):
                yield " ".join(words)


Heard: TypeAlias = tuple[list[list[Any]], list[int]]
"""The values that a node received in a mission, and the mode after each tick."""


def hear(listener: LiveController, file: Path) -> Heard:
    """Fly a node that writes the messages it receives to a file."""
    steps = fly(listener)
    return [json.loads(line) for line in file.read_text().splitlines()], [step[0] for step in steps]


def about(heard: Heard, kind: str) -> list[list[Any]]:
    return [values for told, *values in heard[0] if told == kind]


def stamp(tick: int) -> int:
    """Nanoseconds; a mission begins at 1 s."""
    return 10**9 + tick * 10**8
