"""Robots, courses and obstacles from above, as data that the page of a report draws."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.geometry.footprint import project_shape, top_height
from evoros.storage.figure_context import FigureContext
from evoros.world.course import Course
from evoros.world.model import World
from evoros.world.standing import standing_obstacles

from .columns import encode_place

Json = dict[str, Any]
MARGIN_M = 0.5  # around everything that is drawn


def encode_parts(context: FigureContext) -> list[Json]:
    """Encode the shapes of a robot from above, the lowest first."""
    return [
        {**_encode_shape(part.vertices, part.radius_m), "wheel": part.wheel}
        for part in sorted(context.parts, key=lambda part: part.top_m)
    ]


def encode_sensors(table: pd.DataFrame) -> Iterator[Json]:
    """Encode the place and the cone of each sensor."""
    for row in table.to_dict("records"):
        yield {
            **encode_place(row),
            "level": round(math.cos(math.radians(row["pitch_deg"])), 4),
            "fov": round(math.radians(row["fov_deg"]), 4),
            "range": row["range_m"],
            "pair": int(row["pair"]),
        }


def encode_obstacles(world: World) -> Iterator[Json]:
    """Yield the shapes of the obstacles from the lowest top on, in the order of drawing."""
    placed = [
        (shape, body.pose @ shape.pose)
        for body in standing_obstacles(world)
        for shape in body.shapes
    ]
    for shape, pose in sorted(placed, key=lambda pair: top_height(*pair)):
        area = project_shape(shape, pose)
        yield _encode_shape(area.vertices, area.radius)


def _encode_shape(vertices: Iterable[Sequence[float]], radius_m: float) -> Json:
    corners = [[round(float(x), 4), round(float(y), 4)] for x, y in vertices]
    return {"vertices": corners, "radius": round(float(radius_m), 4)}


def encode_course(course: Course) -> Json:
    """Encode the home and the waypoints."""
    return {
        "home": list(course.home[:2]),
        "waypoints": [list(point) for point in course.waypoints],
        "acceptance_m": course.acceptance_m,
    }


def find_extent(places: Array, course: Course, obstacles: Sequence[Json]) -> list[float]:
    """Return x and y of the lower left and the upper right corner [m]."""
    corners = np.array([course.home[:2], *course.waypoints])
    solid = [
        np.array(shape["vertices"]) + sign * shape["radius"]
        for shape in obstacles
        for sign in (-1, 1)
    ]
    reach = course.acceptance_m
    points = np.concatenate([places, corners - reach, corners + reach, *solid])
    low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    return [round(float(value), 3) for value in (*low, *high)]
