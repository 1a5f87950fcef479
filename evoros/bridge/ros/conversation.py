"""The lines, the commands and the times of the sensors, common to the bridges to ROS 1 and 2.

Standard library only, as Python 3.8 has it.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from typing import Any, NamedTuple, NoReturn
from xml.etree import ElementTree

COMMANDS = {
    "Twist": (),
    "TwistStamped": ("twist",),
    "AckermannDrive": (),
    "AckermannDriveStamped": ("drive",),
}
"""The kinds of messages that command the robot, and the field that has the command."""
STEADY = 10
"""Looks in a row that must find all at rest before the mission begins: nodes that start sleep now
and then by the wall clock."""
PAUSE_S = 0.005  # between two looks while nodes start
OWN_SHARE = 0.8
"""The part of a wall-clock limit after which this process ends by itself, to tell why."""


class Tick(NamedTuple):
    """The values before a decision; None: silent."""

    time: float  # of the mission [s]
    state: list[float | None]  # x, y [m], yaw [rad], speed [m/s], yaw rate [rad/s], contact
    leg: list[float]  # from x, y to x, y [m]
    readings: list[float | list[float | None] | None]  # [m], by sensor


class Conversation:
    """The lines between evoros and this process; nothing that is started inherits them."""

    def __init__(self) -> None:
        self._source = os.fdopen(int(os.environ.pop("EVOROS_IN")), "rb")
        self._sink = os.fdopen(int(os.environ.pop("EVOROS_OUT")), "wb", buffering=0)
        for file in (self._source, self._sink):
            os.set_inheritable(file.fileno(), False)
        self.briefing: dict[str, Any] = json.loads(self._source.readline())
        self._begun = False

    def require(self, ros: str, modules: Sequence[str], advice: str) -> None:
        """Refuse the mission unless this Python has all modules, which belong to ``ros``."""
        for module in modules:
            if find_spec(module) is None:
                self.refuse(
                    f"controller.python: must be a Python with {ros}, and {sys.executable} has no "
                    f"module {module}; name the one that your nodes need, often "
                    f"/usr/bin/python3{advice}"
                )

    def fail(self, why: str) -> NoReturn:
        """Refuse the mission, or end it if it has begun."""
        if self._begun:
            end(why)
        self.refuse(why)

    def refuse(self, why: str) -> NoReturn:
        """Refuse the mission, and end. ``why`` is one line: key or node, rule, value, fix."""
        self._send({"refused": why})
        os._exit(0)

    def ready(self) -> None:
        """Tell evoros that the mission can begin."""
        self._send({"ready": True})
        self._begun = True

    def ticks(self) -> Iterator[Tick]:
        """Yield the ticks until the end of the mission."""
        for line in self._source:
            yield Tick(*json.loads(line))

    def answer(self, mode: int | str, speed: float, steering: float) -> None:
        """Answer a tick; mode 0: no decision. evoros refuses a mode that it does not know."""
        self._send([mode, speed, steering])

    def _send(self, content: object) -> None:
        self._sink.write(json.dumps(content).encode() + b"\n")


def end(why: str) -> NoReturn:
    """End at once; ``why`` is the last of this process's words."""
    sys.stdout.flush()
    print(f"evoros: {why}", file=sys.stderr, flush=True)
    os._exit(1)


class Wheels:
    """Turns commands of ROS into speed and steering angle, which evoros clips."""

    def __init__(self, drive: dict[str, float], twist: str) -> None:
        """``twist``: the meaning of a Twist's angular.z, yaw_rate [rad/s] or steering [rad]."""
        self._length_m = drive["wheelbase_m"] / drive["turn_ratio"]
        self._twist = twist
        self._steering = 0.0

    def read(self, message: Any) -> tuple[float, float]:
        """Return speed and steering angle of a message of one of the kinds ``COMMANDS``."""
        kind = type(message).__name__
        for field in COMMANDS[kind]:
            message = getattr(message, field)
        if kind.startswith("Ackermann"):
            return message.speed, message.steering_angle
        return self._read_twist(message.linear.x, message.angular.z)

    def _read_twist(self, speed: float, turn: float) -> tuple[float, float]:
        """A yaw rate says nothing of the angle while the robot stands, so that the angle stays."""
        if self._twist == "steering" or not math.isfinite(turn):
            self._steering = turn
        elif speed != 0.0:
            self._steering = math.atan(self._length_m * turn / speed)
        return speed, self._steering


def ros_time(time: float) -> tuple[int, int]:
    """Return seconds and nanoseconds of a time of the mission [s].

    A mission begins at 1 s, because ROS takes time 0 for no time at all. The nearest nanosecond
    counts: a timer of 0.1 s would miss a clock that is one short of it.
    """
    return divmod(round((1.0 + time) * 1e9), 10**9)


class Modes:
    """The mode that the nodes report, the first until they report one."""

    def __init__(self, names: list[str]) -> None:
        self._names = names
        self.now: int | str = 1

    def report(self, name: str) -> None:
        """Note a mode by its name; evoros refuses an unknown one in the answer."""
        self.now = self._names.index(name) + 1 if name in self._names else name


class Schedule:
    """Tells which sensors have measured since the last tick, each at its own period."""

    def __init__(self, sensors: list[dict[str, Any]]) -> None:
        self._periods = [sensor["period_s"] for sensor in sensors]
        self._counts = [-1] * len(sensors)

    def due(self, time: float) -> list[int]:
        """Return the numbers of the sensors with a new reading at ``time`` [s]."""
        # A time that is a rounding error short of a multiple of the period has reached it.
        counts = [math.floor(time / period + 1e-6) for period in self._periods]
        due = [i for i, count in enumerate(counts) if count != self._counts[i]]
        self._counts = counts
        return due


def root_link(description: str) -> str:
    """Return the link of a URDF that is no joint's child."""
    robot = ElementTree.fromstring(description)
    children = {child.get("link") for child in robot.iterfind("joint/child")}
    (root,) = {link.get("name", "") for link in robot.iterfind("link")} - children
    return root
