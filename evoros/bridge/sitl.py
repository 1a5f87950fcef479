"""The JSON backend of ArduPilot's simulation (SITL): servo outputs in, states out, over UDP.

One exchange is a frame: SITL sends the widths of its servo pulses and waits for the next state,
whose time is all the time that it knows. If it waits for long, it sends the same frame again.
"""

import math
import socket
import struct
from collections.abc import Sequence
from time import monotonic

import orjson

from evoros.base.errors import SimulationError
from evoros.bridge.process import OutsideProcess

GRAVITY = 9.80665
NO_PULSE = 0
MIN_WIDTH_US, MAX_WIDTH_US = 800, 2200
"""A servo's pulse is at least and at most this wide; ArduPilot cannot be told wider limits."""
LAYOUTS = {
    size.size: (size, magic)
    for size, magic in ((struct.Struct("<HHI16H"), 18458), (struct.Struct("<HHI32H"), 29569))
}
"""By its length: the layout of a packet (magic, rate [Hz], frame, widths [us]), and its magic."""
WIDTHS = 3
"""The place of the first width in a packet."""
LONGEST = 4096
LOOK_US = 50_000
"""Time of a receive before it looks whether the process still runs [us]."""


class SitlFrames:
    """The frames of one SITL process. Only one thread uses it."""

    def __init__(
        self, process: OutsideProcess, udp: socket.socket, ahead_m: float, range_finders: int
    ) -> None:
        """Use a bound socket; the told point is ``ahead_m`` ahead of the one that moves ahead."""
        self._process, self._udp, self._ahead = process, udp, ahead_m
        self._ranges = [f"rng_{i}" for i in range(1, range_finders + 1)]
        udp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", 0, LOOK_US))
        self._last_frame = -1
        self._speed = self._yaw_rate = math.nan

    def receive(self, limit_s: float, time: float | None) -> tuple[int, ...]:
        """Wait for the next frame and return the widths of its servo pulses [us].

        ``time`` is the mission's [s], if it has begun.

        Raises:
            PilotLost: the process ended, or sent no new frame within the wall-clock time.
            SimulationError: a packet is no frame, or has no width of a servo's pulse.
        """
        until = 0.0
        while True:
            try:
                data = self._udp.recv(LONGEST)
            except (BlockingIOError, ConnectionRefusedError):
                now = monotonic()
                until = until or now + limit_s
                if not self._process.running() or now > until:
                    raise self._process.lost(
                        f"sent no servo outputs within {limit_s:g} s", time
                    ) from None
                continue
            layout, magic = LAYOUTS.get(len(data), (None, 0))
            if layout is None:
                raise self._unusable(f"a packet of {len(data)} bytes", time)
            values = layout.unpack(data)
            start, _, frame = values[:WIDTHS]
            if start != magic:
                raise self._unusable(f"a packet that begins with {start}, not {magic}", time)
            if frame > self._last_frame:
                self._last_frame = frame
                return values[WIDTHS:]

    def connect(self, limit_s: float) -> None:
        """Wait for the first frame, so that states go to where it came from."""
        until = monotonic() + limit_s
        while True:
            try:
                _, address = self._udp.recvfrom(LONGEST, socket.MSG_PEEK)
            except BlockingIOError:
                if not self._process.running() or monotonic() > until:
                    raise self._process.lost(
                        f"sent no servo outputs within {limit_s:g} s of its start"
                    ) from None
            else:
                self._udp.connect(address)
                return

    def send(
        self,
        clock: float,
        step: float,
        pose: Sequence[float],
        motion: Sequence[float],
        ranges: Sequence[float],
    ) -> None:
        """Send the state at ``clock`` [s], ``step`` after the one before.

        ``pose`` is x (north), y (west) [m] and yaw (left positive) [rad]; ``motion`` is the speed
        ahead [m/s] and the yaw rate [rad/s], on level ground; ``ranges`` has a reading [m] of each
        range finder.
        """
        x, y, yaw = pose
        speed, rate = motion
        ahead, cos, sin = self._ahead, math.cos(yaw), math.sin(yaw)
        gain = turn = 0.0
        if self._speed == self._speed:
            gain, turn = (speed - self._speed) / step, (rate - self._yaw_rate) / step
        self._speed, self._yaw_rate = speed, rate
        aside = rate * ahead  # the velocity to the left of a point ahead of the axle
        forward, left = gain - rate * aside, rate * speed + turn * ahead
        north, west = speed * cos - aside * sin, speed * sin + aside * cos
        told = {
            "timestamp": round(clock, 6),
            "imu": {"gyro": (0.0, 0.0, -rate), "accel_body": (forward, -left, -GRAVITY)},
            "position": (x, -y, 0.0),
            "attitude": (0.0, 0.0, -yaw),
            "velocity": (north, -west, 0.0),
            **dict(zip(self._ranges, ranges, strict=True)),
        }
        try:  # ArduPilot's parser wants no space in it, and line ends on both sides
            self._udp.send(b"\n%b\n" % orjson.dumps(told))
        except ConnectionRefusedError:
            return  # nobody is there; ``receive`` reports it

    def check_widths(self, widths: Sequence[int], time: float) -> None:
        """Require pulses that a servo can follow, or none.

        Raises:
            SimulationError: a width is out of range.
        """
        for width in widths:
            if width != NO_PULSE and not MIN_WIDTH_US <= width <= MAX_WIDTH_US:
                raise self._unusable(f"a servo pulse of {width} us", time)

    def _unusable(self, what: str, time: float | None) -> SimulationError:
        when = "before the mission began" if time is None else f"at {time:g} simulated s"
        return SimulationError(
            f"{self._process.name} sent {what} {when}; it must send packets of 16 or 32 servo "
            f"pulses of {MIN_WIDTH_US} to {MAX_WIDTH_US} us"
        )
