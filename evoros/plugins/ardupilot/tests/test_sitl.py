"""The frames of ArduPilot's simulation: the states sent and the outputs received."""

import json
import math
import socket
import struct
from collections.abc import Callable, Iterator
from typing import cast

import numpy as np
import pytest

from evoros.base.arrays import Array
from evoros.base.errors import PilotLost, SimulationError
from evoros.bridge.process import OutsideProcess
from evoros.plugins.ardupilot.sitl import GRAVITY, SitlFrames

PACKET, WIDE = struct.Struct("<HHI16H"), struct.Struct("<HHI32H")


class FakeProcess:
    """A process that runs, and has nothing to say."""

    name = "ardurover"

    def running(self) -> bool:
        return True

    def lost(self, what: str, time: float | None = None) -> PilotLost:
        return PilotLost(f"{self.name} {what} at {time} s")


Frames = tuple[SitlFrames, socket.socket]


@pytest.fixture
def make_frames() -> Iterator[Callable[[float], Frames]]:
    """Makes frames, and the socket that stands for the autopilot, which has sent the first one."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    ours, theirs = sockets

    def make(ahead_m: float) -> Frames:
        told = SitlFrames(cast(OutsideProcess, FakeProcess()), ours, ahead_m, 2)
        theirs.send(PACKET.pack(18458, 50, 0, *[0] * 16))
        told.connect(1.0)
        return told, theirs

    for udp in sockets:
        udp.bind(("127.0.0.1", 0))
    theirs.connect(ours.getsockname())
    yield make
    for udp in sockets:
        udp.close()


@pytest.fixture
def frames(make_frames: Callable[[float], Frames]) -> Frames:
    return make_frames(0.0)


def test_a_frame_that_is_sent_again_is_dropped(frames: Frames) -> None:
    told, theirs = frames
    assert told.receive(1.0, None) == (0,) * 16
    for frame, width in ((1, 1500), (1, 1500), (2, 1600)):
        theirs.send(PACKET.pack(18458, 50, frame, *[width] * 16))
    assert [told.receive(1.0, None)[0] for _ in range(2)] == [1500, 1600]
    theirs.send(WIDE.pack(29569, 50, 3, *[1700] * 32))
    assert told.receive(1.0, None) == (1700,) * 32


def test_what_the_autopilot_feels_is_the_motion_of_its_point(
    make_frames: Callable[[float], Frames],
) -> None:
    """A circle to the left, told 0.2 m ahead of the axle, against differences of positions."""
    ahead, speed, rate, step = 0.2, 0.5, 0.8, 1e-3

    def point(time: float) -> Array:
        yaw, radius = rate * time, speed / rate
        axle = np.array([radius * math.sin(yaw), -radius * math.cos(yaw)])
        return axle + ahead * np.array([math.cos(yaw), math.sin(yaw)])

    told, theirs = make_frames(ahead)
    for frame in range(2):
        x, y = point(frame * step).tolist()
        told.send(frame * step, step, (x, y, rate * frame * step), (speed, rate), (1.5, 4.0))
        state = json.loads(theirs.recv(4096))
    velocity = (point(2 * step) - point(0.0)) / (2 * step)
    felt = (point(2 * step) - 2 * point(step) + point(0.0)) / step**2
    yaw = rate * step
    ahead_axis, left_axis = (math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))
    assert state["velocity"] == pytest.approx([velocity[0], -velocity[1], 0.0], abs=1e-6)
    expected = [felt @ ahead_axis, -(felt @ left_axis), -GRAVITY]
    assert state["imu"]["accel_body"] == pytest.approx(expected, abs=1e-5)
    assert state["imu"]["gyro"] == [0.0, 0.0, -rate]
    assert state["attitude"] == [0.0, 0.0, -yaw]
    assert (state["rng_1"], state["rng_2"]) == (1.5, 4.0)


@pytest.mark.parametrize(
    ("packet", "message"),
    [
        (PACKET.pack(1, 50, 1, *[1500] * 16), "a packet that begins with 1, not 18458 at 2 simul"),
        (b"rubbish", "a packet of 7 bytes at 2 simulated s"),
    ],
)
def test_what_is_no_frame_is_refused(frames: Frames, packet: bytes, message: str) -> None:
    told, theirs = frames
    told.receive(1.0, 0.0)
    theirs.send(packet)
    with pytest.raises(SimulationError, match=message):
        told.receive(1.0, 2.0)


def test_servos_outside_of_a_pulse_are_refused(frames: Frames) -> None:
    told, _ = frames
    told.check_widths((0, 800, 2200), 0.0)
    for width in (1, 799, 2201, 65535):
        with pytest.raises(SimulationError, match=f"servo pulse of {width} us at 1 simulated s"):
            told.check_widths((1500, width), 1.0)


def test_silence_is_a_lost_pilot_after_its_limit(frames: Frames) -> None:
    told, _ = frames
    told.receive(1.0, 0.0)
    with pytest.raises(PilotLost, match=r"sent no servo outputs within 0.1 s at 3 s"):
        told.receive(0.1, 3)
