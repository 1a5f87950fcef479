"""The actors of SDF files, which walk according to the times of their waypoints."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

from lxml.etree import _Element as Element

from evoros.formats.pose import parse_pose
from evoros.formats.sdf.frames import read_pose
from evoros.formats.sdf.reading import Reading
from evoros.formats.strict_xml import (
    element_error,
    find_child,
    read_child_numbers,
    read_flag,
    read_name,
    read_number,
    require_child,
)

RADIUS_M, HEIGHT_M = 0.25, 1.7
"""The size of an actor, because engines know no size of its skin."""
Point = tuple[float, float, float]
"""x, y [m] and time [s]."""


@dataclass(frozen=True)
class Actor:
    """An upright cylinder that follows the times of a script."""

    name: str
    points: tuple[Point, ...]
    delay_s: float = 0.0  # pause before each round
    loops: bool = True
    radius_m: float = RADIUS_M
    height_m: float = HEIGHT_M


def read_actors(container: Element, reading: Reading) -> tuple[Actor, ...]:
    """Read the actors of a world, or leave them out if the options require it.

    Raises:
        InputError: a waypoint has no time or pose, or is not later than the previous one.
    """
    actors: list[Actor] = []
    for element in container.findall("actor"):
        if reading.options.actors == "leave_out":
            reading.notes.add(element, "is left out; world.NAME.actors=walk lets it walk", "actor")
        else:
            actors.append(_read_actor(element, {actor.name for actor in actors}, reading))
    return tuple(actors)


def _read_actor(element: Element, taken: set[str], reading: Reading) -> Actor:
    name = unique = re.sub(r"[^A-Za-z0-9_-]", "_", read_name(element))
    number = 1
    while unique in taken:
        unique, number = f"{name}_{number}", number + 1
    script = find_child(element, "script")
    points = [] if script is None else list(_read_points(script))
    starts = script is None or _read_flag(script, "auto_start")
    if not points or not starts:
        x, y, _ = points[0] if points else read_pose(element).pose.position
        problem = "stands still: nothing here moves it (no <trajectory>, or <auto_start> is false)"
        reading.notes.add(element, problem, "actor that stands")
        return Actor(unique, ((x, y, 0.0),))
    assert script is not None
    (delay,) = read_child_numbers(script, "delay_start", (0.0,))
    size = f"{2 * RADIUS_M:g} m wide and {HEIGHT_M:g} m high"
    problem = f"walks as a cylinder {size}, straight from waypoint to waypoint"
    reading.notes.add(element, problem, "actor that walks")
    return Actor(unique, tuple(points), max(delay, 0.0), _read_flag(script, "loop"))


def _read_flag(script: Element, tag: str) -> bool:
    """Read a flag of a script, which is true by default."""
    child = find_child(script, tag)
    return True if child is None else read_flag(child)


def _read_points(script: Element) -> Iterator[Point]:
    """Yield the waypoints of all trajectories, one after another."""
    last = -1.0
    for trajectory in script.findall("trajectory"):
        shift = None
        for waypoint in trajectory.findall("waypoint"):
            element = require_child(waypoint, "time")
            time = read_number(element, "a time of at least 0 s", lambda value: value >= 0.0)
            if shift is None:  # a later trajectory may count from its own start
                shift = last if 0.0 <= time <= last else 0.0
                skip = shift > 0.0 and time == 0.0
            x, y, _ = parse_pose(require_child(waypoint, "pose")).position
            if skip:
                skip = False
                continue
            if time + shift <= last:
                problem = f"must be later than the previous waypoint, at {last - shift:g} s"
                raise element_error(element, problem, "put the waypoints in order")
            last = time + shift
            yield x, y, last
