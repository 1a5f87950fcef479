"""Finds the wheels and casters that stick out of a robot's body."""

from collections.abc import Collection

from evoros.base.arrays import Array
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.footprint import Footprint, distances
from evoros.geometry.shapes import Pose, Shape
from evoros.robot.outline import compute_outline

_OVERHANG_M = 1e-3  # of a wheel, which is still covered by the body


def rolling_shapes(urdf: Urdf, link: str) -> list[tuple[Shape, Pose]]:
    """Return the shapes of a wheel or caster, in the robot's frame.

    A sphere that a narrower cylinder is shown for, as wheels have it that only roll, counts as
    that cylinder.
    """
    shapes, shown = urdf.shapes[link], urdf.visuals[link]
    balls = [shape for shape in shapes if shape.kind == "sphere"]
    discs = [shape for shape in shown if shape.kind == "cylinder"]
    if balls and len(balls) == len(shapes) and discs:
        shapes = tuple(discs)
    return [(shape, urdf.poses[link] @ shape.pose) for shape in shapes]


def find_exposed(urdf: Urdf, rolling: Collection[str], outline: Array) -> frozenset[str]:
    """Return the wheels and casters that stick out of an outline (k, 2) [m]."""
    body = Footprint(outline)
    exposed = set()
    for link in rolling:
        corners = compute_outline(rolling_shapes(urdf, link))
        if float(distances(body, corners).max()) > _OVERHANG_M:
            exposed.add(link)
    return frozenset(exposed)
