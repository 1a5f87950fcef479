"""A MAVLink connection to an autopilot, for modes, arming, routes and radio overrides."""

import select
import socket
import struct
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from typing import Any

from evoros.base.errors import LaunchError, require_extra
from evoros.bridge.process import OutsideProcess

AUTOPILOT = (1, 1)
GROUND_STATION = (255, 190)  # system and component id; only system 255 may override the radio
ARMED = 128
RELEASED, UNCHANGED = 0, 65535
STEERING_CHANNEL, THROTTLE_CHANNEL = 1, 3
LAST_TEXTS = 5
SEND_S = 1
DEGREES = 1e7


@cache
def dialect() -> Any:
    """Return pymavlink's module with ArduPilot's messages."""
    with require_extra("ardupilot", "controller=ardupilot", LaunchError):
        from pymavlink.dialects.v20 import ardupilotmega
    return ardupilotmega


def accept(process: OutsideProcess, listening: socket.socket, limit_s: float) -> socket.socket:
    """Accept the connection of the autopilot's process."""
    waiting: list[socket.socket | OutsideProcess] = [listening, process]
    ready, _, _ = select.select(waiting, [], [], limit_s)
    if listening not in ready:
        raise process.lost(f"did not connect over MAVLink within {limit_s:g} s")
    connection, _ = listening.accept()
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack("ll", SEND_S, 0))
    return connection


class GroundStation:
    """A ground station for the autopilot, which exchanges messages while the autopilot waits."""

    def __init__(self, process: OutsideProcess, connection: socket.socket) -> None:
        self._process, self._connection = process, connection
        self._dialect = dialect()
        self._mavlink = self._dialect.MAVLink(self, *GROUND_STATION)
        self._mavlink.robust_parsing = True  # skips bytes between messages
        self._route: Sequence[tuple[float, float]] = ()
        self.mode: int | None = None  # custom mode in the last heartbeat
        self.armed = False
        self.texts: deque[str] = deque(maxlen=LAST_TEXTS)
        self.ready = False  # true once the autopilot has reported that it is ready
        self.results: dict[int, int] = {}  # last result of each command; 0 means accepted
        self.parameters: dict[str, float] = {}  # reported values by name
        self.route_result: int | None = None  # 0 if the autopilot has accepted the route

    def write(self, data: bytes) -> None:
        """Send bytes; called by pymavlink."""
        with suppress(OSError):  # the next read reports the error
            self._connection.sendall(data)

    def read(self, time: float | None) -> None:
        """Read the autopilot's messages; ``time`` is the mission time [s] or, before it, None."""
        while True:
            try:
                data = self._connection.recv(1 << 16, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            except ConnectionError:
                data = b""
            if not data:
                raise self._process.lost("closed MAVLink", time)
            for message in self._mavlink.parse_buffer(data) or ():
                self._take(message)

    def _take(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self.mode, self.armed = message.custom_mode, bool(message.base_mode & ARMED)
        elif kind == "STATUSTEXT":
            self.texts.append(message.text)
            self.ready = self.ready or message.text.startswith("ArduPilot Ready")
        elif kind == "COMMAND_ACK":
            self.results[message.command] = message.result
        elif kind in ("MISSION_REQUEST", "MISSION_REQUEST_INT"):
            self._send_item(message.seq)
        elif kind == "MISSION_ACK":
            self.route_result = message.type
        elif kind == "PARAM_VALUE":
            self.parameters[message.param_id] = message.param_value

    def send_heartbeat(self) -> None:
        """Announce the ground station to the autopilot."""
        kind, autopilot = self._dialect.MAV_TYPE_GCS, self._dialect.MAV_AUTOPILOT_INVALID
        self._mavlink.heartbeat_send(kind, autopilot, 0, 0, 0)

    def stop_streams(self) -> None:
        """Stop periodic messages, which would halve the simulation speed."""
        everything = self._dialect.MAV_DATA_STREAM_ALL
        self._mavlink.request_data_stream_send(*AUTOPILOT, everything, 0, 0)

    def ask_parameter(self, name: str) -> None:
        """Request a parameter; its value will be stored in ``parameters``."""
        self._mavlink.param_request_read_send(*AUTOPILOT, name.encode(), -1)

    def send_route(self, route: Sequence[tuple[float, float]]) -> None:
        """Send a route (latitude, longitude) [deg] that starts at home."""
        self._route, self.route_result = route, None
        self._mavlink.mission_count_send(*AUTOPILOT, len(route), 0)

    def _send_item(self, index: int) -> None:
        if index >= len(self._route):
            return
        frame = self._dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
        kind = frame, self._dialect.MAV_CMD_NAV_WAYPOINT, 0, 1
        place = (round(degrees * DEGREES) for degrees in self._route[index])
        self._mavlink.mission_item_int_send(
            *AUTOPILOT, index, *kind, *(0.0, 0.0, 0.0, 0.0), *place, 0.0, 0
        )

    def arm(self) -> None:
        """Request arming."""
        self._command(self._dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def has_armed(self) -> bool:
        """Return True if the autopilot has accepted the request to arm."""
        return self.results.get(self._dialect.MAV_CMD_COMPONENT_ARM_DISARM) == 0

    def set_mode(self, mode: int) -> None:
        """Request a mode."""
        flag = self._dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        self._command(self._dialect.MAV_CMD_DO_SET_MODE, flag, mode)

    def has_set_mode(self) -> bool:
        """Return True if the autopilot has accepted the last requested mode."""
        return self.results.get(self._dialect.MAV_CMD_DO_SET_MODE) == 0

    def override_radio(self, steering_us: int, throttle_us: int) -> None:
        """Override the radio channels for steering and throttle [us]; 0 releases a channel."""
        channels = [UNCHANGED] * 8
        channels[STEERING_CHANNEL - 1], channels[THROTTLE_CHANNEL - 1] = steering_us, throttle_us
        self._mavlink.rc_channels_override_send(*AUTOPILOT, *channels)

    def _command(self, command: int, *values: float) -> None:
        self.results.pop(command, None)
        padded = (*values, *[0.0] * 7)[:7]
        self._mavlink.command_long_send(*AUTOPILOT, command, 0, *padded)
