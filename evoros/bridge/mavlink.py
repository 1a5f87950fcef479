"""MAVLink to an autopilot that waits while it is spoken to: modes, arming, a route, the radio."""

import select
import socket
import struct
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from typing import Any

from evoros.base.errors import LaunchError
from evoros.base.extras import require_extra
from evoros.bridge.process import OutsideProcess

AUTOPILOT = (1, 1)
GROUND_STATION = (255, 190)
"""System and component; ArduPilot takes the radio's channels only from this system."""
ARMED = 128
RELEASED, UNCHANGED = 0, 65535
STEERING_CHANNEL, THROTTLE_CHANNEL = 1, 3
LAST_TEXTS = 5
SEND_S = 1
DEGREES = 1e7


@cache
def dialect() -> Any:
    """Return pymavlink's module of ArduPilot's messages.

    Raises:
        LaunchError: it is not installed.
    """
    with require_extra("ardupilot", "controller=ardupilot", LaunchError):
        from pymavlink.dialects.v20 import ardupilotmega
    return ardupilotmega


def accept(process: OutsideProcess, listening: socket.socket, limit_s: float) -> socket.socket:
    """Wait until the process connects.

    Raises:
        PilotLost: it ended, or did not connect in time.
    """
    waiting: list[socket.socket | OutsideProcess] = [listening, process]
    ready, _, _ = select.select(waiting, [], [], limit_s)
    if listening not in ready:
        raise process.lost(f"did not connect MAVLink within {limit_s:g} s")
    connection, _ = listening.accept()
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack("ll", SEND_S, 0))
    return connection


class GroundStation:
    """The other end of the autopilot's MAVLink. Only one thread uses it.

    All is sent and read while the autopilot waits for a state, so that every byte has its frame.
    """

    def __init__(self, process: OutsideProcess, connection: socket.socket) -> None:
        self._process, self._connection = process, connection
        self._dialect = dialect()
        self._mavlink = self._dialect.MAVLink(self, *GROUND_STATION)
        self._mavlink.robust_parsing = True  # bytes that are no message are passed over
        self._route: Sequence[tuple[float, float]] = ()
        self.mode: int | None = None  # as the last heartbeat told
        self.armed = False
        self.texts: deque[str] = deque(maxlen=LAST_TEXTS)
        self.ready = False  # it has told that its start is over
        self.results: dict[int, int] = {}  # by command, the answer to the last request; 0: accepted
        self.parameters: dict[str, float] = {}  # those that it has told
        self.route_result: int | None = None  # 0: it has taken the route

    def write(self, data: bytes) -> None:
        """Send bytes, for pymavlink."""
        with suppress(OSError):  # the next read tells
            self._connection.sendall(data)

    def read(self, time: float | None) -> None:
        """Read the autopilot's messages; ``time`` is the mission's [s], if it has begun.

        Raises:
            PilotLost: it has closed the connection.
        """
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
        """Tell that a ground station is there."""
        kind, autopilot = self._dialect.MAV_TYPE_GCS, self._dialect.MAV_AUTOPILOT_INVALID
        self._mavlink.heartbeat_send(kind, autopilot, 0, 0, 0)

    def stop_streams(self) -> None:
        """Ask for no regular messages, which would cost half of the speed."""
        everything = self._dialect.MAV_DATA_STREAM_ALL
        self._mavlink.request_data_stream_send(*AUTOPILOT, everything, 0, 0)

    def ask_parameter(self, name: str) -> None:
        """Ask for a parameter; the answer, if there is one, is in ``parameters``."""
        self._mavlink.param_request_read_send(*AUTOPILOT, name.encode(), -1)

    def send_route(self, route: Sequence[tuple[float, float]]) -> None:
        """Offer a route of latitudes and longitudes [deg], of which the first is home."""
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
        """Ask to arm."""
        self._command(self._dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def has_armed(self) -> bool:
        """Whether the autopilot has accepted to arm."""
        return self.results.get(self._dialect.MAV_CMD_COMPONENT_ARM_DISARM) == 0

    def set_mode(self, mode: int) -> None:
        """Ask for a mode."""
        flag = self._dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        self._command(self._dialect.MAV_CMD_DO_SET_MODE, flag, mode)

    def has_set_mode(self) -> bool:
        """Whether the autopilot has accepted the mode that was asked for last."""
        return self.results.get(self._dialect.MAV_CMD_DO_SET_MODE) == 0

    def override_radio(self, steering_us: int, throttle_us: int) -> None:
        """Take the place of the radio's steering and throttle; 0 gives one back."""
        channels = [UNCHANGED] * 8
        channels[STEERING_CHANNEL - 1], channels[THROTTLE_CHANNEL - 1] = steering_us, throttle_us
        self._mavlink.rc_channels_override_send(*AUTOPILOT, *channels)

    def _command(self, command: int, *values: float) -> None:
        self.results.pop(command, None)
        padded = (*values, *[0.0] * 7)[:7]
        self._mavlink.command_long_send(*AUTOPILOT, command, 0, *padded)
