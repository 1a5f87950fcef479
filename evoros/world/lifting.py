"""How far movable bodies must be lifted so that they stand on what they start in."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from evoros.geometry.overlap import Clearance, clearance, overlap_depth
from evoros.geometry.shapes import Body
from evoros.world.solids import SLACK_M, Solids

_STEEP = 1.5
"""A body is lifted out of another one if this is at most so many times the shortest way out. What
overlaps at the side would end on top of the other."""


@dataclass(frozen=True, eq=False)
class Lifts:
    """The lifts of movable bodies by their number, and what led to them."""

    heights: dict[int, float] = field(default_factory=dict)  # [m]
    depths: dict[int, float] = field(default_factory=dict)  # [m] in what is below them
    stuck: dict[int, float] = field(default_factory=dict)  # [m] in the ground, without room above


class _Near(NamedTuple):
    """A body above, below or in another one."""

    base: float  # its lift [m]
    gap: Clearance
    depth: float  # [m], of the overlap


def find_lifts(bodies: Sequence[Body], solids: Solids, sunk: Mapping[int, float]) -> Lifts:
    """Find the lifts of movable bodies, from the lowest to the highest.

    A body is lifted out of the ground and out of what carries it, with the bodies that stand on
    it. It is not lifted into a body above it, unless that body moves up as well. ``sunk`` has the
    depths [m] of bodies in the ground.
    """
    shapes = {i: solids.shapes_of(i) for i, body in enumerate(bodies) if body.mass is not None}
    lowest = {i: float(solids.low[rows, 2].min()) for i, rows in shapes.items()}
    lifts, waiting = Lifts(), set(shapes)
    for i in sorted(shapes, key=lambda i: (lowest[i], i)):
        waiting.remove(i)
        near = [
            _Near(lifts.heights.get(other, 0.0), gap, depth)
            for other, gap, depth in _list_near(shapes[i], solids, waiting)
        ]
        _lift(i, sunk.get(i, 0.0), near, lifts)
    return lifts


def _list_near(
    shapes: Sequence[int], solids: Solids, waiting: Collection[int]
) -> Iterator[tuple[int, Clearance, float]]:
    """Yield the bodies above, below or in the shapes of a body, but for those ``waiting``.

    Each comes with the lifts at which the shapes overlap, and the depth [m] at which they do now.
    """
    for shape in shapes:
        for other in solids.list_near(shape, axes=2):
            if (body := int(solids.body[other])) in waiting:
                continue
            first, second = solids.shapes[shape], solids.shapes[other]
            gap = clearance(first, second)
            if gap is not None:
                overlap = gap.low < -SLACK_M and gap.high > SLACK_M
                yield body, gap, overlap_depth(first, second) if overlap else 0.0


def _lift(body: int, sunk: float, near: Sequence[_Near], lifts: Lifts) -> None:
    """Add the lift of a body, ``sunk`` [m] in the ground, to the lifts of the bodies around it."""
    deepest = need = sunk
    ceiling = math.inf
    for base, gap, depth in near:
        if depth > SLACK_M:
            if gap.high <= _STEEP * depth:
                need, deepest = max(need, base + gap.high), max(deepest, gap.high)
        elif base and gap.high <= SLACK_M:
            need = max(need, base + gap.high)
        elif gap.low >= -SLACK_M:
            ceiling = min(ceiling, base + gap.low)
    if need > ceiling + SLACK_M:
        if sunk:
            lifts.stuck[body] = sunk
    elif need > 0.0:
        lifts.heights[body] = need
        if deepest:
            lifts.depths[body] = deepest
