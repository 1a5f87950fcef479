"""The actors of SDF files, which walk by a script."""

from dataclasses import dataclass

RADIUS_M, HEIGHT_M = 0.25, 1.7
"""The size of an actor, whose skin has none that engines know."""


@dataclass(frozen=True)
class Actor:
    """An upright cylinder that follows the times of a script."""

    name: str
    points: tuple[tuple[float, float, float], ...]  # x, y [m] and time [s]
    delay_s: float = 0.0  # before each round
    loops: bool = True
    radius_m: float = RADIUS_M
    height_m: float = HEIGHT_M
