"""A suggested course is one that a robot can drive: its straight legs meet no obstacle."""

import math
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.base.arrays import Array
from evoros.field.course_suggestion import suggest_course
from evoros.geometry.footprint import Footprint, distances
from evoros.world.course import Course

RADIUS_M = 0.3
CELL_DIAGONAL_M = 0.1 * math.sqrt(2.0)


def rectangle(x: float, y: float, length: float, width: float) -> Footprint:
    corners = np.array([[-length, -width], [length, -width], [length, width], [-length, width]])
    return Footprint(corners / 2 + (x, y))


def points_along(course: Course) -> Array:
    stops = np.array([course.home[:2], *course.waypoints, course.home[:2]])
    steps = np.linspace(0.0, 1.0, 50)[:, None]
    return np.concatenate([a + steps * (b - a) for a, b in pairwise(stops)])


places = st.tuples(
    st.floats(-6, 6), st.floats(-6, 6), st.floats(0.1, 2.0), st.floats(0.1, 2.0)
).map(lambda values: rectangle(*values))


@settings(deadline=None, max_examples=40)
@given(st.lists(places, min_size=4, max_size=12))
def test_the_legs_stay_clear_of_every_obstacle(obstacles: list[Footprint]) -> None:
    walls = [rectangle(0, y, 18, 0.2) for y in (-9, 9)] + [
        rectangle(x, 0, 0.2, 18) for x in (-9, 9)
    ]
    course = suggest_course([*obstacles, *walls], RADIUS_M)
    # Waypoints are rounded to centimetres, and a leg is followed from cell to cell.
    least = min(distances(each, points_along(course)).min() for each in (*obstacles, *walls))
    assert least > RADIUS_M + 0.2 - CELL_DIAGONAL_M / 2 - 0.01
    assert course == suggest_course([*obstacles, *walls], RADIUS_M)


def test_a_world_that_leaves_the_origin_free_starts_there() -> None:
    course = suggest_course([rectangle(x, y, 1, 1) for x in (-4, 4) for y in (-4, 4)], RADIUS_M)
    assert course.home[:2] == (0.0, 0.0)


def test_an_empty_world_gets_a_square_around_the_origin() -> None:
    course = suggest_course([], RADIUS_M)
    lengths = {round(math.dist(a, b), 9) for a, b in pairwise(course.waypoints)}
    assert len(course.waypoints) == 4
    assert len(lengths) == 1


def test_two_rooms_without_a_door_are_not_connected() -> None:
    walls = [rectangle(0, y, 12, 0.2) for y in (-3, 3)] + [
        rectangle(x, 0, 0.2, 6) for x in (-6, 2, 6)
    ]
    course = suggest_course(walls, RADIUS_M)
    stops = np.array([course.home[:2], *course.waypoints])
    assert (stops[:, 0] < 2).all()  # home is at the origin, left of the wall between the rooms


def test_the_time_limit_allows_for_driving_both_phases_slowly() -> None:
    course = suggest_course([], RADIUS_M)
    length = np.linalg.norm(np.diff(course.route(True), axis=0), axis=1).sum()
    assert course.time_limit_s >= length / 0.29
