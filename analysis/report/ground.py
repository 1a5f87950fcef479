"""Robots, courses, obstacles and trajectories as data for the player of a report."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.geometry.footprint import project_shape, top_height
from evoros.sensor.protocol import CONTACT
from evoros.storage.figure_context import FigureContext
from evoros.world.course import Course
from evoros.world.model import World
from evoros.world.standing import standing_obstacles

from ..tables.readings import list_channels

Json = dict[str, Any]
MARGIN_M = 0.5  # margin around the drawing
MAX_RECORDS = 6000
"""Maximum number of samples of a mission; longer ones are thinned out evenly."""


def encode_parts(context: FigureContext) -> list[Json]:
    """Encode a robot's shapes from above, lowest first."""
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
    """Yield the shapes of the obstacles in drawing order, from the lowest top up."""
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
    """Return x and y of the drawing's lower left and upper right corners [m]."""
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


def thin_out(records: int, most: int = MAX_RECORDS) -> list[int]:
    """Choose at most ``most`` rows, evenly, including the first and the last."""
    places = np.linspace(0, records - 1, min(records, most))
    return [round(place) for place in places.tolist()]


def encode_place(sensor: Mapping[Any, Any]) -> dict[str, Any]:
    """Encode type, number and place of a sensor from its row."""
    return {
        "type": str(sensor["type"]),
        "number": int(sensor["sensor"]),
        "x": round(sensor["x_m"], 4),
        "y": round(sensor["y_m"], 4),
        "yaw": round(math.radians(sensor["yaw_deg"]), 4),
    }


def encode_poses(trajectory: pd.DataFrame) -> dict[str, list[int | None]]:
    """Encode a robot's columns ``x``, ``y`` and ``yaw``."""
    x, y, yaw = (trajectory[name].to_numpy(float) for name in ("x_m", "y_m", "yaw_rad"))
    return {
        "x": encode_numbers(x),
        "y": encode_numbers(y),
        "yaw": encode_numbers(np.unwrap(yaw)),
    }


def encode_numbers(values: Array) -> list[int | None]:
    """Encode a column as integer thousandths of its unit; NaN becomes None."""
    return encode_differences(
        [None if math.isnan(value) else round(value * 1000) for value in values.tolist()]
    )


def encode_differences(values: Sequence[int | None]) -> list[int | None]:
    """Replace each value by its difference from the last known one; None stays."""
    last, differences = 0, list[int | None]()
    for value in values:
        differences.append(None if value is None else value - last)
        last = last if value is None else value
    return differences


def encode_changes(values: Sequence[int | None]) -> list[list[int | None]]:
    """List ``[index, value]`` for the first value and each change."""
    changes = [index for index, (a, b) in enumerate(pairwise(values), 1) if a != b]
    return [[index, values[index]] for index in (0, *changes)] if values else []


def describe_signals(sensors: pd.DataFrame, context: FigureContext) -> Iterator[dict[str, Any]]:
    """Describe place, zone and displayed channels of each sensor that casts no rays."""
    for row in sensors.to_dict("records"):
        signal = context.signals[row["type"]]
        yield {
            **encode_place(row),
            "touches": signal.measures == CONTACT,
            "width": row["width_m"],
            "depth": row["depth_m"],
            "channels": [channel[:2] for channel in list_channels(row["sensor"], signal)],
        }


def encode_signals(
    trajectory: pd.DataFrame, sensors: pd.DataFrame, context: FigureContext
) -> list[list[list[int | None]]]:
    """Encode the displayed readings by sensor and channel, in thousandths of their unit."""
    return [
        [
            encode_numbers(trajectory[column].to_numpy(float))
            for _, _, column in list_channels(sensor, context.signals[kind])
        ]
        for sensor, kind in zip(sensors["sensor"].tolist(), sensors["type"], strict=True)
    ]
