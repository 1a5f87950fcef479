"""The JSON backend: servos out, states in, over UDP."""

import socket
import struct
from collections.abc import Sequence
from dataclasses import dataclass

PACKET = struct.Struct("<HHI16H")
MAGIC = 18458
WAIT_S, WAITS = 0.1, 10
MAX_STEP_S = 0.1
VECTORS, SCALARS = ("gyro", "accel_body", "position", "velocity"), ("timestamp",)
RANGES = tuple(f"rng_{number}" for number in range(1, 7))


@dataclass
class State:
    """The last complete state; ranges are NaN until a state contains them."""

    timestamp: float
    gyro: list[float]
    accel_body: list[float]
    position: list[float]
    velocity: list[float]
    attitude: list[float]
    ranges: list[float]


def find_numbers(text: str, key: str, count: int) -> list[float] | None:
    """Find a key by searching, and read the numbers behind it, whatever else the text is."""
    at = text.find(key)
    if at < 0:
        return None
    begin = at + len(key) + 2
    if count == 1:
        end = begin
        while end < len(text) and text[end] in "+-.0123456789eE":
            end += 1
        return [float(text[begin:end] or 0.0)]
    words = text[begin : text.find("]", begin)].lstrip("[").split(",")
    return [float(word) for word in words[:count]] if len(words) >= count else None


def parse_state(text: str, last: State) -> State | None:
    """Read a state; what is absent keeps its value, and without a required key there is none."""
    found: dict[str, list[float]] = {}
    for key in (*SCALARS, *VECTORS):
        values = find_numbers(text, key, 1 if key in SCALARS else 3)
        if values is None:
            print(f"Failed to find key /{key}", flush=True)
            return None
        found[key] = values
    attitude = find_numbers(text, "attitude", 3)
    if attitude is None:
        print("Did not receive attitude or quaternion", flush=True)
        return None
    ranges = list(last.ranges)
    for i, key in enumerate(RANGES):
        value = find_numbers(text, key, 1)
        if value is not None:
            ranges[i] = value[0]
    timestamp = found.pop("timestamp")[0]
    return State(timestamp, **found, attitude=attitude, ranges=ranges)


class Backend:
    """The socket, the frame's number and the time that the states make."""

    def __init__(self, address: tuple[str, int]) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(WAIT_S)
        self._address = address
        zero = [0.0, 0.0, 0.0]
        self.state = State(0.0, zero, zero, zero, zero, zero, [float("nan")] * 6)
        self.frame = 0
        self.time = 0.0
        self.step = 0.0

    def pack(self, servos: Sequence[int]) -> bytes:
        """Make the packet of this frame."""
        rate = round(1.0 / self.step) if self.step > 0.0 else 1200
        return PACKET.pack(MAGIC, rate, self.frame, *servos)

    def send(self, packet: bytes) -> None:
        """Send a packet of servos."""
        self._socket.sendto(packet, self._address)

    def wait(self, packet: bytes) -> None:
        """Wait for a complete state; send the packet again if none comes, or an incomplete one."""
        waited = 0
        while True:
            try:
                text = self._socket.recv(65000).decode(errors="replace")
            except TimeoutError:
                waited += 1
                if waited == WAITS:
                    waited = 0
                    print("No JSON sensor message received, resending servos", flush=True)
                    self.send(packet)
                continue
            if not (text.startswith("\n") and text.endswith("\n")):
                continue
            state = parse_state(text, self.state)
            if state is not None:
                self._take(state)
                return
            self.send(packet)

    def _take(self, state: State) -> None:
        step = state.timestamp - self.state.timestamp
        if step < 0.0:
            print("Detected physics reset", flush=True)
        elif 0.0 < step < MAX_STEP_S:
            self.step = step
            self.time += step
        self.state = state
        self.frame += 1
