"""Draws triangles that hide each other, by a buffer of depths."""

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.compilation.rules import compile_rule

from .camera import NEAR_M, Floats, Pixels

_FILL = types.void(
    types.Array(types.float64, 3, "C"),
    types.Array(types.int64, 2, "C"),
    types.Array(types.uint8, 2, "C"),
    types.Array(types.float32, 2, "C"),
    types.Array(types.uint8, 3, "C"),
)


class Picture(NamedTuple):
    """The view of a camera, pixel by pixel, from the top left."""

    colours: Pixels  # (h, w, 3); the background is white
    depth: Floats  # (h, w) [m]; infinite where nothing is seen


def rasterize(corners: Array, colours: Pixels, size: tuple[int, int]) -> Picture:
    """Draw the fronts of triangles into a picture of ``size``, its width and height.

    ``corners`` (t, 3, 3) are (column * depth, row * depth, depth [m]) of each triangle's corners,
    as from ``Camera.pixels``; ``colours`` (t, 3).

    A point of a triangle is the mean of its corners with three weights. Divided by the depth, each
    weight is linear in column and row, even if corners are behind the camera. Their sum is the
    nearness, 1 / depth, and a pixel is inside if none is negative.
    """
    a, b, c = corners.transpose(1, 0, 2)
    weights = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    volume = (a * weights[:, 0]).sum(axis=1)
    shown = (volume < 0.0) & (corners[:, :, 2].max(axis=1) > NEAR_M)  # the front is negative
    weights = np.ascontiguousarray(weights[shown] / volume[shown, None, None])
    picture = np.full((size[1], size[0], 3), 255, np.uint8)
    nearness = np.zeros((size[1], size[0]), np.float32)
    fill, boxes = compile_rule(_fill, _FILL), _bound(corners[shown], size)
    fill(weights, boxes, np.ascontiguousarray(colours[shown]), nearness, picture)
    with np.errstate(divide="ignore"):
        return Picture(picture, np.float32(1.0) / nearness)


def _bound(corners: Array, size: tuple[int, int]) -> NDArray[np.int64]:
    """Return the first and last columns and rows (t, 4) of triangles, as ranges in a picture."""
    depth = corners[:, :, 2:]
    crossing = depth.min(axis=(1, 2)) <= NEAR_M  # in front of the camera in part
    points = corners[:, :, :2] / np.where(crossing[:, None, None], 1.0, depth)
    low, high = points.min(axis=1), points.max(axis=1) + 1.0
    low[crossing], high[crossing] = 0.0, size
    return np.hstack([low, high]).clip(0.0, [*size, *size]).astype(np.int64)


def _fill(
    weights: Array, boxes: NDArray[np.int64], colours: Pixels, nearness: Floats, picture: Pixels
) -> None:
    """Draw triangles, unless ``nearness`` (h, w) has something nearer."""
    for t in range(len(weights)):
        first, second, third = weights[t]
        for row in range(boxes[t, 1], boxes[t, 3]):
            y = row + 0.5
            for column in range(boxes[t, 0], boxes[t, 2]):
                x = column + 0.5
                one = first[0] * x + first[1] * y + first[2]
                two = second[0] * x + second[1] * y + second[2]
                three = third[0] * x + third[1] * y + third[2]
                near = one + two + three
                if min(one, two, three) >= 0.0 and nearness[row, column] < near < 1.0 / NEAR_M:
                    nearness[row, column] = near
                    for channel in range(3):
                        picture[row, column, channel] = colours[t, channel]
