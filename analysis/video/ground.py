"""The ground of a replay, painted from above: grid, course, shadows, the path driven so far."""

import math
from collections.abc import Iterable, Iterator, Sequence
from copy import copy

import numpy as np
from PIL import Image, ImageChops, ImageDraw, ImageFilter

from evoros.base.arrays import Array
from evoros.geometry.footprint import convex_hull, project_shape, top_height
from evoros.geometry.shapes import Body
from evoros.storage.figure_context import Part

from ..drawing.robot import hull, outline
from .camera import Camera, Pixels

Colour = tuple[int, int, int]
Pixel = tuple[int, int]
FLOOR, GRID, SHADOW, HORIZON = (236, 234, 229), (216, 214, 208), (96, 98, 106), (246, 246, 244)
TRACK, RING, GOAL = (120, 120, 125), (150, 150, 150), (0, 158, 115)
_SUN = np.array([-0.16, -0.10])  # by how much shadows are longer than what casts them is high
FOG_M = (10.0, 40.0)  # depths from which and at which the ground is lost in the horizon
_MOST_PX = 1600  # of a side: what is larger is painted coarser
_FINEST_PX = 120.0  # pixels per metre
_SHADE = 0.42  # opacity of shadows
_SMOOTH = 4  # each stroke is painted so many times as large


class Ground:
    """A picture of the ground with ``scale`` pixels per metre, x to the right and y up."""

    def __init__(self, low: Array, high: Array, bodies: Sequence[Body]) -> None:
        self._low, self._high = low, high
        self.scale = min(_FINEST_PX, _MOST_PX / float(np.max(high - low)))
        size = [math.ceil(length * self.scale) for length in high - low]
        self._picture = Image.new("RGB", (size[0], size[1]), FLOOR)
        for axis in (0, 1):
            for at in range(math.ceil(low[axis]), math.floor(high[axis]) + 1):
                ends = np.array([low, high])
                ends[:, axis] = at
                self.line(ends, GRID, 0.02)
        self._shade([shadow for body in bodies for shadow in _shadows(body)])
        self._track = Image.new("L", self._picture.size)
        self._before: Image.Image | None = None  # without the track

    def copy(self) -> "Ground":
        """Another one, to be painted on."""
        other = copy(self)
        other._picture = self._picture.copy()
        return other

    def line(self, points: Array, colour: Colour, width_m: float) -> None:
        """Through points (n, 2) [m]."""
        corner, mask = self._drawn(points, width_m)
        self._picture.paste(colour, corner, mask)

    def track(self, points: Array, width_m: float) -> None:
        """Lengthen the path so far; nothing but paths is painted after this, but on copies.

        Where pieces of it meet it is no darker than elsewhere.
        """
        self._before = self._before or self._picture.copy()
        corner, mask = self._drawn(points, width_m)
        box = (*corner, corner[0] + mask.width, corner[1] + mask.height)
        whole = ImageChops.lighter(self._track.crop(box), mask)
        self._track.paste(whole, corner)
        self._picture.paste(self._before.crop(box), corner)
        self._picture.paste(TRACK, corner, whole)

    def _drawn(self, points: Array, width_m: float) -> tuple[Pixel, Image.Image]:
        """A line as a mask, and its place."""
        corner, mask = self._mask(points, width_m, _SMOOTH)
        width = max(1, round(width_m * self.scale * _SMOOTH))
        at = self._at(points, corner, _SMOOTH)
        ImageDraw.Draw(mask).line(at, fill=255, width=width, joint="curve")
        return corner, mask.reduce(_SMOOTH)

    def ring(self, center: Sequence[float], radius_m: float, colour: Colour, width: float) -> None:
        """A circle as a line of this width [m]."""
        turn = np.linspace(0.0, 2 * math.pi, 97)
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        self.line(np.array(center) + radius_m * circle, colour, width)

    def shadow(self, parts: Iterable[Part], x: float, y: float, yaw: float) -> None:
        """Of a robot."""
        cos, sin = math.cos(yaw), math.sin(yaw)
        turn = np.array([[cos, sin], [-sin, cos]])
        self._shade([_shadow(outline(part) @ turn + (x, y), part.top_m) for part in parts])

    def seen(self, camera: Camera) -> Image.Image:
        """As a camera sees it, lost in the horizon far away, and with the sky above."""
        scale = self.scale
        # From pixels of this picture to those of the camera's.
        frame = np.eye(4)
        to_metres = np.array(
            [[1 / scale, 0.0, self._low[0]], [0.0, -1 / scale, self._high[1]], [0.0, 0.0, 1.0]]
        )
        inverse = np.linalg.inv(camera.plane(frame) @ to_metres)
        data = (inverse / inverse[2, 2]).ravel()[:8].tolist()
        seen = self._picture.transform(
            camera.size,
            Image.Transform.PERSPECTIVE,
            data,
            Image.Resampling.BILINEAR,
            fillcolor=FLOOR,
        )
        fog = Image.fromarray(_fog(camera)[:, None]).resize(camera.size)
        seen.paste(HORIZON, mask=fog)
        return seen

    def _shade(self, shadows: Sequence[Array]) -> None:
        """Darken what is in any of these polygons (n, 2) [m], not twice what is in two."""
        if not shadows:
            return
        corner, mask = self._mask(np.vstack(shadows), 0.1, 1)
        draw = ImageDraw.Draw(mask)
        for shadow in shadows:
            draw.polygon(self._at(shadow, corner, 1), fill=round(255 * _SHADE))
        self._picture.paste(SHADOW, corner, mask.filter(ImageFilter.GaussianBlur(1.5)))

    def _mask(self, points: Array, margin_m: float, factor: int) -> tuple[Pixel, Image.Image]:
        """An empty mask around points [m], ``factor`` times as large, and its place: top left."""
        pixels = np.array(self._at(points, (0, 0), 1))
        margin = margin_m * self.scale + 2
        corner = np.floor(pixels.min(axis=0) - margin).clip(0, self._picture.size)
        end = np.ceil(pixels.max(axis=0) + margin).clip(corner, self._picture.size)
        wide, high = ((end - corner) * factor).astype(int).tolist()
        return (int(corner[0]), int(corner[1])), Image.new(
            "L", (max(wide, factor), max(high, factor))
        )

    def _at(self, points: Array, corner: Pixel, factor: int) -> list[tuple[float, float]]:
        """Points (n, 2) [m] in a mask that begins at ``corner``."""
        right = (points[:, 0] - self._low[0]) * self.scale - corner[0]
        down = (self._high[1] - points[:, 1]) * self.scale - corner[1]
        return list(zip((right * factor).tolist(), (down * factor).tolist(), strict=True))


def _fog(camera: Camera) -> Pixels:
    """(h,): how much of the ground is lost in each row, of 255; all where the sky is."""
    width, height = camera.size
    inverse = np.linalg.inv(camera.plane(np.eye(4)))
    rows = np.arange(height) + 0.5
    near = inverse[2, 0] * width / 2 + inverse[2, 1] * rows + inverse[2, 2]  # 1 / depth [m]
    depth = 1.0 / np.maximum(near, 1e-9)
    if depth.min() > FOG_M[0]:  # seen from afar
        return np.zeros(height, np.uint8)
    share = np.clip((depth - FOG_M[0]) / (FOG_M[1] - FOG_M[0]), 0.0, 1.0)
    fog: Pixels = np.round(255 * share).astype(np.uint8)
    return fog


def _shadow(covered: Array, top_m: float) -> Array:
    """Of what covers a hull (n, 2) [m] of the ground: drawn away from the light."""
    return convex_hull(np.vstack([covered, covered - top_m * _SUN]))


def _shadows(body: Body) -> Iterator[Array]:
    for shape in body.shapes:
        pose = body.pose @ shape.pose
        top = top_height(shape, pose)
        if top > 0.0:
            area = project_shape(shape, pose)
            yield _shadow(hull(area.vertices, area.radius), top)
