"""The walkers of one mission: who they are, and the arrays of their rule at the start."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.base.packing import pack
from evoros.walkers import layout
from evoros.walkers.layout import Walk, Walking
from evoros.walkers.walkers import Walkers

AWAY_M = 1e5
"""Walkers that a mission has not are this far away, 10 m from each other."""


class Walker(NamedTuple):
    """One walker at the start of a mission."""

    name: str
    radius: float  # [m]
    height: float  # [m]
    corners: Array  # (k, CORNER_SIZE)
    place: tuple[float, float]  # [m]
    goal: int = 0  # the corner to which it walks
    pace: float = 0.0  # [m/s]
    group: Walkers | None = None  # None: it follows the times of a script
    delay: float = 0.0  # [s] before each round of its script
    loops: bool = False  # whether its script has several rounds
    present: bool = True


class Surroundings(NamedTuple):
    """Robots and obstacles around walkers."""

    outlines: Sequence[Array]  # (k, 2) [m], of each robot in its frame
    borders: tuple[Array, ...]  # the fields of ``Walk`` from ``grid`` on


@dataclass(frozen=True, eq=False)
class Crowd:
    """The walkers of a mission; ``memory`` is that at its start."""

    names: tuple[str, ...]
    sizes: tuple[tuple[float, float], ...]  # radius and height [m] of each
    parameters: Array  # a packed Walk
    memory: Array  # a packed Walking

    @classmethod
    def of(cls, walkers: Sequence[Walker], around: Surroundings) -> "Crowd":
        """Put walkers into arrays, in their order."""
        rows = np.zeros((len(walkers), layout.WALKER_SIZE))
        places = np.zeros((len(walkers), 2))
        motions = np.zeros((len(walkers), layout.MOTION_SIZE))
        first = 0
        for i, walker in enumerate(walkers):
            end = first + len(walker.corners)
            rows[i] = _describe(walker, first, end)
            places[i] = walker.place if walker.present else (AWAY_M + 10.0 * i, AWAY_M)
            motions[i, layout.GOAL] = first + walker.goal
            if walker.group is not None and walker.present:
                motions[i, : layout.VELOCITY_Y + 1] = walker.pace * _find_heading(walker)
            first = end
        corners = [np.zeros((0, layout.CORNER_SIZE)), *(walker.corners for walker in walkers)]
        ends = np.cumsum([0, *map(len, around.outlines)]).astype(np.float64)
        outlines = np.concatenate([np.zeros((0, 2)), *around.outlines])
        walk = Walk(rows, np.concatenate(corners), ends, outlines, *around.borders)
        names = tuple(walker.name for walker in walkers)
        sizes = tuple((walker.radius, walker.height) for walker in walkers)
        return cls(names, sizes, pack(walk), pack(Walking(places, motions)))


def _describe(walker: Walker, first: int, end: int) -> list[float]:
    """Return the row of a walker."""
    group = walker.group
    if group is None:
        kind = layout.ACTING
        manners = [0.0] * (layout.DELAY - layout.AVOIDS)
    else:
        kind = layout.WALKING
        gap = group.stop_distance_m if group.stops_for_robots else 0.0
        force = group.force
        manners = [float(group.avoids_robots), gap, group.patience_s, force.relaxation_s]
        manners += [force.repulsion_m2ps2, force.range_m]
        manners += [force.border_repulsion_m2ps2, force.border_range_m]
    kind = kind if walker.present else layout.ABSENT
    route = [walker.radius, walker.pace, first, end, kind]
    return [*route, *manners, walker.delay, float(walker.loops)]


def _find_heading(walker: Walker) -> Array:
    """Return the unit vector (2,) from a walker to its goal."""
    way = walker.corners[walker.goal, :2] - np.array(walker.place)
    length = float(np.sqrt((way * way).sum()))
    heading: Array = way / length if length > 0.0 else np.array([1.0, 0.0])
    return heading
