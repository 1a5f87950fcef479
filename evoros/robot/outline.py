"""Shapes of a robot's links, and their outlines: convex polygons seen from above."""

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.footprint import (
    Footprint,
    bottom_height,
    convex_hull,
    distances,
    project_shape,
    top_height,
)
from evoros.geometry.shapes import Pose, Shape

_CIRCLE_CORNERS = 64  # number of corners of a polygon around a circle
_OVERHANG_M = 1e-3  # maximum overhang of a wheel that the body still covers


@dataclass(frozen=True)
class SolidShape:
    """A shape of a link; ``pose`` is in the robot's frame, with the wheels straight ahead."""

    link: str
    shape: Shape
    pose: Pose
    rolls: bool = False  # True for wheels and casters

    @property
    def height_range(self) -> tuple[float, float]:
        """The heights [m] of its lowest and highest point."""
        return bottom_height(self.shape, self.pose), top_height(self.shape, self.pose)


def compute_outline(solids: Iterable[tuple[Shape, Pose]]) -> Array:
    """Return the hull (k, 2) [m] of shapes seen from above; polygons stand for circles."""
    turn = np.arange(_CIRCLE_CORNERS) * (2.0 * math.pi / _CIRCLE_CORNERS)
    disc = np.stack([cos_all(turn), sin_all(turn)], axis=1) / elementary.cos(
        math.pi / _CIRCLE_CORNERS
    )
    corners = []
    for shape, pose in solids:
        footprint = project_shape(shape, pose)
        reach = footprint.radius * disc if footprint.radius > 0 else np.zeros((1, 2))
        corners.append((footprint.vertices[:, None] + reach[None]).reshape(-1, 2))
    return convex_hull(np.concatenate(corners))


def compute_outline_at(solids: Sequence[SolidShape], height: float) -> Array | None:
    """Return the outline (k, 2) [m] of the shapes at a height [m]; None if there are none."""
    reaching = [
        (solid.shape, solid.pose)
        for solid in solids
        if solid.height_range[0] <= height <= solid.height_range[1]
    ]
    return compute_outline(reaching) if reaching else None


def rolling_shapes(urdf: Urdf, link: str) -> list[tuple[Shape, Pose]]:
    """Return the shapes of a wheel or caster, in the robot's frame.

    If the visual of a sphere is a narrower cylinder, as on passive wheels, the cylinder replaces
    it.
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
    corners = {link: compute_outline(rolling_shapes(urdf, link)) for link in rolling}
    return frozenset(
        link for link, places in corners.items() if distances(body, places).max() > _OVERHANG_M
    )
