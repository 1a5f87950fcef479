"""Plans a course for the user's world, which runs then use unchanged."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import chain
from typing import Any, TypeAlias

import numpy as np

from evoros.base.errors import InputError
from evoros.field.course_suggestion import (
    AROUND_M,
    OPEN_SIDE_M,
    Suggestion,
    create_course,
    find_steep_places,
    suggest_course,
)
from evoros.formats.sdf.reading import SdfOptions
from evoros.geometry.footprint import Footprint, contains, find_bounds, project_bodies
from evoros.geometry.shapes import Body, Vector
from evoros.preflight.routes import check_place, check_route
from evoros.robot.model import Robot
from evoros.terminal.activity import announce
from evoros.terminal.log import withhold_messages
from evoros.world.course import Course
from evoros.world.floors import GROUND, ground_shapes, has_level_ground, project_ground, settle
from evoros.world.hollows import fill_hollow
from evoros.world.loading import free_bodies, read_world
from evoros.world.model import LOW_M, World
from evoros.world.standing import stand

HEADROOM_M = 0.1  # minimum vertical clearance between the robot and a body above its course

FLOOR_SHARE = 0.05  # minimum fraction of the world's bounding box that a floor covers
MANY = 20_000  # shapes, as in a city, above which the first valid course is chosen


@dataclass(frozen=True)
class Planned:
    """A planned course, and whether the ground of its world is level."""

    course: Mapping[str, Any]  # values of the key ``course``
    is_level: bool
    reason: str = ""  # reason for suggesting this course; empty if the user chose it


Floor: TypeAlias = tuple[tuple[str, bool, Vector], ...]  # names, ground or not, positions [m]


@dataclass(frozen=True)
class _Place:
    source: str
    bodies: tuple[Body, ...]
    robot: Robot
    home: tuple[float, float] | None  # x, y [m]; None unless chosen by the user
    freed: dict[Floor, tuple[Body, ...]] = field(default_factory=dict)
    """bodies of the courses tried so far, by floor; most courses share a floor"""

    def settle(self, course: Course) -> tuple[Floor, tuple[Body, ...]]:
        """Return the floor of a course, and the bodies as placed on that floor."""
        settled = settle(self.bodies, course, self.source)
        floor = tuple((body.name, body.is_ground, body.pose.position) for body in settled)
        if floor not in self.freed:
            self.freed[floor] = free_bodies(settled, self.source)
        return floor, self.freed[floor]

    @property
    def radius_m(self) -> float:
        """Distance from the robot's origin to the farthest corner of its outline [m]."""
        return float(np.linalg.norm(self.robot.outline, axis=1).max())


def plan_course(values: Mapping[str, Any], robot: Robot) -> Planned:
    """Complete the course of the world that ``load_world`` reads from ``values``, for a robot."""
    source, given = str(values["sdf"]), _check_course(values.get("course"))
    with withhold_messages():  # building the world logs these messages again
        bodies = _read_bodies(source, values)
        with announce(f"looking for a course in {source}"):
            return _plan(source, given, bodies, robot)


def _check_course(given: object) -> dict[str, Any]:
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise InputError(
            f"world.NAME.course: must have keys, such as world.NAME.course.home_x_m=1, not "
            f"{given!r}"
        )
    known = vars(create_course([(0.0, 0.0), (1.0, 0.0)], 0.3))
    try:
        Course(**known | {key: value for key, value in given.items() if key in known})
    except InputError as error:
        raise InputError(str(error).replace("Course.", "world.NAME.course.")) from None
    return dict(given)


def _plan(source: str, given: dict[str, Any], bodies: tuple[Body, ...], robot: Robot) -> Planned:
    home = (given.get("home_x_m", 0.0), given.get("home_y_m", 0.0))
    chosen = home if {"home_x_m", "home_y_m"} <= set(given) else None
    place = _Place(source, bodies, robot, chosen)
    if "waypoints" not in given:
        world, where = _find_world(place)
        return Planned(_to_values(world.course) | given, world.is_level, where)
    course = create_course([home, *given["waypoints"]], place.radius_m)
    return Planned(_to_values(course) | given, has_level_ground(settle(bodies, course, source)))


def _read_bodies(source: str, values: Mapping[str, Any]) -> tuple[Body, ...]:
    keys = {entry.name: values[entry.name] for entry in fields(SdfOptions) if entry.name in values}
    try:
        options = SdfOptions(**keys)
    except InputError as error:
        raise InputError(str(error).replace("SdfOptions.", "world.NAME.")) from None
    return read_world(source, options, values.get("arguments", {})).bodies


def _to_values(course: Course) -> dict[str, Any]:
    values = {"_target_": f"{Course.__module__}.{Course.__name__}", **vars(course)}
    return values | {"waypoints": [list(point) for point in course.waypoints]}


def _find_world(place: _Place) -> tuple[World, str]:
    """Return a world with the first suggested course that causes no warning, and its location."""
    grounds = (False,) if project_ground(place.bodies) is None else (True, False)
    for on_floors in grounds:
        suggested = _list_worlds(place, on_floors)
        first = next(suggested, None)
        if first is not None:
            shapes = sum(len(body.shapes) for body in place.bodies)
            if shapes > MANY and not first[1].is_enclosed:
                limit = (
                    f"other enclosed regions were not searched for, because there are {shapes:,} "
                    "shapes"
                )
                return first[0], f"{first[1].place}; {limit}"
            every = (first,) if shapes > MANY else (first, *suggested)
            world, chosen = next((one for one in every if one[1].is_enclosed), first)
            return world, chosen.place
    x, y = "world.NAME.course.home_x_m", "world.NAME.course.home_y_m"
    raise InputError(
        f"{place.source}: no course was found: among the obstacles or within {AROUND_M:g} m of "
        f"them, {place.robot.name} needs two clear areas, each {2 * place.radius_m:.2g} m "
        f"across, with a clear straight line between the areas; to give a course, type {x}=X "
        f"{y}=Y 'world.NAME.course.waypoints=[[X, Y], ...]'"
    )


def _list_worlds(place: _Place, on_floors: bool) -> Iterator[tuple[World, Suggestion]]:
    tried = set[Floor]()
    for start in _list_starts(place):
        for _ in range(2):  # the first suggested course may be on a different floor
            floor, bodies = place.settle(start)
            suggestion = None if floor in tried else _suggest(place, bodies, on_floors)
            tried.add(floor)
            if suggestion is None:
                break
            world = _accept(place, suggestion.course)
            if world is not None:
                yield world, suggestion
                break
            start = suggestion.course


def _list_starts(place: _Place) -> Iterator[Course]:
    """Yield provisional courses for finding floors: wide, small, and in the middle of bodies."""
    home = place.home or (0.0, 0.0)
    yield _start(home, OPEN_SIDE_M * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) + home)
    yield _start(home)
    shapes = project_bodies(place.bodies)
    if shapes and place.home is None:
        x, y = np.mean(find_bounds(*shapes), axis=0).tolist()
        yield _start((x, y))


def _start(home: tuple[float, float], waypoints: Any = None) -> Course:
    points = [(home[0] + 0.5, home[1])] if waypoints is None else [tuple(p) for p in waypoints]
    return Course(*home, 0.0, 0.0, points, 0.3, 60.0, "forward", True)


def _suggest(place: _Place, bodies: Sequence[Body], on_floors: bool) -> Suggestion | None:
    obstacles = stand(bodies)
    below = max(place.robot.height_m, LOW_M) + HEADROOM_M
    fixed = [body for body in obstacles if body.mass is None]
    movable = [body for body in obstacles if body.mass is not None]
    shapes = [*project_bodies(fixed, below), *project_bodies(movable)]
    for shape, pose in ground_shapes(bodies):
        if shape.kind == "heightfield":
            shapes += find_steep_places(shape, pose)
    kept = [body for body in bodies if not (on_floors and body.shapes == GROUND.shapes)]
    ground = project_ground(kept)
    if ground == [] or (on_floors and ground and _is_small(ground, [*shapes, *ground])):
        return None
    while True:
        suggestion = suggest_course(shapes, place.radius_m, ground, place.home)
        if suggestion is None or place.home is not None:
            return suggestion
        hollow = fill_hollow(obstacles, np.array(suggestion.course.home[:2]), below)
        # Worlds start robots at the origin, even inside a building without doors.
        if not hollow or any(contains(area, (0.0, 0.0)) for area in hollow):
            return suggestion
        shapes += hollow


def _is_small(floors: Sequence[Footprint], everything: Sequence[Footprint]) -> bool:
    """Return True if the floors cover so little of the world that they are furniture."""
    inner, outer = (np.diff(find_bounds(*areas), axis=0) for areas in (floors, everything))
    return bool(inner.prod() < FLOOR_SHARE * outer.prod())


def _accept(place: _Place, course: Course) -> World | None:
    """Return the world with this course, or None if a run would reject it or warn about it."""
    try:
        world = World("plan", place.settle(course)[1], course, place.source, "")
        faults = chain(check_place(world, place.robot), check_route(world, place.robot))
        return None if any(faults) else world
    except InputError:
        return None
