"""Measures what a frame with an autopilot costs in evoros itself, apart from the autopilot.

A mission among boxes is recorded with BINARY: an ardurover, or the tests' stand-in for one. A C
program (``replayed_rover.c``) then repeats the autopilot's side, and works for WORK_US a frame, as
an autopilot would. The script checks that the missions have the same bytes. A loop that only sends
and receives packets is measured beside them. The rows take turns, so that a busy machine slows all:

    python benchmarks/performance/replay.py BINARY [WORK_US]
"""

import os
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time

import numpy as np

from evoros.config.compose import compose
from evoros.design.design import Design
from evoros.mission.mission import Mission
from evoros.mission.rollout import run_mission
from evoros.plugins.ardupilot.sitl import share_core
from evoros.sensor.protocol import Mount

ROUNDS = 7
LIMIT_S, PERIOD_S = 100.0, 0.02
FRAMES = round(LIMIT_S / PERIOD_S)
STATE = bytes(400)  # as long as a state is
LENGTHS = struct.Struct("=II")
SERVOS, MAVLINK = "--sim-port-out", "--serial0"


# The recorder, between evoros and the autopilot ----------------------------------------------


def record(binary: str, tape: str, *words: str) -> None:
    """Start the autopilot, pass on what both sides send, and write down the autopilot's part."""
    given = list(words)
    servo_place, mavlink_place = (given.index(name) + 1 for name in (SERVOS, MAVLINK))
    ours = socket.create_connection(("127.0.0.1", int(given[mavlink_place].split(":")[-1])))
    states = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    states.connect(("127.0.0.1", int(given[servo_place])))
    with listen() as (servos, listening):
        given[servo_place] = str(servos.getsockname()[1])
        given[mavlink_place] = f"tcpclient:127.0.0.1:{listening.getsockname()[1]}"
        subprocess.Popen([binary, *given])
        theirs, _ = listening.accept()
        for connection in (ours, theirs):  # every byte has its frame
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with open(tape, "wb", buffering=0) as file:
            while True:
                packet, sender = servos.recvfrom(4096)
                said = pass_on(theirs, ours)
                file.write(LENGTHS.pack(len(said), len(packet)) + said + packet)
                states.send(packet)
                state = states.recv(65536)
                pass_on(ours, theirs)
                servos.sendto(state, sender)


@contextmanager
def listen() -> Iterator[tuple[socket.socket, socket.socket]]:
    """Open the sockets for servo outputs and for MAVLink."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as servos, socket.socket() as listening:
        servos.bind(("127.0.0.1", 0))
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        yield servos, listening


def pass_on(source: socket.socket, target: socket.socket) -> bytes:
    """Pass on all bytes that have come, and return them."""
    data = b""
    while True:
        try:
            more = source.recv(65536, socket.MSG_DONTWAIT)
        except BlockingIOError:
            break
        if not more:
            sys.exit()
        data += more
    if data:
        target.sendall(data)
    return data


# The measurement ------------------------------------------------------------------------------


def make_mission(binary: Path, share: bool) -> Callable[[], bytes]:
    """Return a function that runs the mission, and returns its bytes."""
    choices = ["world=boxes", "simulator=planar", "controller=ardupilot"]
    settings = [f"controller.binary={binary}", f"controller.share_core={str(share).lower()}"]
    limit = f"course.time_limit_s={LIMIT_S}"
    scenario = compose([*choices, *settings, limit]).build().scenario
    yaws = np.linspace(-90.0, 90.0, 6)
    mounts = tuple(Mount("sonar", "base_link", 0.1, 0.0, 0.166, float(yaw), 12.5) for yaw in yaws)
    mission = Mission(0, 0, Design(mounts), "boxes", 0, "evaluation", "benchmark")

    def run() -> bytes:
        (outcome,), track = run_mission(scenario, mission)
        if outcome.ended != "time_limit":
            sys.exit(f"replay.py: the mission must last {LIMIT_S:g} s, but ended: {outcome}")
        return track.tobytes() + repr(outcome).encode()

    return run


def make_bare(rover: Path, share: bool) -> Callable[[], bytes]:
    """Return a function that only sends and receives as many packets."""

    def run() -> bytes:
        with share_core(wanted=share), listen() as (servos, listening):
            ports = servos.getsockname()[1], listening.getsockname()[1]
            words = [SERVOS, str(ports[0]), MAVLINK, f"tcpclient:127.0.0.1:{ports[1]}"]
            process = subprocess.Popen([rover, *words])
            _, sender = servos.recvfrom(4096)
            servos.connect(sender)
            for _ in range(FRAMES):
                servos.send(STATE)
                servos.recv(4096)
            process.kill()
            process.wait()
        return b""

    return run


def measure(binary: str, work_us: str = "25") -> None:
    """Record a mission, and print a row for each way to repeat it."""
    with TemporaryDirectory() as folder:
        recorder, rover, tape = (Path(folder) / name for name in ("recorder", "rover", "tape"))
        source = Path(__file__).with_name("replayed_rover.c")
        subprocess.run(["cc", "-O2", "-o", rover, source], check=True)
        command = f"{sys.executable} {Path(__file__).resolve()} --record {Path(binary).resolve()}"
        recorder.write_text(f'#!/bin/sh\nexec {command} {tape} "$@"\n')
        recorder.chmod(0o755)
        recorded = make_mission(recorder, share=False)()
        os.environ |= {"TAPE": str(tape), "WORK_US": work_us}
        rows = {
            "packets, two cores": make_bare(rover, share=False),
            "packets, one core": make_bare(rover, share=True),
            "mission, two cores": make_mission(rover, share=False),
            "mission, one core": make_mission(rover, share=True),
        }
        times: dict[str, list[tuple[float, float]]] = {name: [] for name in rows}
        for _ in range(ROUNDS):
            for name, run in rows.items():
                begun, used = perf_counter(), process_time()
                if run() not in (b"", recorded):
                    sys.exit(f"replay.py: {name}: not the recorded bytes")
                times[name].append((perf_counter() - begun, process_time() - used))
    for name, pairs in times.items():
        wall, own = 1e6 * np.median(pairs, axis=0) / FRAMES
        print(
            f"{name:20}{wall:7.1f} us a frame, of these{own:6.1f} us of CPU time in evoros; ",
            end="",
        )
        print(f"{1e6 * PERIOD_S / wall:4.0f} x real time")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--record"]:
        record(*sys.argv[2:])
    elif len(sys.argv) in (2, 3):
        measure(*sys.argv[1:])
    else:
        sys.exit("replay.py: give an ardurover, and the us that it shall work in a frame, if any")
