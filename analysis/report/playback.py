"""Encodes missions of champions, or of current best designs, for the player of a report.

Values are integers [mm, ms, mrad]: differences between samples, or changes ``[sample, value]``.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup

from evoros.base.arrays import Array
from evoros.base.errors import write_count
from evoros.filter.protocol import ENDS, GROWS
from evoros.geometry.footprint import project_shape, top_height
from evoros.sensor.protocol import CONTACT
from evoros.storage.figure_context import FigureContext
from evoros.world.course import Course
from evoros.world.model import World
from evoros.world.standing import standing_obstacles

from ..drawing.faults import GROWN_S
from ..tables import readings
from ..tables.champions import find_shown
from ..tables.records import Record
from ..tables.shown import ShownDesign, ShownMission, keeps_shown, read_champion_shown, read_shown
from ..tables.study import Study
from ..tables.tracks import NONE, list_failures, list_part_failures, select_trajectory

Json = dict[str, Any]
MARGIN_M = 0.5  # margin [m] around the drawing
MAX_RECORDS = 6000  # maximum number of samples per mission; longer missions are thinned out evenly


def encode_parts(context: FigureContext) -> list[Json]:
    """Encode the shapes of a robot in top view, lowest first."""
    return [
        {**_encode_shape(part.vertices, part.radius_m), "wheel": part.wheel}
        for part in sorted(context.parts, key=lambda part: part.top_m)
    ]


def encode_sensors(table: pd.DataFrame) -> Iterator[Json]:
    """Encode the pose and the cone of each sensor."""
    for row in table.to_dict("records"):
        yield {
            **_encode_place(row),
            "level": round(math.cos(math.radians(row["pitch_deg"])), 4),
            "fov": round(math.radians(row["fov_deg"]), 4),
            "range": row["range_m"],
            "pair": int(row["pair"]),
        }


def _encode_obstacles(world: World) -> Iterator[Json]:
    placed = [solid for body in standing_obstacles(world) for solid in body.placed]
    for shape, pose in sorted(placed, key=lambda pair: top_height(*pair)):
        area = project_shape(shape, pose)
        yield _encode_shape(area.vertices, area.radius)


def _encode_shape(vertices: Iterable[Sequence[float]], radius_m: float) -> Json:
    corners = [[round(float(x), 4), round(float(y), 4)] for x, y in vertices]
    return {"vertices": corners, "radius": round(float(radius_m), 4)}


def _encode_course(course: Course) -> Json:
    return {
        "home": list(course.home[:2]),
        "waypoints": [list(point) for point in course.waypoints],
        "acceptance_m": course.acceptance_m,
    }


def _find_extent(places: Array, course: Course, obstacles: Sequence[Json]) -> list[float]:
    """Return x, y [m] of the lower left and the upper right corner of the drawing."""
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
    """Return at most ``most`` evenly spaced indices, including the first and the last."""
    places = np.linspace(0, records - 1, min(records, most))
    return [round(place) for place in places.tolist()]


def _encode_place(sensor: Mapping[Any, Any]) -> dict[str, Any]:
    """Encode the type, number and planar pose of a sensor."""
    return {
        "type": str(sensor["type"]),
        "number": int(sensor["sensor"]),
        "x": round(sensor["x_m"], 4),
        "y": round(sensor["y_m"], 4),
        "yaw": round(math.radians(sensor["yaw_deg"]), 4),
    }


def _encode_poses(trajectory: pd.DataFrame) -> dict[str, list[int | None]]:
    x, y, yaw = (trajectory[name].to_numpy(float) for name in ("x_m", "y_m", "yaw_rad"))
    return {
        "x": _encode_numbers(x),
        "y": _encode_numbers(y),
        "yaw": _encode_numbers(np.unwrap(yaw)),
    }


def _encode_numbers(values: Array) -> list[int | None]:
    """Encode a column as differences in thousandths of its unit; NaN becomes None."""
    return encode_differences(
        [None if math.isnan(value) else round(value * 1000) for value in values.tolist()]
    )


def encode_differences(values: Sequence[int | None]) -> list[int | None]:
    """Replace each value by its difference from the last known value; keep None."""
    last, differences = 0, list[int | None]()
    for value in values:
        differences.append(None if value is None else value - last)
        last = last if value is None else value
    return differences


def encode_changes(values: Sequence[int | None]) -> list[list[int | None]]:
    """Return ``[index, value]`` of the first value and of each change."""
    changes = [index for index, (a, b) in enumerate(pairwise(values), 1) if a != b]
    return [[index, values[index]] for index in (0, *changes)] if values else []


def _describe_signals(sensors: pd.DataFrame, context: FigureContext) -> Iterator[dict[str, Any]]:
    for row in sensors.to_dict("records"):
        signal = context.signals[row["type"]]
        yield {
            **_encode_place(row),
            "touches": signal.measures == CONTACT,
            "width": row["width_m"],
            "depth": row["depth_m"],
            "channels": [channel[:2] for channel in readings.list_channels(row["sensor"], signal)],
        }


def _encode_signals(
    trajectory: pd.DataFrame, sensors: pd.DataFrame, context: FigureContext
) -> list[list[list[int | None]]]:
    """Encode the readings shown, by sensor and channel, in thousandths of their unit."""
    return [
        [
            _encode_numbers(trajectory[column].to_numpy(float))
            for _, _, column in readings.list_channels(sensor, context.signals[kind])
        ]
        for sensor, kind in zip(sensors["sensor"].tolist(), sensors["type"], strict=True)
    ]


MAX_SECTORS = 36  # maximum number of sectors for a sensor's ranges in the player
PLAYER = ("missions", "plan", "readings", "signals", "player")  # scripts in ``web/``


@dataclass(frozen=True)
class Flown:
    """Missions that were rerun because runs had stored none for their current best designs."""

    playbacks: Mapping[str, Markup] = field(default_factory=dict)  # keyed by run name
    notes: Sequence[str] = ()  # sentences about reruns, and about missions not rerun


def select_playbacks(
    study: Study, max_bytes: float, flown: Mapping[str, Markup]
) -> dict[str, Markup]:
    """Encode the missions of each treatment's best run, then of other runs up to ``max_bytes``."""

    def encode(record: Record) -> Markup:
        return flown.get(record.name) or encode_playback(record)

    ordered = study.ordered if study.records else ()
    kept = [record for record in ordered if record.name in flown or keeps_shown(record)]
    best = {record.treatment: record for record in reversed(kept)}
    required = [best[treatment] for treatment in study.treatments if treatment in best]
    playbacks: dict[str, Markup] = {}
    for record, data in study.read_each(dict.fromkeys([*required, *kept]), encode):
        room = max_bytes - sum(map(len, playbacks.values()))
        if record in required or len(data) <= room:
            playbacks[record.name] = data
        else:  # a later run might fit, but trying each would take seconds
            break
    return playbacks


def encode_playback(record: Record) -> Markup:
    """Encode the missions of a champion, or of the current best design, as JSON."""
    design = find_shown(record)
    return encode_shown(
        read_champion_shown(record) if design is None else read_shown(record, design)
    )


def encode_shown(
    shown: ShownDesign, most: int = MAX_RECORDS, grounds: dict[str, Json] | None = None
) -> Markup:
    """Encode a design's missions, ``most`` samples each; ``grounds`` collects shared courses."""
    context = shown.record.context
    content = {
        "run": shown.record.name,
        "design": shown.design,
        "parts": encode_parts(context),
        "agents": [
            {"name": name, "parts": encode_parts(agent)} for name, agent in context.agents.items()
        ],
        "sensors": list(encode_sensors(shown.sensors)),
        "signals": list(_describe_signals(shown.signals, context)),
        "modes": [NONE, *context.modes],
        "missions": [_encode_mission(shown, mission, most, grounds) for mission in shown.missions],
    }
    return htmlsafe_json_dumps(content, separators=(",", ":"))


def _encode_mission(
    shown: ShownDesign, mission: ShownMission, most: int, grounds: dict[str, Json] | None
) -> Json:
    context, trajectory, row = shown.record.context, mission.trajectory, mission.row
    others = [select_trajectory(trajectory, agent) for agent in context.agents]
    walkers = readings.list_walkers(trajectory, shown.record.values)
    paths = [robot[["x_m", "y_m"]].to_numpy(float) for robot in (trajectory, *others)]
    paths += [walker.places for walker in walkers]
    rows = thin_out(len(trajectory), most)
    course = mission.world.course
    obstacles = list(_encode_obstacles(mission.world))
    ground = {"course": _encode_course(course), "obstacles": obstacles}
    if grounds is not None:
        grounds[mission.ground] = ground
    bearings = [shown.context.beams[kind].bearings_deg for kind in shown.sensors["type"]]
    return {
        "world": row["world"],
        "summary": _summarize(row),
        "goals": len(course.route(True)),
        **(ground if grounds is None else {"ground": mission.ground}),
        "extent": _find_extent(np.concatenate(paths), course, obstacles),
        "failed": list(_encode_faults(row, context.failure.effects)),
        "parts_failed": list(_encode_part_faults(row, trajectory, context.failure.effects)),
        "reached": list(_encode_waypoints(trajectory, course)),
        "collisions": list(_encode_collisions(trajectory)),
        "agents": [_encode_poses(other.iloc[rows]) for other in others],
        "walkers": [_encode_walker(walker, rows) for walker in walkers],
        **_encode_columns(trajectory.iloc[rows], bearings),
        "signals": _encode_signals(trajectory.iloc[rows], shown.signals, context),
    }


def _encode_walker(walker: readings.WalkerTrack, rows: Sequence[int]) -> Json:
    x, y = walker.places[rows].T
    place = {"x": _encode_numbers(x), "y": _encode_numbers(y)}
    return {"name": walker.name, "radius": round(walker.radius_m, 4), **place}


def _encode_faults(row: "pd.Series[str]", effects: Mapping[str, str]) -> Iterator[Json]:
    """Encode the onset and effect of each sensor failure, and how long its mark grows [s]."""
    for sensor, time, effect in list_failures(row):
        kind = effects.get(effect, ENDS)
        grown_s = GROWN_S if kind == GROWS else 0.0
        fault = {"sensor": sensor, "at_s": round(time, 3), "by": effect}
        yield {**fault, "kind": kind, "grown_s": grown_s}


def _encode_part_faults(
    row: "pd.Series[str]", trajectory: pd.DataFrame, effects: Mapping[str, str]
) -> Iterator[Json]:
    times = trajectory["time_s"].to_numpy(float)
    for part, time, effect in list_part_failures(row):
        place = trajectory.iloc[min(int(np.searchsorted(times, time)), len(times) - 1)]
        where = {name: round(float(place[f"{name}_m"]), 3) for name in ("x", "y")}
        kind = effects.get(effect, ENDS)
        yield {"part": part, "at_s": round(time, 3), "by": effect, "kind": kind, **where}


def _encode_columns(trajectory: pd.DataFrame, bearings_deg: Sequence[Sequence[float]]) -> Json:
    sensors = [*readings.group_ranges(trajectory).values()]
    time = trajectory["time_s"].to_numpy(float)
    return {
        "time": encode_changes(_encode_numbers(time)),
        **_encode_poses(trajectory),
        "mode": encode_changes(trajectory["mode"].astype(int).tolist()),
        "contact": encode_changes(trajectory["contact"].astype(int).tolist()),
        "readings": [_encode_numbers(readings.find_nearest(ranges)) for ranges in sensors],
        "sectors": [
            [
                _encode_numbers(nearest)
                for nearest in readings.merge_sectors(ranges, bearings, MAX_SECTORS)
            ]
            if ranges.shape[1] > 1
            else None
            for ranges, bearings in zip(sensors, bearings_deg, strict=True)
        ],
    }


def _encode_waypoints(trajectory: pd.DataFrame, course: Course) -> Iterator[list[float]]:
    """Yield ``[time, number]`` of each waypoint at its closest sample; -1 is home."""
    goals = np.array([course.home[:2], *course.waypoints])
    for index in _find_increases(trajectory["visited"]):
        row = trajectory.iloc[index]
        distances = np.hypot(*(goals - [row["x_m"], row["y_m"]]).T)
        yield [round(float(row["time_s"]), 3), int(np.argmin(distances)) - 1]


def _encode_collisions(trajectory: pd.DataFrame) -> Iterator[Json]:
    for index in _find_increases(trajectory["contact"]):
        row = trajectory.iloc[index]
        names = (("at_s", "time_s"), ("x", "x_m"), ("y", "y_m"))
        yield {name: round(float(row[column]), 3) for name, column in names}


def _find_increases(column: pd.Series) -> list[int]:
    return np.flatnonzero(np.diff(column.to_numpy(float), prepend=0) > 0).tolist()


def _summarize(row: "pd.Series[Any]") -> str:
    ended = str(row["ended"]).replace("_", " ")
    touched = int(row["collisions"]) if pd.notna(row["collisions"]) else 0
    collisions = write_count(touched, "collision")
    return f"{ended}, {row['time_s']:.1f} s, {100 * row['progress']:.0f} % of the way, {collisions}"
