"""Sensors' fans in a picture: translucent, and hidden by what is nearer to the camera."""

from typing import NamedTuple

import numpy as np

from evoros.base.arrays import Array

from .camera import Camera, Floats

NEAR_M = 0.05  # of what is nearer to the camera nothing is drawn
_ARC = 13  # points of the arc that bounds a fan
_LINE_PX = 2.0  # of the arc on which the echo lies
_MOST, _LEAST, _ARC_LINE = 0.55, 0.12, 0.9  # opacity at the sensor, at its range, of the line


class Fan(NamedTuple):
    """What a sensor sees, in the x-y plane of its frame, about x."""

    frame: Array  # (4, 4): of the sensor in the world
    half_rad: float  # half its opening
    reach_m: float  # its reading
    range_m: float  # its greatest
    colour: tuple[int, int, int]


def blend(picture: Floats, depth: Floats, camera: Camera, fan: Fan) -> None:
    """Draw a fan into ``picture`` (h, w, 3) float, where it is nearer than ``depth`` (h, w) [m]."""
    plane = camera.plane(fan.frame)
    box = _box(plane, fan, camera.size)
    if box is None or abs(np.linalg.det(plane)) < 1e-9:  # the second: seen from its edge
        return
    rows, columns = box
    x, y = np.arange(columns.start, columns.stop) + 0.5, np.arange(rows.start, rows.stop) + 0.5
    inverse = np.linalg.inv(plane).astype(np.float32)
    u, v, near = (
        inverse[i, 0] * x.astype(np.float32)[None] + (inverse[i, 1] * y + inverse[i, 2])[:, None]
        for i in range(3)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.where(near > 0, 1.0 / near, np.float32(np.inf)).astype(np.float32)
    u, v = u * far, v * far
    height = fan.frame[2, 0] * u + fan.frame[2, 1] * v + fan.frame[2, 3]
    seen = (far < depth[box]) & (height > 0.0)
    alpha = np.where(seen, _opacity(u, v, camera.pixels_per_radian / far, fan), 0.0)
    part = picture[box]
    part += (np.array(fan.colour, np.float32) - part) * alpha.astype(np.float32)[..., None]


def _opacity(u: Floats, v: Floats, scale: Floats, fan: Fan) -> Floats:
    """(h, w): of points u, v [m] of the fan's plane, with edges that are smooth over a pixel."""
    away = np.hypot(u, v)
    inside = u * np.sin(fan.half_rad) - np.abs(v) * np.cos(fan.half_rad)
    cover = np.clip(np.minimum(inside, fan.reach_m - away) * scale + 0.5, 0.0, 1.0)
    share = np.clip(away / fan.range_m, 0.0, 1.0)
    fill = _MOST + (_LEAST - _MOST) * share
    if fan.reach_m >= fan.range_m:
        return np.asarray(cover * fill, dtype=np.float32)
    line = np.clip(_LINE_PX + 0.5 - (fan.reach_m - away) * scale, 0.0, 1.0)
    return np.asarray(cover * np.maximum(fill, _ARC_LINE * line), dtype=np.float32)


def _box(plane: Array, fan: Fan, size: tuple[int, int]) -> tuple[slice, slice] | None:
    """Rows and columns of the picture outside of which nothing of the fan is."""
    angles = np.linspace(-fan.half_rad, fan.half_rad, _ARC)
    # A little farther out: the arc bulges between its points.
    reach = 1.03 * fan.reach_m
    arc = [[reach * np.cos(a), reach * np.sin(a), 1.0] for a in angles]
    corners = np.array([[0.0, 0.0, 1.0], *arc]) @ plane.T
    points = _in_front(corners)
    if not len(points):
        return None
    low = np.floor(points.min(axis=0) - 2).astype(int).clip(0, size)
    high = np.ceil(points.max(axis=0) + 2).astype(int).clip(0, size)
    if (low >= high).any():
        return None
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))


def _in_front(corners: Array) -> Array:
    """(k, 2): columns and rows of a polygon (n, 3), cut off where it is behind the camera."""
    kept = []
    for this, following in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if this[2] >= NEAR_M:
            kept.append(this)
        if (this[2] >= NEAR_M) != (following[2] >= NEAR_M):
            share = (NEAR_M - this[2]) / (following[2] - this[2])
            kept.append(this + share * (following - this))
    points = np.array(kept).reshape(-1, 3)
    return np.asarray(points[:, :2] / points[:, 2:])
