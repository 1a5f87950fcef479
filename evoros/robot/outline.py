"""Outlines of a robot and its links: convex polygons around collision shapes, seen from above."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.geometry.footprint import bottom_height, convex_hull, project_shape, top_height
from evoros.geometry.shapes import Pose, Shape

_CIRCLE_CORNERS = 64  # of the polygon around a circle


@dataclass(frozen=True)
class SolidShape:
    """A collision shape of a link that does not roll; ``pose`` is in the robot's frame."""

    link: str
    shape: Shape
    pose: Pose

    @property
    def height_range(self) -> tuple[float, float]:
        """The heights [m] of its lowest and its highest point."""
        return bottom_height(self.shape, self.pose), top_height(self.shape, self.pose)


def compute_outline(solids: Iterable[tuple[Shape, Pose]]) -> Array:
    """Return the hull (k, 2) [m] of the footprints of shapes, with polygons around circles."""
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
    """Return the outline (k, 2) [m] of the shapes that reach a height [m]; None if none does."""
    reaching = [
        (solid.shape, solid.pose)
        for solid in solids
        if solid.height_range[0] <= height <= solid.height_range[1]
    ]
    return compute_outline(reaching) if reaching else None
