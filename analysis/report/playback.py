"""A champion's missions as the compact data that the page of a report plays.

Positions and readings are whole millimetres, times milliseconds, angles milliradians, each column
as differences from record to record, or as ``[record, value]`` where it changes: short numbers.
"""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.geometry.footprint import project_shape, top_height
from evoros.world.course import Course
from evoros.world.model import World

from ..tables.designs import champion_sensors
from ..tables.records import Record
from ..tables.study import Study
from ..tables.tracks import NONE, champions_mission, champions_worlds, failures

RECORDS = 6000
"""Of a mission at most; of a longer one as many are left out between any two."""
MARGIN_M = 0.5  # around all that is drawn
Json = dict[str, Any]


def playbacks(study: Study, most: float) -> dict[str, str]:
    """What the page plays, by the name of the run.

    That is the best run of each treatment, then the others from the best on, as far as they fit
    into ``most`` bytes together.
    """
    ranked = study.ranked if any(record.finished for record in study.records) else ()
    best = {record.treatment: record for record in reversed(ranked)}
    first = [best[treatment] for treatment in study.treatments if treatment in best]
    found: dict[str, str] = {}
    for record, data in study.each(dict.fromkeys([*first, *ranked]), playback):
        left = most - sum(map(len, found.values()))
        if record in first or len(data) <= left:
            found[record.name] = data
        elif left <= 0:
            break
    return found


def playback(record: Record) -> str:
    """The missions of a finished run's champion, as JSON that may stand in a ``<script>``.

    Raises:
        InputError: a file of the champion is missing or damaged.
    """
    setting = record.setting
    worlds = champions_worlds(record.run, setting)
    flown = {name: record.run.trajectory(name) for name in worlds}
    if not any(len(table) for table in flown.values()):
        raise InputError(f"{record.path / 'champion'}: none of its missions could be flown")
    content = {
        "run": record.name,
        "parts": [
            {**_shape(part.vertices, part.radius_m), "wheel": part.wheel}
            for part in sorted(setting.parts, key=lambda part: part.top_m)
        ],
        "sensors": list(_sensors(champion_sensors(record))),
        "modes": [NONE, *setting.modes],
        "missions": [
            _mission(name, worlds[name], table, champions_mission(record.run, name))
            for name, table in flown.items()
            if len(table)
        ],
    }
    text = json.dumps(content, separators=(",", ":"), ensure_ascii=True)
    return text.replace("<", "\\u003c")  # nothing in it can end the element


def _sensors(table: pd.DataFrame) -> Iterator[Json]:
    for row in table.to_dict("records"):
        yield {
            "type": str(row["type"]),
            "x": round(row["x_m"], 4),
            "y": round(row["y_m"], 4),
            "yaw": round(math.radians(row["yaw_deg"]), 4),
            "level": round(math.cos(math.radians(row["pitch_deg"])), 4),
            "fov": round(math.radians(row["fov_deg"]), 4),
            "range": row["range_m"],
            "pair": int(row["pair"]),
        }


def _mission(name: str, world: World, flown: pd.DataFrame, row: "pd.Series[Any]") -> Json:
    places = flown[["x_m", "y_m"]].to_numpy(float)
    obstacles = list(_obstacles(world))
    return {
        "world": name,
        "summary": _summary(row),
        "goals": len(world.course.route(True)),
        "course": _course(world.course),
        "obstacles": obstacles,
        "extent": _extent(places, world.course, obstacles),
        "failed": [
            {"sensor": sensor, "at_s": round(at, 3), "by": effect}
            for sensor, at, effect in failures(row)
        ],
        "reached": list(_reached(flown, world.course)),
        "collisions": list(_collisions(flown)),
        **_columns(flown.iloc[kept(len(flown))]),
    }


def kept(records: int) -> list[int]:
    """The rows that are kept: all, or evenly ``RECORDS`` of them, the first and last included."""
    return [round(place) for place in np.linspace(0, records - 1, min(records, RECORDS)).tolist()]


def _columns(flown: pd.DataFrame) -> Json:
    time, x, y, turned = (
        flown[name].to_numpy(float) for name in ("time_s", "x_m", "y_m", "yaw_rad")
    )
    ranges = [name for name in flown.columns if name.startswith("range_")]
    return {
        "time": changes(differences(_thousandths(time))),
        "x": differences(_thousandths(x)),
        "y": differences(_thousandths(y)),
        "yaw": differences(_thousandths(np.unwrap(turned))),
        "mode": changes(flown["mode"].astype(int).tolist()),
        "contact": changes(flown["contact"].astype(int).tolist()),
        "readings": [differences(_thousandths(flown[name].to_numpy(float))) for name in ranges],
    }


def _thousandths(values: Array) -> list[int | None]:
    return [None if math.isnan(value) else round(value * 1000) for value in values.tolist()]


def differences(values: Sequence[int | None]) -> list[int | None]:
    """Each value less the last one before it that is not None; None stays."""
    last, found = 0, list[int | None]()
    for value in values:
        found.append(None if value is None else value - last)
        last = last if value is None else value
    return found


def changes(values: Sequence[int | None]) -> list[list[int | None]]:
    """``[place, value]`` of the first and of each that differs from the one before it."""
    ends = [place for place, (a, b) in enumerate(pairwise(values), 1) if a != b]
    return [[place, values[place]] for place in (0, *ends)] if values else []


def _reached(flown: pd.DataFrame, course: Course) -> Iterator[list[float]]:
    """``[time, corner]`` of each waypoint, the nearest to where the robot was; -1 is home."""
    goals = np.array([course.home[:2], *course.waypoints])
    for place in _begins(flown["visited"]):
        row = flown.iloc[place]
        distances = np.hypot(*(goals - [row["x_m"], row["y_m"]]).T)
        yield [round(float(row["time_s"]), 3), int(np.argmin(distances)) - 1]


def _collisions(flown: pd.DataFrame) -> Iterator[Json]:
    for place in _begins(flown["contact"]):
        row = flown.iloc[place]
        names = (("at_s", "time_s"), ("x", "x_m"), ("y", "y_m"))
        yield {name: round(float(row[column]), 3) for name, column in names}


def _begins(column: pd.Series) -> list[int]:
    """The rows in which a count is greater than in the row before; it begins at 0."""
    return np.flatnonzero(np.diff(column.to_numpy(float), prepend=0) > 0).tolist()


def _obstacles(world: World) -> Iterator[Json]:
    """What stands on the plane, the lowest first, so that nothing hides what stands on it."""
    placed = [(shape, body.pose @ shape.pose) for body in world.obstacles for shape in body.shapes]
    for shape, pose in sorted(placed, key=lambda each: top_height(*each)):
        area = project_shape(shape, pose)
        yield _shape(area.vertices, area.radius)


def _shape(vertices: Iterable[Sequence[float]], radius_m: float) -> Json:
    corners = [[round(float(x), 4), round(float(y), 4)] for x, y in vertices]
    return {"vertices": corners, "radius": round(float(radius_m), 4)}


def _course(course: Course) -> Json:
    return {
        "home": list(course.home[:2]),
        "waypoints": [list(point) for point in course.waypoints],
        "acceptance_m": course.acceptance_m,
    }


def _extent(places: Array, course: Course, obstacles: Sequence[Json]) -> list[float]:
    """x and y of the least and of the greatest corner [m]."""
    corners = np.array([course.home[:2], *course.waypoints])
    solid = [
        np.array(each["vertices"]) + sign * each["radius"] for each in obstacles for sign in (-1, 1)
    ]
    reach = course.acceptance_m
    points = np.concatenate([places, corners - reach, corners + reach, *solid])
    low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    return [round(float(value), 3) for value in (*low, *high)]


def _summary(row: "pd.Series[Any]") -> str:
    ended = str(row["ended"]).replace("_", " ")
    touched = int(row["collisions"]) if pd.notna(row["collisions"]) else 0
    collisions = f"{touched} collision{'' if touched == 1 else 's'}"
    return f"{ended}, {row['time_s']:.1f} s, {100 * row['progress']:.0f} % of the way, {collisions}"
