"""The JSON interface of ArduPilot's simulation (SITL), which exchanges servo outputs and states.

A frame is one exchange over UDP. SITL sends its servo pulse widths (again after a long wait) and
waits for the next state, which also sets its clock. Both processes share a core, because waking an
idle core at each exchange would take longer than computing a frame.
"""

import math
import os
import socket
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic

import orjson

from evoros.base.errors import SimulationError
from evoros.bridge.process import OutsideProcess

GRAVITY = 9.80665
NO_PULSE = 0
MIN_WIDTH_US, MAX_WIDTH_US = 800, 2200  # a servo's pulses [us], which no parameter can exceed
LAYOUTS = {
    size.size: (size, magic)
    for size, magic in ((struct.Struct("<HHI16H"), 18458), (struct.Struct("<HHI32H"), 29569))
}
"""Layout (magic, rate [Hz], frame, widths [us]) and magic number of packets, by their length."""
WIDTHS = 3  # index of the first pulse width in a packet
LONGEST = 4096
LOOK_US = 50_000  # interval [us] of checks that the process runs while waiting for a packet


class SitlFrames:
    """The frames of one SITL process; not thread-safe."""

    def __init__(
        self, process: OutsideProcess, udp: socket.socket, ahead_m: float, range_finders: int
    ) -> None:
        """Use a bound socket; send states of the point ``ahead_m`` [m] ahead of the rear axle."""
        self._process, self._udp, self._ahead = process, udp, ahead_m
        self._ranges = [f"rng_{i}" for i in range(1, range_finders + 1)]
        udp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", 0, LOOK_US))
        self._last_frame = -1
        self._speed = self._yaw_rate = math.nan

    def receive(self, limit_s: float, time: float | None) -> tuple[int, ...]:
        """Return the next frame's pulse widths [us]; ``time`` is the mission time [s] or None."""
        until = 0.0
        while True:
            try:
                data = self._udp.recv(LONGEST)
            except (BlockingIOError, ConnectionRefusedError):
                now = monotonic()
                until = until or now + limit_s
                if not self._process.running() or now > until:
                    silence = f"sent no servo outputs within {limit_s:g} s"
                    raise self._process.lost(silence, time) from None
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
        """Wait for the first frame, and connect the socket to the sender of the frame."""
        until = monotonic() + limit_s
        while True:
            try:
                _, address = self._udp.recvfrom(LONGEST, socket.MSG_PEEK)
            except BlockingIOError:
                if not self._process.running() or monotonic() > until:
                    silence = f"sent no servo outputs within {limit_s:g} s of its start"
                    raise self._process.lost(silence) from None
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
        """Send the state at ``clock`` [s], ``step`` [s] after the previous state.

        ``pose`` is x (north), y (west) [m] and yaw (left positive) [rad]. ``motion`` is the forward
        speed [m/s] and the yaw rate [rad/s] on level ground. ``ranges`` holds one reading [m] per
        range finder.
        """
        x, y, yaw = pose
        speed, rate = motion
        ahead, cos, sin = self._ahead, math.cos(yaw), math.sin(yaw)
        gain = turn = 0.0
        if self._speed == self._speed:
            gain, turn = (speed - self._speed) / step, (rate - self._yaw_rate) / step
        self._speed, self._yaw_rate = speed, rate
        aside = rate * ahead  # lateral velocity of the point in front of the axle
        forward, left = gain - rate * aside, rate * speed + turn * ahead
        north, west = speed * cos - aside * sin, speed * sin + aside * cos
        state = {
            "timestamp": round(clock, 6),
            "imu": {"gyro": (0.0, 0.0, -rate), "accel_body": (forward, -left, -GRAVITY)},
            "position": (x, -y, 0.0),
            "attitude": (0.0, 0.0, -yaw),
            "velocity": (north, -west, 0.0),
            **dict(zip(self._ranges, ranges, strict=True)),
        }
        try:  # ArduPilot's parser requires a newline at both ends and no spaces
            self._udp.send(b"\n%b\n" % orjson.dumps(state))
        except ConnectionRefusedError:
            return  # ``receive`` will report that the process has ended

    def check_widths(self, widths: Sequence[int], time: float) -> None:
        """Check that each pulse width [us] is within a servo's limits; pulses may be missing."""
        for width in widths:
            if width != NO_PULSE and not MIN_WIDTH_US <= width <= MAX_WIDTH_US:
                raise self._unusable(f"a servo pulse of {width} us", time)

    def _unusable(self, what: str, time: float | None) -> SimulationError:
        when = "before the mission started" if time is None else f"at {time:g} simulated s"
        return SimulationError(
            f"{self._process.name} sent {what} {when}; it must send packets of 16 or 32 servo "
            f"pulses of {MIN_WIDTH_US} to {MAX_WIDTH_US} us; use an ardurover with the JSON backend"
        )


CLAIM = "\0evoros core {}"  # abstract Linux socket address: no file, released with the socket
PROCESSOR = 36  # field of /proc/.../stat with the core, counted after the name in parentheses


@contextmanager
def share_core(*, wanted: bool = True) -> Iterator[None]:
    """Pin this thread and its child processes to a core that no other mission uses, if possible."""
    allowed = os.sched_getaffinity(0) if wanted and hasattr(os, "sched_getaffinity") else set()
    claim = _claim_core(allowed)
    if claim is None:
        yield
        return
    core, holding = claim
    with holding:
        with suppress(OSError):
            os.sched_setaffinity(0, {core})
        try:
            yield
        finally:
            with suppress(OSError):  # the core may be offline
                os.sched_setaffinity(0, allowed)


def _claim_core(allowed: set[int]) -> tuple[int, socket.socket] | None:
    """Claim a core, preferably the current core, because the system spreads busy processes."""
    present = _find_core() if len(allowed) > 1 else None
    if present is None:
        return None
    for core in sorted(allowed, key=lambda core: (core < present, core)):
        claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            claim.bind(CLAIM.format(core))
        except OSError:  # another mission has claimed this core
            claim.close()
            continue
        return core, claim
    return None


def _find_core() -> int | None:
    try:
        status = Path("/proc/thread-self/stat").read_text(encoding="utf-8")
        return int(status.rpartition(")")[2].split()[PROCESSOR])
    except (OSError, ValueError, IndexError):
        return None
