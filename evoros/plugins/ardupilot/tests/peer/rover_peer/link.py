"""The MAVLink connection, served within a frame."""

import socket
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .backend import Backend
from .rover import AUTO, STEERING, THROTTLE, Rover

GROUND_STATION = (255, 190)
ACCEPTED, UNSUPPORTED, FAILED = 0, 3, 4  # MAV_RESULT
IGNORED, RELEASED = 65535, 0
STREAM_S = 0.25
SERVE_S = 0.01
QUEUED_REQUESTS, ANSWERS, ANSWERS_S = 20, 5, 0.1


def connect(serial: str) -> socket.socket:
    """Connect as ``--serial0 tcpclient:HOST:PORT`` says."""
    kind, _, where = serial.partition(":")
    if kind != "tcpclient":
        raise SystemExit(f"Unsupported device path {serial}")
    host, _, port = where.partition(":")
    connection = socket.create_connection((host, int(port)))
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setblocking(False)
    return connection


class Link:
    """Reads what has come, answers, and tells what the rover has to say."""

    def __init__(self, connection: socket.socket, rover: Rover, backend: Backend) -> None:
        self._connection, self._rover, self._backend = connection, rover, backend
        self._mavlink = mavlink.MAVLink(self, srcSystem=1, srcComponent=1)
        self._mavlink.robust_parsing = True
        self._items: dict[int, tuple[float, float]] = {}
        self._expected = 0
        self._next_beat = self._next_stream = self._next_answers = 0.0
        self._served = -1.0
        self._requests: deque[str] = deque()
        self._streaming = True
        self._commands: dict[int, Callable[[Any], int]] = {
            mavlink.MAV_CMD_DO_SET_MODE: lambda message: self._change_mode(int(message.param2)),
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm,
        }
        rover.say = self.say

    def write(self, data: bytes) -> None:
        """Send, for pymavlink; a link that is closed is no reason to stop."""
        with suppress(OSError):
            self._connection.send(data)

    def say(self, text: str) -> None:
        """Send a text to the ground station."""
        self._mavlink.statustext_send(mavlink.MAV_SEVERITY_INFO, text.encode()[:50])

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def serve(self) -> None:
        """Do what a frame brings, at most a hundred times a second."""
        if self._backend.time - self._served < SERVE_S - 1e-9:
            return
        self._served = self._backend.time
        try:
            data = self._connection.recv(65536)
        except OSError:
            data = b""
        for message in (self._mavlink.parse_buffer(data) or ()) if data else ():
            self._handle(message)
        self._send_what_is_due()

    def _send_what_is_due(self) -> None:
        time = self._backend.time
        if time >= self._next_answers:
            self._next_answers += ANSWERS_S
            for _ in range(min(len(self._requests), ANSWERS)):
                self._tell_parameter(self._requests.popleft())
        if self._streaming and time >= self._next_stream:
            self._next_stream += STREAM_S
            angles, rates = self._backend.state.attitude, self._backend.state.gyro
            self._mavlink.attitude_send(int(1000 * time), *angles, *rates)
        if time >= self._next_beat:
            self._next_beat += 1.0
            flags = 1 | (128 if self._rover.armed else 0)
            self._mavlink.heartbeat_send(10, 3, flags, self._rover.mode, 4)

    def _handle(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self._rover.heard = self._backend.time
        elif kind == "COMMAND_LONG":
            handler = self._commands.get(message.command)
            result = handler(message) if handler else UNSUPPORTED
            self._mavlink.command_ack_send(message.command, result)
        elif kind == "MISSION_COUNT":
            self._items, self._expected = {}, message.count
            self._mavlink.mission_request_send(*GROUND_STATION, 0, 0)
        elif kind == "MISSION_ITEM_INT":
            self._take_item(message)
        elif kind == "RC_CHANNELS_OVERRIDE" and message.get_srcSystem() == GROUND_STATION[0]:
            self._override(message)
        elif kind == "REQUEST_DATA_STREAM":
            self._streaming = bool(message.start_stop)
        elif kind == "PARAM_REQUEST_READ" and len(self._requests) < QUEUED_REQUESTS:
            self._requests.append(message.param_id)

    def _take_item(self, message: Any) -> None:
        if message.seq != len(self._items):
            result = mavlink.MAV_MISSION_INVALID_SEQUENCE
        elif message.command != mavlink.MAV_CMD_NAV_WAYPOINT:
            result = mavlink.MAV_MISSION_UNSUPPORTED
        else:
            self._items[message.seq] = (message.x / 1e7, message.y / 1e7)
            if len(self._items) < self._expected:
                self._mavlink.mission_request_send(*GROUND_STATION, message.seq + 1, 0)
                return
            self._rover.set_route(list(self._items.values()))
            self.say("Flight plan received")
            result = mavlink.MAV_MISSION_ACCEPTED
        self._mavlink.mission_ack_send(*GROUND_STATION, result, 0)

    def _override(self, message: Any) -> None:
        for channel, width in ((STEERING, message.chan1_raw), (THROTTLE, message.chan3_raw)):
            if width == RELEASED:
                self._rover.overrides.pop(channel, None)
            elif width != IGNORED:
                self._rover.overrides[channel] = (width, self._backend.time)

    def _change_mode(self, mode: int) -> int:
        return ACCEPTED if self._rover.set_mode(mode, self._backend.state) else FAILED

    def _arm(self, message: Any) -> int:
        if message.param1 != 1.0:
            self._rover.armed = False
            return ACCEPTED
        return ACCEPTED if self._rover.arm(self._backend.state) else FAILED

    def _tell_parameter(self, name: str) -> None:
        parameters = self._rover.parameters
        if name in parameters:
            index = list(parameters).index(name)
            kind = mavlink.MAV_PARAM_TYPE_REAL32
            count = len(parameters)
            self._mavlink.param_value_send(name.encode(), parameters[name], kind, count, index)

    @property
    def in_auto(self) -> bool:
        """Whether the rover drives the route."""
        return self._rover.armed and self._rover.mode == AUTO
