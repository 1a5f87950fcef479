"""Compiled loops over pixels: solids on the ground, and sensor fans in front of both."""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

from numba import types
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.compilation.rules import A1, A2, compile_rule
from evoros.plugins.recordings.video.camera import Floats, Pixels
from evoros.plugins.recordings.video.ground import HORIZON

PIXELS, FLOATS = (types.Array(kind, 3, "C") for kind in (types.uint8, types.float32))
DEPTHS = types.Array(types.float32, 2, "C")
_FOG = types.Array(types.uint8, 1, "C")
_LINE_PX = 2.0  # width of the arc at the reading
_AT_SENSOR, _AT_RANGE, _ON_ARC = 0.55, 0.12, 0.9  # opacities


@cache
def compiled(function: Callable[..., None]) -> Callable[..., None]:
    """Compile a loop of this module."""
    signatures = {
        compose: types.void(PIXELS, _FOG, PIXELS, DEPTHS, FLOATS, DEPTHS),
        blend: types.void(FLOATS, DEPTHS, types.Array(types.int64, 1, "C"), A2, A1, A1, A1),
    }
    return compile_rule(function, signatures[function])


def compose(
    floor: Pixels, fog: Pixels, solids: Pixels, nearness: Floats, picture: Floats, depth: Floats
) -> None:
    """Put solids (2 h, 2 w, 3) on a floor (h, w, 3) in fog (h,), and fill ``picture``, ``depth``.

    The solids have a white background, where ``nearness`` is 0.
    """
    for row in range(picture.shape[0]):
        mist = int(fog[row])
        for column in range(picture.shape[1]):
            solid, y, x = 0, 2 * row, 2 * column
            for i in range(4):
                solid += nearness[y + i // 2, x + i % 2] > 0.0
            depth[row, column] = 1.0 / nearness[y + 1, x + 1]
            for channel in range(3):
                colour = ground = 0
                for i in range(4):
                    colour += int(solids[y + i // 2, x + i % 2, channel])
                if solid < 4:
                    ground = int(floor[row, column, channel])
                    ground += (mist * (HORIZON[channel] - ground) + 127) // 255
                colour = (colour + 2) // 4
                if solid > 0:
                    ground = max(0, colour - (255 - ground) * (4 - solid) // 4)
                picture[row, column, channel] = ground


def blend(
    picture: Floats,
    depth: Floats,
    box: NDArray[Any],
    plane: Array,
    shape: Array,
    reach: Array,
    colour: Array,
) -> None:
    """Blend a fan into the pixels of a box (top, bottom, left, right) where it is nearest.

    ``plane`` maps (column, row, 1) to (x, y, 1) / depth [m] in the fan's plane; ``shape`` has half
    the field of view [rad], the range [m], the pixels per radian, and the height of a point in the
    plane as factors of x, y and 1; ``reach`` has the readings [m] of equal sectors.
    """
    half_rad, range_m, focus = shape[0], shape[1], shape[2]
    sine, cosine, sectors = math.sin(half_rad), math.cos(half_rad), len(reach)
    for row in range(box[0], box[1]):
        for column in range(box[2], box[3]):
            right, down = column + 0.5, row + 0.5
            near = plane[2, 0] * right + plane[2, 1] * down + plane[2, 2]
            if near <= 0.0 or 1.0 / near >= depth[row, column]:
                continue
            x = (plane[0, 0] * right + plane[0, 1] * down + plane[0, 2]) / near
            y = (plane[1, 0] * right + plane[1, 1] * down + plane[1, 2]) / near
            if shape[3] * x + shape[4] * y + shape[5] <= 0.0:
                continue
            sector = 0
            if sectors > 1:
                share = (math.atan2(y, x) + half_rad) / (2.0 * half_rad)
                sector = min(max(math.floor(share * sectors), 0), sectors - 1)
            distance, scale = math.hypot(x, y), focus * near
            left = reach[sector] - distance
            inside = min(x * sine - abs(y) * cosine, left)
            alpha = min(max(inside * scale + 0.5, 0.0), 1.0)
            opacity = _AT_SENSOR + (_AT_RANGE - _AT_SENSOR) * min(distance / range_m, 1.0)
            if reach[sector] < range_m:
                arc = min(max(_LINE_PX + 0.5 - left * scale, 0.0), 1.0)
                opacity = max(opacity, _ON_ARC * arc)
            alpha *= opacity
            for channel in range(3):
                shown = picture[row, column, channel]
                picture[row, column, channel] = shown + (colour[channel] - shown) * alpha
