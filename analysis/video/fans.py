"""Fans of sensors in a picture: translucent, and hidden by nearer objects."""

from typing import NamedTuple

import numpy as np

from evoros.base.arrays import Array

from .camera import NEAR_M, Camera, Floats

_ARC = 13  # points on the arc of a fan's bounding box
_LINE_PX = 2.0  # width of the arc at the reading
_AT_SENSOR, _AT_RANGE, _ON_ARC = 0.55, 0.12, 0.9  # opacity


class Fan(NamedTuple):
    """The field of view of a sensor, in the x-y plane of its frame, about x."""

    frame: Array  # (4, 4) of the sensor in the world
    half_rad: float  # half its opening
    reach_m: Array  # (k,) its readings, from the right edge to the left, in equal sectors
    range_m: float
    colour: tuple[int, int, int]


def blend_fan(picture: Floats, depth: Floats, camera: Camera, fan: Fan) -> None:
    """Draw a fan into ``picture`` (h, w, 3) where it is nearer than ``depth`` (h, w) [m]."""
    plane = camera.plane(fan.frame)
    box = _bounding_box(plane, fan, camera.size)
    if box is None or abs(np.linalg.det(plane)) < 1e-9:  # invisible, or seen from its edge
        return
    rows, columns = box
    x, y = np.arange(columns.start, columns.stop) + 0.5, np.arange(rows.start, rows.stop) + 0.5
    inverse = np.linalg.inv(plane).astype(np.float32)
    u, v, nearness = (
        inverse[i, 0] * x.astype(np.float32)[None] + (inverse[i, 1] * y + inverse[i, 2])[:, None]
        for i in range(3)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.where(nearness > 0, 1.0 / nearness, np.float32(np.inf)).astype(np.float32)
    u, v = u * far, v * far
    height = fan.frame[2, 0] * u + fan.frame[2, 1] * v + fan.frame[2, 3]
    visible = (far < depth[box]) & (height > 0.0)
    alpha = np.where(visible, _opacity(u, v, camera.pixels_per_radian / far, fan), 0.0)
    part = picture[box]
    part += (np.array(fan.colour, np.float32) - part) * alpha.astype(np.float32)[..., None]


def _opacity(u: Floats, v: Floats, scale: Floats, fan: Fan) -> Floats:
    """Return the opacity (h, w) at points u, v [m] of the plane; ``scale`` in pixels per metre."""
    distance, reach = np.hypot(u, v), _reach_at(u, v, fan)
    inside = u * np.sin(fan.half_rad) - np.abs(v) * np.cos(fan.half_rad)
    cover = np.clip(np.minimum(inside, reach - distance) * scale + 0.5, 0.0, 1.0)
    share = np.clip(distance / fan.range_m, 0.0, 1.0)
    fill = _AT_SENSOR + (_AT_RANGE - _AT_SENSOR) * share
    if (fan.reach_m >= fan.range_m).all():
        return np.asarray(cover * fill, dtype=np.float32)
    line = np.clip(_LINE_PX + 0.5 - (reach - distance) * scale, 0.0, 1.0) * (reach < fan.range_m)
    return np.asarray(cover * np.maximum(fill, _ON_ARC * line), dtype=np.float32)


def _reach_at(u: Floats, v: Floats, fan: Fan) -> Floats:
    """Return the reading [m] of the sector in which each point u, v [m] is."""
    count = len(fan.reach_m)
    if count == 1:
        return np.full(u.shape, fan.reach_m[0], dtype=np.float32)
    with np.errstate(invalid="ignore"):
        share = (np.arctan2(v, u) + fan.half_rad) / (2.0 * fan.half_rad)
        sector = np.nan_to_num(np.floor(share * count)).clip(0, count - 1).astype(int)
    return np.asarray(fan.reach_m[sector], dtype=np.float32)


def _bounding_box(plane: Array, fan: Fan, size: tuple[int, int]) -> tuple[slice, slice] | None:
    """Return the rows and columns of the picture that contain the fan; None: it is invisible."""
    angles = np.linspace(-fan.half_rad, fan.half_rad, _ARC)
    # A margin, because the arc bulges between its points.
    reach = (1.04 if fan.half_rad > 1.0 else 1.03) * float(fan.reach_m.max())
    arc = [[reach * np.cos(a), reach * np.sin(a), 1.0] for a in angles]
    corners = np.array([[0.0, 0.0, 1.0], *arc]) @ plane.T
    points = _clip_to_front(corners)
    if not len(points):
        return None
    low = np.floor(points.min(axis=0) - 2).astype(int).clip(0, size)
    high = np.ceil(points.max(axis=0) + 2).astype(int).clip(0, size)
    if (low >= high).any():
        return None
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))


def _clip_to_front(corners: Array) -> Array:
    """Return columns and rows (k, 2) of the part of a polygon (n, 3) in front of the camera."""
    clipped = []
    for corner, following in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if corner[2] >= NEAR_M:
            clipped.append(corner)
        if (corner[2] >= NEAR_M) != (following[2] >= NEAR_M):
            share = (NEAR_M - corner[2]) / (following[2] - corner[2])
            clipped.append(corner + share * (following - corner))
    points = np.array(clipped).reshape(-1, 3)
    return np.asarray(points[:, :2] / points[:, 2:])
