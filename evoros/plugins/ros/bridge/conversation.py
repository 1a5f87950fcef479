"""The protocol, commands and sensor schedule shared by the bridges to ROS 1 and ROS 2."""

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
"""Path to the command in each type of command message."""
STEADY = 10  # consecutive checks that must find all nodes at rest; starting nodes may sleep briefly
PAUSE_S = 0.005  # pause [s] between checks while nodes start
OWN_SHARE = 0.8  # fraction of a time limit after which this process exits, so that it can say why


class Tick(NamedTuple):
    """The inputs of a decision; None stands for a missing reading."""

    time: float  # mission time [s]
    state: list[float | None]  # x, y [m], yaw [rad], speed [m/s], yaw rate [rad/s], contact
    leg: list[float]  # x, y of the start and x, y of the end [m]
    readings: list[float | list[float | None] | None]  # one per sensor


class Conversation:
    """The pipes between evoros and this process; child processes do not inherit them."""

    def __init__(self) -> None:
        self._source = os.fdopen(int(os.environ.pop("EVOROS_IN")), "rb")
        self._sink = os.fdopen(int(os.environ.pop("EVOROS_OUT")), "wb", buffering=0)
        for file in (self._source, self._sink):
            os.set_inheritable(file.fileno(), False)
        self.briefing: dict[str, Any] = json.loads(self._source.readline())
        self._begun = False

    def require(self, ros: str, modules: Sequence[str], advice: str) -> None:
        """Reject the mission if this Python lacks a module of ``ros``."""
        for module in modules:
            if find_spec(module) is None:
                self.refuse(
                    f"controller.python: must be a Python with {ros}, but {sys.executable} has no "
                    f"module {module}; set it to the Python that your nodes need, often "
                    f"/usr/bin/python3{advice}"
                )

    def fail(self, why: str) -> NoReturn:
        """Reject the mission, or end it if already started."""
        if self._begun:
            end(why)
        self.refuse(why)

    def refuse(self, why: str) -> NoReturn:
        """Reject the mission with a reason of one line, and exit."""
        self._send({"refused": why})
        os._exit(0)

    def ready(self) -> None:
        """Report that the mission can start."""
        self._send({"ready": True})
        self._begun = True

    def ticks(self) -> Iterator[Tick]:
        """Yield the ticks until the end of the mission."""
        for line in self._source:
            yield Tick(*json.loads(line))

    def answer(self, mode: int | str, speed: float, steering: float) -> None:
        """Answer a tick with speed [m/s] and steering [rad]; mode 0 means no decision."""
        self._send([mode, speed, steering])

    def _send(self, content: object) -> None:
        self._sink.write(json.dumps(content).encode() + b"\n")


def end(why: str) -> NoReturn:
    """Exit immediately, with ``why`` as the last message."""
    sys.stdout.flush()
    print(f"evoros: {why}", file=sys.stderr, flush=True)
    os._exit(1)


class Wheels:
    """Converts ROS commands to speed and steering angle, which evoros limits."""

    def __init__(self, drive: dict[str, float], twist: str) -> None:
        """Set the meaning of angular.z in ``twist``: yaw_rate [rad/s] or steering [rad]."""
        self._length_m = drive["wheelbase_m"] / drive["turn_ratio"]
        self._twist = twist
        self._steering = 0.0

    def read(self, message: Any) -> tuple[float, float]:
        """Return the speed [m/s] and steering angle [rad] commanded by a message."""
        kind = type(message).__name__
        for field in COMMANDS[kind]:
            message = getattr(message, field)
        if kind.startswith("Ackermann"):
            return message.speed, message.steering_angle
        speed, turn = message.linear.x, message.angular.z
        # A yaw rate does not determine the steering angle at standstill, so keep the angle.
        if self._twist == "steering" or not math.isfinite(turn):
            self._steering = turn
        elif speed != 0.0:
            self._steering = math.atan(self._length_m * turn / speed)
        return speed, self._steering


def ros_time(time: float) -> tuple[int, int]:
    """Convert a mission time [s] to ROS time (seconds, nanoseconds); missions start at 1 s."""
    # ROS treats time 0 as unset. A timer would miss a tick if the clock were one nanosecond short.
    return divmod(round((1.0 + time) * 1e9), 10**9)


class Modes:
    """The mode last reported by the nodes; initially mode 1."""

    def __init__(self, names: list[str]) -> None:
        self._names = names
        self.now: int | str = 1

    def report(self, name: str) -> None:
        """Store a mode by name; evoros rejects an unknown name in the answer."""
        self.now = self._names.index(name) + 1 if name in self._names else name


class Schedule:
    """Finds the sensors with new measurements since the last tick, each sensor with its period."""

    def __init__(self, sensors: list[dict[str, Any]]) -> None:
        self._periods = [sensor["period_s"] for sensor in sensors]
        self._counts = [-1] * len(sensors)

    def due(self, time: float) -> list[int]:
        """Return the indices of sensors with a new reading at ``time`` [s]."""
        # the margin covers rounding errors at multiples of the period
        counts = [math.floor(time / period + 1e-6) for period in self._periods]
        due = [i for i, count in enumerate(counts) if count != self._counts[i]]
        self._counts = counts
        return due


def check_publisher(topic: str, names: list[str], kind: str, kinds: tuple[str, ...]) -> None:
    """Raise a ValueError unless a topic has one publisher and its message type is in ``kinds``."""
    if len(names) > 1:
        raise ValueError(
            f"{topic}: must have one publisher, not {len(names)} ({', '.join(names)}), "
            f"because only the latest message is used; remap the topic in all nodes but one"
        )
    if kind.rpartition("/")[2] not in kinds:
        raise ValueError(
            f"{topic}: messages must be {' or '.join(kinds)}, not {kind}; change the node "
            f"{names[0]} or controller.topics"
        )


def root_link(description: str) -> str:
    """Return the name of a URDF's root link."""
    robot = ElementTree.fromstring(description)
    children = {child.get("link") for child in robot.iterfind("joint/child")}
    (root,) = {link.get("name", "") for link in robot.iterfind("link")} - children
    return root
