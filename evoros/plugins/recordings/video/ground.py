"""The ground of a video, painted in top view: grid, course, shadows and path."""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from PIL import Image, ImageChops, ImageDraw, ImageFilter

from evoros.analysis.designs.cones import dilate, outline_part
from evoros.base.arrays import Array
from evoros.geometry.footprint import convex_hull, project_shape, top_height
from evoros.geometry.shapes import Body
from evoros.plugins.recordings.video.camera import Camera, Pixels
from evoros.storage.figure_context import Part

Colour = tuple[int, int, int]
Pixel = tuple[int, int]
FLOOR, GRID, SHADOW, HORIZON = (236, 234, 229), (216, 214, 208), (96, 98, 106), (246, 246, 244)
TRACK, RING, GOAL = (120, 120, 125), (150, 150, 150), (0, 158, 115)
_SUN = np.array([-0.16, -0.10])  # horizontal offset towards the light, per unit of height
FOG_M = (10.0, 40.0)  # depths at which fog begins and at which it hides the ground
_MAX_PX = 1600  # maximum side length; larger areas are painted at a lower resolution
_MAX_SCALE = 120.0  # pixels per metre
_SHADE = 0.42  # opacity of shadows
_SMOOTH = 4  # oversampling factor of strokes


class Ground:
    """A picture of the ground at ``scale`` [px/m]; x points right and y up."""

    def __init__(self, low: Array, high: Array, bodies: Sequence[Body]) -> None:
        self._low, self._high = low, high
        self.scale = min(_MAX_SCALE, _MAX_PX / float(np.max(high - low)))
        size = [math.ceil(length * self.scale) for length in high - low]
        self._picture = Image.new("RGB", (size[0], size[1]), FLOOR)
        self._covered: list[tuple[Pixel, Image.Image]] | None = None
        for axis in (0, 1):
            for position in range(math.ceil(low[axis]), math.floor(high[axis]) + 1):
                ends = np.array([low, high])
                ends[:, axis] = position
                self.draw_line(ends, GRID, 0.02)
        self._darken([shadow for body in bodies for shadow in _body_shadows(body)])
        self._track = Image.new("L", self._picture.size)
        self._without_track: Image.Image | None = None

    @contextmanager
    def painted(self) -> Iterator[None]:
        """Restore the picture at the end of the context."""
        self._covered = []
        try:
            yield
        finally:
            for corner, before in reversed(self._covered):
                self._picture.paste(before, corner)
            self._covered = None

    def _paint(self, colour: Colour, corner: Pixel, mask: Image.Image) -> None:
        if self._covered is not None:
            box = (*corner, corner[0] + mask.width, corner[1] + mask.height)
            self._covered.append((corner, self._picture.crop(box)))
        self._picture.paste(colour, corner, mask)

    def draw_line(self, points: Array, colour: Colour, width_m: float) -> None:
        """Draw a line along points (n, 2) [m]."""
        self._paint(colour, *self._draw_mask(points, width_m))

    def extend_track(self, points: Array, width_m: float) -> None:
        """Extend the path without darker overlaps; paint anything else on copies only."""
        self._without_track = self._without_track or self._picture.copy()
        corner, mask = self._draw_mask(points, width_m)
        box = (*corner, corner[0] + mask.width, corner[1] + mask.height)
        whole = ImageChops.lighter(self._track.crop(box), mask)
        self._track.paste(whole, corner)
        self._picture.paste(self._without_track.crop(box), corner)
        self._picture.paste(TRACK, corner, whole)

    def _draw_mask(self, points: Array, width_m: float) -> tuple[Pixel, Image.Image]:
        corner, mask = self._make_mask(points, width_m, _SMOOTH)
        width = max(1, round(width_m * self.scale * _SMOOTH))
        pixels = self._to_pixels(points, corner, _SMOOTH)
        ImageDraw.Draw(mask).line(pixels, fill=255, width=width, joint="curve")
        return corner, mask.reduce(_SMOOTH)

    def draw_ring(
        self, center: Sequence[float], radius_m: float, colour: Colour, width_m: float
    ) -> None:
        """Draw a circle."""
        turn = np.linspace(0.0, 2 * math.pi, 97)
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        self.draw_line(np.array(center) + radius_m * circle, colour, width_m)

    def draw_shadow(self, parts: Iterable[Part], x: float, y: float, yaw: float) -> None:
        """Draw the shadow of a robot."""
        cos, sin = math.cos(yaw), math.sin(yaw)
        turn = np.array([[cos, sin], [-sin, cos]])
        self._darken([_shadow(outline_part(part) @ turn + (x, y), part.top_m) for part in parts])

    def project(self, camera: Camera) -> tuple[Pixels, Pixels]:
        """Return the ground (h, w, 3) as seen by the camera, and the fog (h,) in front of it."""
        scale = self.scale
        to_metres = np.array(
            [[1 / scale, 0.0, self._low[0]], [0.0, -1 / scale, self._high[1]], [0.0, 0.0, 1.0]]
        )
        inverse = np.linalg.inv(camera.plane(np.eye(4)) @ to_metres)
        data = (inverse / inverse[2, 2]).ravel()[:8].tolist()
        kind, smooth = Image.Transform.PERSPECTIVE, Image.Resampling.BILINEAR
        view = self._picture.transform(camera.size, kind, data, smooth, fillcolor=FLOOR)
        return np.array(view), _fog(camera)

    def _darken(self, shadows: Sequence[Array]) -> None:
        if not shadows:
            return
        corner, mask = self._make_mask(np.vstack(shadows), 0.1, 1)
        draw = ImageDraw.Draw(mask)
        for shadow in shadows:
            draw.polygon(self._to_pixels(shadow, corner, 1), fill=round(255 * _SHADE))
        self._paint(SHADOW, corner, mask.filter(ImageFilter.GaussianBlur(1.5)))

    def _make_mask(self, points: Array, margin_m: float, factor: int) -> tuple[Pixel, Image.Image]:
        """Return a mask around points [m], ``factor`` times finer, and its top left pixel."""
        pixels = np.array(self._to_pixels(points, (0, 0), 1))
        margin = margin_m * self.scale + 2
        corner = np.floor(pixels.min(axis=0) - margin).clip(0, self._picture.size)
        end = np.ceil(pixels.max(axis=0) + margin).clip(corner, self._picture.size)
        width, height = ((end - corner) * factor).astype(int).tolist()
        size = max(width, factor), max(height, factor)
        return (int(corner[0]), int(corner[1])), Image.new("L", size)

    def _to_pixels(self, points: Array, corner: Pixel, factor: int) -> list[tuple[float, float]]:
        right = (points[:, 0] - self._low[0]) * self.scale - corner[0]
        down = (self._high[1] - points[:, 1]) * self.scale - corner[1]
        return list(zip((right * factor).tolist(), (down * factor).tolist(), strict=True))


def _fog(camera: Camera) -> Pixels:
    """Return the fog opacity (h,) of each row, 0 to 255 (opaque, as in the sky)."""
    width, height = camera.size
    inverse = np.linalg.inv(camera.plane(np.eye(4)))
    rows = np.arange(height) + 0.5
    nearness = inverse[2, 0] * width / 2 + inverse[2, 1] * rows + inverse[2, 2]  # 1 / depth [m]
    depth = 1.0 / np.maximum(nearness, 1e-9)
    if depth.min() > FOG_M[0]:  # overhead camera
        return np.zeros(height, np.uint8)
    share = np.clip((depth - FOG_M[0]) / (FOG_M[1] - FOG_M[0]), 0.0, 1.0)
    return np.asarray(np.round(255 * share).astype(np.uint8))


def _shadow(covered: Array, top_m: float) -> Array:
    """Return the shadow of a prism with a convex polygon (n, 2) [m] as its base."""
    return convex_hull(np.vstack([covered, covered - top_m * _SUN]))


def _body_shadows(body: Body) -> Iterator[Array]:
    for shape, pose in body.placed:
        top = top_height(shape, pose)
        if top > 0.0:
            area = project_shape(shape, pose)
            yield _shadow(dilate(area.vertices, area.radius), top)
