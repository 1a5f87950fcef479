"""Start, then one frame after the other for as long as it is let."""

import signal
import time
from pathlib import Path
from typing import NoReturn

from .backend import Backend
from .faults import Fault, read_fault
from .link import Link, connect
from .options import read_options, read_parameters
from .rover import Rover


def main() -> NoReturn:
    """Read the command line, connect, and run."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    options = read_options()
    print("Starting SITL: JSON", flush=True)
    where = f"{options.sim_address}:{options.sim_port_out}"
    print(f"JSON control interface set to {where}\nStarting sketch 'Rover'", flush=True)
    parameters = read_parameters(options.defaults)
    lat, lon = (float(word) for word in options.home.split(",")[:2])
    rover = Rover(parameters, (lat, lon))
    backend = Backend((options.sim_address, options.sim_port_out))
    link = Link(connect(options.serial0), rover, backend)
    Path("eeprom.bin").write_bytes(bytes(16384))
    link.say("ArduRover V4.7.5 (a1b2c3d4)")
    run(backend, rover, link, read_fault())


def run(backend: Backend, rover: Rover, link: Link, fault: Fault) -> NoReturn:
    """Send servos, wait for a state, live through it."""
    in_auto = -1  # frames since the first in AUTO
    while True:
        if in_auto >= 0 or link.in_auto:
            in_auto += 1
        servos = rover.servos(backend.state)
        now = fault.happens(backend.frame, in_auto)
        if now:
            spoil_servos(fault, servos)
            spoil_link(fault, link)
            fault.act()
        packet = backend.pack(servos)
        sent = spoil_packet(fault, packet) if now else packet
        if fault.kind == "slow" and fault.has_begun(backend.frame, in_auto):
            time.sleep(fault.value)
        if sent:
            backend.send(sent)
        backend.wait(packet)
        if fault.kind == "deaf":
            continue
        rover.update(backend.time, backend.step, backend.state)
        link.serve()


def spoil_servos(fault: Fault, servos: list[int]) -> None:
    """Set the servo that the fault names to its value."""
    if fault.kind in ("steering", "throttle"):
        servos[0 if fault.kind == "steering" else 2] = int(fault.value)


def spoil_packet(fault: Fault, packet: bytes) -> bytes:
    """Return what is sent for a packet."""
    if fault.kind == "rubbish":
        return b"\0\0" + packet[2:]
    if fault.kind == "short":
        return packet[: len(packet) // 2]
    return b"" if fault.kind == "miss" else packet


def spoil_link(fault: Fault, link: Link) -> None:
    """Send bytes that are no message, or close the connection."""
    if fault.kind == "noise":
        link.write(bytes(range(256)))
    if fault.kind == "unlink":
        link.close()
