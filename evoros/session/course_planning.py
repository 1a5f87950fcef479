"""Plans a course for a world of the user's own, which a run takes unchanged."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import chain
from typing import Any

import numpy as np

from evoros.base.errors import InputError
from evoros.field.course_suggestion import AROUND_M, OPEN_SIDE_M, create_course, suggest_course
from evoros.field.steep_places import find_steep_places
from evoros.formats.sdf.reading import SdfOptions
from evoros.geometry.footprint import Footprint, find_bounds, project_bodies, project_shape
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.preflight.home import check_place
from evoros.preflight.routes import check_route
from evoros.robot.model import Robot
from evoros.terminal.log import withhold_messages
from evoros.world.course import Course
from evoros.world.floors import has_level_ground, settle
from evoros.world.loading import read_world
from evoros.world.model import LOW_M, World
from evoros.world.standing import stand

HEADROOM_M = 0.1
"""Free height above the robot under a body that a course leads under."""


@dataclass(frozen=True)
class Planned:
    """A course, and whether the ground of its world is level."""

    course: Mapping[str, Any]  # the values of the key ``course``
    is_level: bool


@dataclass(frozen=True)
class _Place:
    """A world without a course, and the robot that is to drive in it."""

    source: str
    bodies: tuple[Body, ...]
    robot: Robot
    home: tuple[float, float] | None  # that the user has chosen

    @property
    def radius_m(self) -> float:
        """The distance from the robot's origin to the farthest corner of its outline."""
        return float(np.linalg.norm(self.robot.outline, axis=1).max())


def plan_course(values: Mapping[str, Any], robot: Robot) -> Planned:
    """Complete the course of the world that ``load_world`` reads with ``values``.

    A course without waypoints gets those of a suggestion that suits the robot, and that starts at
    its home if it has one.

    Raises:
        InputError: the world cannot be read, or there is no room for a course.
    """
    source, given = str(values["sdf"]), _check_course(values.get("course"))
    with withhold_messages():  # building the world will repeat them
        return _plan(source, given, _read_bodies(source, values), robot)


def _check_course(given: object) -> dict[str, Any]:
    """Return the values of a course that the user has given."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise InputError(f"world.course: must have keys, such as course.home_x_m=1, not {given!r}")
    known = vars(create_course([(0.0, 0.0), (1.0, 0.0)], 0.3))
    try:
        Course(**known | {key: value for key, value in given.items() if key in known})
    except InputError as error:
        raise InputError(str(error).replace("Course.", "world.course.")) from None
    return dict(given)


def _plan(source: str, given: dict[str, Any], bodies: tuple[Body, ...], robot: Robot) -> Planned:
    home = (given.get("home_x_m", 0.0), given.get("home_y_m", 0.0))
    chosen = home if {"home_x_m", "home_y_m"} <= set(given) else None
    place = _Place(source, bodies, robot, chosen)
    if "waypoints" not in given:
        world = _find_world(place)
        return Planned(_to_values(world.course) | given, world.is_level)
    course = create_course([home, *given["waypoints"]], place.radius_m)
    return Planned(_to_values(course) | given, has_level_ground(settle(bodies, course, source)))


def _read_bodies(source: str, values: Mapping[str, Any]) -> tuple[Body, ...]:
    keys = {entry.name: values[entry.name] for entry in fields(SdfOptions) if entry.name in values}
    try:
        options = SdfOptions(**keys)
    except InputError as error:
        raise InputError(str(error).replace("SdfOptions.", "world.")) from None
    return read_world(source, options, values.get("arguments", {})).bodies


def _to_values(course: Course) -> dict[str, Any]:
    values = {"_target_": f"{Course.__module__}.{Course.__name__}", **vars(course)}
    return values | {"waypoints": [list(point) for point in course.waypoints]}


def _find_world(place: _Place) -> World:
    """Return the world with the first suggestion that a run takes without a warning."""
    for start in _list_starts(place):
        for _ in range(2):  # a course may have another floor than the one it was suggested for
            course = _suggest(place, start)
            if course is None:
                break
            world = _accept(place, course)
            if world is not None:
                return world
            start = course
    x, y = "world.course.home_x_m", "world.course.home_y_m"
    raise InputError(
        f"{place.source}: must have two free places for {place.robot.name} that are 1.5 m apart, "
        f"among what stands there or up to {AROUND_M:g} m around it, and no course was found; type "
        f"{x}=X {y}=Y 'world.course.waypoints=[[X, Y], ...]' to give one"
    )


def _list_starts(place: _Place) -> Iterator[Course]:
    """Yield places whose floor the course may be on: a wide one, a small one, and the middle."""
    home = place.home or (0.0, 0.0)
    yield _start(home, OPEN_SIDE_M * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) + home)
    yield _start(home)
    shapes = project_bodies(place.bodies)
    if shapes and place.home is None:
        x, y = np.mean(find_bounds(*shapes), axis=0).tolist()
        yield _start((x, y))


def _start(home: tuple[float, float], waypoints: Any = None) -> Course:
    """Return a course that only tells which floor is meant."""
    points = [(home[0] + 0.5, home[1])] if waypoints is None else [tuple(p) for p in waypoints]
    return Course(*home, 0.0, 0.0, points, 0.3, 60.0, "forward", True)


def _suggest(place: _Place, start: Course) -> Course | None:
    """Suggest a course on the floor of another one, under nothing that is too low or may fall."""
    bodies = settle(place.bodies, start, place.source)
    obstacles = stand(bodies)
    below = max(place.robot.height_m, LOW_M) + HEADROOM_M
    fixed = [body for body in obstacles if body.mass is None]
    movable = [body for body in obstacles if body.mass is not None]
    shapes = [*project_bodies(fixed, below), *project_bodies(movable)]
    for shape, pose in _list_ground(bodies):
        if shape.kind == "heightfield":
            shapes += find_steep_places(shape, pose)
    return suggest_course(shapes, place.radius_m, _find_ground(bodies), place.home)


def _find_ground(bodies: Sequence[Body]) -> list[Footprint] | None:
    """Return the footprints of the ground of a world; None if it has no end."""
    shapes = _list_ground(bodies)
    if any(shape.kind == "plane" for shape, _ in shapes):
        return None
    return [project_shape(shape, pose) for shape, pose in shapes]


def _list_ground(bodies: Sequence[Body]) -> list[tuple[Shape, Pose]]:
    return [(s, body.pose @ s.pose) for body in bodies if body.is_ground for s in body.shapes]


def _accept(place: _Place, course: Course) -> World | None:
    """Return the world with this course; None if a run would refuse it or warn."""
    bodies = settle(place.bodies, course, place.source)
    try:
        world = World("plan", bodies, course, place.source, "")
        faults = chain(check_place(world, place.robot), check_route(world, place.robot))
        return None if any(faults) else world
    except InputError:
        return None
