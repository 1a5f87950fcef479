"""Sensor cones and robot outlines in top view, in the robot's frame (x forward, y left)."""

import math
from collections.abc import Iterable

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.geometry.footprint import convex_hull
from evoros.storage.figure_context import FigureContext, Part

Window = tuple[float, float, float, float]  # minimum x, maximum x, minimum y and maximum y [m]
CONE = ["x_m", "y_m", "yaw_deg", "fov_deg", "range_m"]
_CORNERS = 96  # number of corners of a full circle
_ZONE_MARGIN_M = 0.02  # depth [m] of a bumper's contact zone beyond the robot


def outline_part(part: Part) -> Array:
    """Return the corners (k, 2) [m] of the area covered by a part."""
    return dilate(np.array(part.vertices), part.radius_m)


def dilate(vertices: Array, radius_m: float) -> Array:
    """Return the corners (k, 2) [m] of a convex polygon (n, 2) dilated by a radius."""
    if radius_m == 0.0:  # shortcut for large worlds with thousands of boxes
        return vertices
    turn = np.linspace(0.0, 2 * math.pi, _CORNERS, endpoint=False)
    rim = radius_m * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    swept: Array = (vertices[:, None] + rim).reshape(-1, 2)
    return convex_hull(swept)


def trace_cones(sensors: pd.DataFrame, reach_m: float = math.inf) -> list[Array]:
    """Return the cone (k, 2) [m] of each sensor, cut off at ``reach_m``, without its pitch."""
    return [
        trace_sector(x, y, yaw, fov, min(range_m, reach_m))
        for x, y, yaw, fov, range_m in sensors[CONE].to_numpy(dtype=np.float64).tolist()
    ]


def trace_sector(
    x_m: float, y_m: float, yaw_deg: float, width_deg: float, radius_m: float
) -> Array:
    """Return the tip and the arc (k, 2) [m] of a sector about ``yaw_deg``, right to left."""
    count = 2 + math.ceil(width_deg / 360 * _CORNERS)
    angles = np.radians(yaw_deg + np.linspace(-width_deg / 2, width_deg / 2, count))
    arc = radius_m * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    sector: Array = np.array([x_m, y_m]) + np.vstack([[0.0, 0.0], arc])
    return sector


def trace_zone(
    place: tuple[float, float],
    yaw_deg: float,
    width_m: float,
    depth_m: float,
    context: FigureContext,
) -> Array:
    """Return the corners (4, 2) [m] of a bumper's contact zone, cut just beyond the robot."""
    yaw, half = math.radians(yaw_deg), width_m / 2
    ahead = np.array([math.cos(yaw), math.sin(yaw)])
    left = np.array([-ahead[1], ahead[0]])
    points = np.vstack([outline_part(part) for part in context.parts]) - np.array(place)
    reach = max(float((points @ ahead).max()), 0.0) + _ZONE_MARGIN_M
    corners = [(-depth_m, half), (reach, half), (reach, -half), (-depth_m, -half)]
    zone: Array = np.array([np.array(place) + x * ahead + y * left for x, y in corners])
    return zone


def find_covered(sensors: pd.DataFrame, x: Array, y: Array, cell_m: float, reach_m: float) -> Array:
    """Return a mask of points x, y [m] inside any sensor's cone; single rays are a cell wide."""
    covered = np.zeros(x.shape, dtype=bool)
    for sensor_x, sensor_y, yaw, fov, range_m in sensors[CONE].to_numpy(dtype=np.float64).tolist():
        dx, dy = x - sensor_x, y - sensor_y
        near = ~covered & (np.hypot(dx, dy) <= min(range_m, reach_m))
        dx, dy = dx[near], dy[near]
        cos, sin = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
        forward, aside = cos * dx + sin * dy, np.abs(cos * dy - sin * dx)
        angle = np.degrees(np.arctan2(aside, forward))
        on_axis = (forward >= 0) & (aside <= cell_m / 2)
        covered[near] = (angle <= fov / 2 + 1e-9) | on_axis
    return covered


def fit_window(
    contexts: Iterable[FigureContext], sensors: pd.DataFrame, reach_m: float, margin_m: float = 0.03
) -> Window:
    """Return a window around robots and cones that is symmetric about the x axis."""
    outlines = [outline_part(part) for context in contexts for part in context.parts]
    points = np.vstack([*outlines, *trace_cones(sensors, reach_m), np.zeros((1, 2))])
    (x_low, _), (x_high, _) = points.min(axis=0), points.max(axis=0)
    y = float(np.abs(points[:, 1]).max()) + margin_m
    return float(x_low) - margin_m, float(x_high) + margin_m, -y, y


def robot_length(context: FigureContext) -> float:
    """Return the length of the robot [m]."""
    x = np.concatenate([outline_part(part)[:, 0] for part in context.parts])
    return float(np.ptp(x))
