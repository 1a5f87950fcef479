"""The solid shapes of a world's bodies at their places, and which of them overlap."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.geometry.overlap import Solid
from evoros.geometry.shapes import Body

SLACK_M = 0.002
"""An overlap of at most this depth is left to the engines, which take it for a contact.

They push two bodies apart at up to 100 times the depth per second, at their finest usual step of
2.5 ms. Only up to 2 mm is this slower than a free fall from the same height. A robot also drives
over what is not deeper, and a body that is not higher above the ground stands.
"""


@dataclass(frozen=True, eq=False)
class Solids:
    """Solid shapes with the boxes around them; all arrays have a row for each shape."""

    shapes: tuple[Solid, ...]
    body: NDArray[np.intp]  # the number of its body
    low: Array  # (n, 3) [m]
    high: Array  # (n, 3) [m]

    @classmethod
    def of(cls, bodies: Sequence[Body]) -> "Solids":
        """List the shapes of bodies; planes and height fields are not solid."""
        placed = [
            (i, Solid.at(shape, body.pose @ shape.pose))
            for i, body in enumerate(bodies)
            for shape in body.shapes
            if shape.kind not in ("plane", "heightfield")
        ]
        boxes = np.array([solid.box() for _, solid in placed]).reshape(-1, 2, 3)
        indices = np.array([i for i, _ in placed], dtype=np.intp)
        return cls(tuple(solid for _, solid in placed), indices, boxes[:, 0], boxes[:, 1])

    def shapes_of(self, body: int) -> list[int]:
        """Return the numbers of a body's shapes."""
        return np.flatnonzero(self.body == body).tolist()

    def list_near(self, shape: int, axes: int) -> Iterator[int]:
        """Yield the shapes of other bodies whose boxes overlap a shape's along the first axes."""
        low, high = self.low[:, :axes], self.high[:, :axes]
        near = (low < high[shape] - SLACK_M) & (high > low[shape] + SLACK_M)
        yield from np.flatnonzero(near.all(axis=1) & (self.body != self.body[shape])).tolist()
