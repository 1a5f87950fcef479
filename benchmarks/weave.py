"""How late positions make ArduPilot's law weave: heading on a straight leg against the lag.

Writes docs/img/weave.png and prints the table behind it:  python benchmarks/weave.py
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from evoros.controller.blind import Blind
from evoros.controller.l1 import L1
from evoros.controller.rover import Rover
from evoros.filter.delay import Delay
from evoros.filter.hold import Hold
from evoros.rng import generator
from evoros.types import (
    COMMAND_SIZE,
    DRIVE_SPEED,
    POSE_SIZE,
    SPEED,
    STATE_SIZE,
    STEERING,
    YAW,
    YAW_RATE,
    Array,
    Channels,
    Filter,
    X,
    Y,
)

if TYPE_CHECKING:
    from evoros.robot import Robot

LEG = np.array([0.0, 0.0, 1000.0, 0.0])
OFFSET_M, TURNED_RAD = 0.5, 0.5  # where a rover is after a corner: beside the leg, and oblique
SETTLED_S = 20.0  # the way back to the leg is not counted
FIGURE = Path(__file__).parents[1] / "docs" / "img" / "weave.png"


@dataclass(frozen=True)
class Bicycle:
    """A rover that does not slip, and steers at once."""

    wheelbase_m: float
    steering_limit: float

    @property
    def drive(self) -> "Bicycle":
        """All that the controller asks of a robot."""
        return self

    def advance(self, state: Array, command: Array, duration: float) -> None:
        """Exactly along the arc that a constant command drives."""
        speed, steering = command[DRIVE_SPEED], command[STEERING]
        rate = speed * math.tan(steering) / self.wheelbase_m
        half = 0.5 * rate * duration
        chord = speed * duration * (math.sin(half) / half if half else 1.0)
        state[X] += chord * math.cos(state[YAW] + half)
        state[Y] += chord * math.sin(state[YAW] + half)
        state[YAW] += 2.0 * half
        state[SPEED], state[YAW_RATE] = speed, rate


# Full lock of the default rover: 0.7727 rad at the inner wheel, kingpins 0.269 m apart.
DEFAULT = Bicycle(wheelbase_m=0.334, steering_limit=0.6108)
AS_RUN = Bicycle(wheelbase_m=0.390, steering_limit=0.7727)


def drive(
    robot: Bicycle, lag_s: float, hold_s: float = 0.0, seconds: float = 60.0, period_s: float = 0.1
) -> Array:
    """(n, 3) time [s], heading [rad] and distance from the leg [m], as a mission runs them."""
    localization: dict[str, Filter] = {"hold": Hold(hold_s)} if hold_s else {}
    localization["delay"] = Delay(lag_s)
    controller = Rover(Blind(), L1(), period_s, localization)
    endless = np.full(POSE_SIZE, math.inf)
    channels = Channels(-endless, endless, np.zeros((POSE_SIZE, 3)), period_s)
    rng = generator("weave", "filters")
    filters = [
        (part.rule, *part.start(channels, np.zeros(POSE_SIZE), rng))
        for part in controller.localization.values()
    ]
    state, command, nothing = np.zeros(STATE_SIZE), np.zeros(COMMAND_SIZE), np.zeros(0)
    state[Y], state[YAW], state[SPEED] = OFFSET_M, TURNED_RAD, L1().speed_mps
    rows = []
    with controller.open(cast("Robot", robot), lambda name: generator("weave", name)) as layers:
        for tick in range(round(seconds / period_s)):
            time = tick * period_s
            rows.append((time, state[YAW], state[Y]))
            known = state.copy()
            for rule, parameters, memory in filters:
                rule(parameters, memory, rng, known[:POSE_SIZE], time)
            for layer in layers:
                if layer.rule(layer.parameters, layer.memory, known, LEG, nothing, time, command):
                    break
            robot.advance(state, command, period_s)
    return np.array(rows)


def swing(track: Array) -> tuple[float, float, float]:
    """Least and greatest heading [deg] once settled, and the period [s] of the weaving."""
    time, heading = track[track[:, 0] >= SETTLED_S][:, :2].T
    above = heading > heading.mean()
    rising = time[1:][above[1:] & ~above[:-1]]
    period = float(np.diff(rising).mean()) if len(rising) > 1 else math.nan
    return math.degrees(heading.min()), math.degrees(heading.max()), period


def figure(lags: tuple[float, ...]) -> None:
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    canvas, axes = plt.subplots(
        len(lags), 1, figsize=(6.3, 5.2), sharex=True, sharey=True, layout="constrained"
    )
    for axis, lag in zip(axes, lags, strict=True):
        late = drive(DEFAULT, lag, 0.5)
        axis.axhspan(-30, 30, color="0.93", linewidth=0)
        axis.axhline(0, color="0.6", linewidth=0.6)
        axis.plot(late[:, 0], np.degrees(late[:, 1]), color="#0072b2", linewidth=1.3)
        axis.set_title(f"positions twice a second, {lag:g} s late", loc="left", fontsize=9)
        axis.set_yticks((-30, 0, 30))
        axis.set_ylim(-60, 60)
    axes[0].text(59, -27, "the paper's sweep, 60 deg", color="0.4", fontsize=8, ha="right")
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(0, 60)
    canvas.supylabel("heading against the leg [deg]", fontsize=9)
    FIGURE.parent.mkdir(parents=True, exist_ok=True)
    canvas.savefig(FIGURE, dpi=300)


def main() -> None:
    print("heading [deg] from 20 to 60 s, and period of the weaving [s]; positions late by")
    print(f"{'lag':>6} {'at':>6}   {'default rover':>24}   {'as run':>24}")
    for hold in (0.0, 0.5):
        for lag in (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0, 1.1, 1.2):
            cells = []
            for robot in (DEFAULT, AS_RUN):
                low, high, period = swing(drive(robot, lag, hold))
                cells.append(f"{low:+7.1f} .. {high:+6.1f}  {period:5.1f}")
            rate = f"{1 / (hold or 0.1):.0f} Hz"
            print(f"{lag:4.1f} s {rate:>6}   " + "   ".join(f"{cell:>24}" for cell in cells))
    figure((0.0, 0.4, 0.8, 0.9))


if __name__ == "__main__":
    main()
