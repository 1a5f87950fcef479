"""A suggested course is one that a robot can drive: its straight legs meet no obstacle."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.base.arrays import Array
from evoros.field.course_suggestion import (
    AROUND_M,
    ATTEMPTS,
    MAX_SLOPE,
    find_steep_places,
    suggest_course,
)
from evoros.geometry.footprint import Footprint, distances
from evoros.geometry.free_space import CELL_M
from evoros.geometry.shapes import Pose, Shape
from evoros.world.course import Course

RADIUS_M = 0.3
CELL_DIAGONAL_M = CELL_M * math.sqrt(2.0)


def rectangle(x: float, y: float, length: float, width: float) -> Footprint:
    corners = np.array([[-length, -width], [length, -width], [length, width], [-length, width]])
    return Footprint(corners / 2 + (x, y))


def suggest(obstacles: Sequence[Footprint], **keys: Any) -> Course:
    suggestion = suggest_course(obstacles, RADIUS_M, **keys)
    assert suggestion is not None
    return suggestion.course


def points_along(course: Course) -> Array:
    stops = np.array([course.home[:2], *course.waypoints, course.home[:2]])
    steps = np.linspace(0.0, 1.0, 50)[:, None]
    return np.concatenate([a + steps * (b - a) for a, b in pairwise(stops)])


places = st.tuples(
    st.floats(-6, 6), st.floats(-6, 6), st.floats(0.1, 2.0), st.floats(0.1, 2.0)
).map(lambda values: rectangle(*values))


@pytest.mark.slow
@settings(max_examples=15)
@given(st.lists(places, min_size=4, max_size=12))
def test_the_legs_stay_clear_of_every_obstacle(obstacles: list[Footprint]) -> None:
    walls = [rectangle(0, y, 18, 0.2) for y in (-9, 9)] + [
        rectangle(x, 0, 0.2, 18) for x in (-9, 9)
    ]
    course = suggest([*obstacles, *walls])
    # Waypoints are rounded to centimetres, and a leg is followed from cell to cell.
    room = min(distances(shape, points_along(course)).min() for shape in (*obstacles, *walls))
    margin = min(attempt.margin_m for attempt in ATTEMPTS)
    assert room > RADIUS_M + margin - CELL_DIAGONAL_M / 2 - 0.01


@pytest.mark.slow
def test_a_line_through_a_narrow_passage_replaces_no_loop_with_more_room() -> None:
    """A room of 2.6 m, and a dead end as wide as the robot and 0.1 m on each side."""
    half, length, width, thick = 1.3, 4.0, 2 * RADIUS_M + 0.25, 0.2
    beside, middle = half - width / 2, half + length / 2
    room = [rectangle(0, side * (half + thick / 2), 3.0, thick) for side in (-1, 1)]
    room += [rectangle(-half - thick / 2, 0, thick, 2 * half)]
    room += [
        rectangle(half + thick / 2, side * (width + beside) / 2, thick, beside) for side in (-1, 1)
    ]
    passage = [rectangle(middle, side * (width + thick) / 2, length, thick) for side in (-1, 1)] + [
        rectangle(half + length + thick / 2, 0, thick, width + 2 * thick)
    ]
    course = suggest([*room, *passage])
    assert len(course.waypoints) > 2
    assert np.abs(course.waypoints).max() < half


def test_a_world_that_leaves_the_origin_free_starts_there() -> None:
    course = suggest([rectangle(x, y, 1, 1) for x in (-4, 4) for y in (-4, 4)])
    assert course.home[:2] == (0.0, 0.0)


def test_a_course_in_a_wide_ring_of_posts_comes_near_one() -> None:
    """The posts stand 13 m around the free origin; the bundled avoidance sees them from 2 m."""
    turns = np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False)
    posts = [Footprint(13.0 * np.array([[math.cos(a), math.sin(a)]]), 0.1) for a in turns]
    gaps = [distances(post, points_along(suggest(posts))).min() for post in posts]
    assert min(gaps) < 2.0 + RADIUS_M + 1.0  # a place that is not free lies a margin before a post


def test_an_empty_world_gets_a_square_around_the_origin() -> None:
    course = suggest([])
    lengths = {round(math.dist(a, b), 9) for a, b in pairwise(course.waypoints)}
    assert len(course.waypoints) == 4
    assert len(lengths) == 1


def test_two_rooms_without_a_door_are_not_connected() -> None:
    walls = [rectangle(0, y, 12, 0.2) for y in (-3, 3)] + [
        rectangle(x, 0, 0.2, 6) for x in (-6, 2, 6)
    ]
    course = suggest(walls)
    stops = np.array([course.home[:2], *course.waypoints])
    assert (stops[:, 0] < 2).all()  # home is at the origin, left of the wall between the rooms


def test_the_time_limit_allows_for_driving_both_phases_slowly() -> None:
    course = suggest([])
    length = np.linalg.norm(np.diff(course.route(True), axis=0), axis=1).sum()
    assert course.time_limit_s >= length / 0.29


@pytest.mark.slow
@settings(max_examples=8)
@given(st.lists(places, min_size=1, max_size=4))
def test_a_few_things_in_the_open_leave_room_around_them(obstacles: list[Footprint]) -> None:
    course = suggest(obstacles)
    points = points_along(course)
    assert min(distances(obstacle, points).min() for obstacle in obstacles) > RADIUS_M
    corners = np.concatenate([obstacle.vertices for obstacle in obstacles])
    assert (points >= corners.min(axis=0) - AROUND_M - CELL_M).all()
    assert (points <= corners.max(axis=0) + AROUND_M + CELL_M).all()


@pytest.mark.slow
def test_a_course_stays_on_its_ground() -> None:
    """The slab ends 0.5 m beside the box on three sides; the robot has a radius of 0.3 m."""
    slab, box = rectangle(1, 0, 5, 2), rectangle(0, 0, 1, 1)
    points = points_along(suggest([box], ground=[slab]))
    assert distances(box, points).min() > RADIUS_M
    low, high = np.array([-1.5, -1.0]) + RADIUS_M, np.array([3.5, 1.0]) - RADIUS_M
    assert (points > low - 0.01).all()
    assert (points < high + 0.01).all()


@pytest.mark.slow
@pytest.mark.parametrize("large", [rectangle(1, 5, 60, 70), Footprint(np.array([[1.0, 5.0]]), 30)])
def test_a_course_leads_around_what_is_very_large(large: Footprint) -> None:
    assert distances(large, points_along(suggest([large]))).min() > RADIUS_M


def test_a_chosen_home_is_kept_or_there_is_no_course() -> None:
    box = rectangle(0, 0, 1, 1)
    assert suggest([box], home=(4.0, 1.0)).home[:2] == (4.0, 1.0)
    assert suggest([], home=(4.0, 1.0)).home[:2] == (4.0, 1.0)
    assert suggest_course([box], RADIUS_M, home=(0.2, 0.0)) is None


def test_a_room_without_room_has_no_course() -> None:
    """Its middle can move by 0.4 m along each side, and no leg is shorter than 0.6 m."""
    walls = [rectangle(0, y, 1.3, 0.2) for y in (-0.65, 0.65)]
    walls += [rectangle(x, 0, 0.2, 1.3) for x in (-0.65, 0.65)]
    assert suggest_course(walls, RADIUS_M, ground=[rectangle(0, 0, 1.3, 1.3)]) is None


@pytest.mark.parametrize("count", [9, 200])
@pytest.mark.parametrize("slope", [0.9 * MAX_SLOPE, 1.1 * MAX_SLOPE])
def test_a_ramp_is_steep_where_it_rises(count: int, slope: float) -> None:
    """A field of 16 m by 8 m is level up to its middle and rises from there on."""
    x = np.linspace(-8.0, 8.0, count)
    heights = tuple(map(tuple, np.tile(slope * np.maximum(x, 0.0), (5, 1)).tolist()))
    places = find_steep_places(Shape("heightfield", (16.0, 8.0), heights=heights), Pose((3, 0, 0)))
    if slope < MAX_SLOPE:
        assert places == []
        return
    points = np.array([[x + 3.0, y] for x in (-7.5, -0.5, 0.5, 7.5) for y in (-3.9, 0.0, 3.9)])
    gaps = np.min([distances(place, points) for place in places], axis=0)
    assert (gaps[:6] > 0.3).all()
    assert (gaps[6:] == 0.0).all()


def polygon_walls(x: float, y: float, radius: float, sides: int, gap: int = -1) -> list[Footprint]:
    """Walls of 0.1 m along the sides of a regular polygon, of which one may be missing."""
    turns = np.exp(2j * np.pi * np.arange(sides + 1) / sides)
    walls = []
    for i, (a, b) in enumerate(pairwise(radius * turns)):
        across = 0.05j * (b - a) / abs(b - a)
        corners = np.array([a - across, b - across, b + across, a + across])
        if i != gap:
            walls.append(Footprint(np.stack([corners.real + x, corners.imag + y], axis=1)))
    return walls


@pytest.mark.parametrize(
    ("x", "y", "size", "sides", "gap", "radius"),
    [(0, 0, 2.1, 4, -1, 0.45), (30, -20, 3.0, 6, -1, 0.2), (0, 3, 3.5, 6, 2, 0.45)],
)
def test_a_course_lies_inside_the_walls(
    x: float, y: float, size: float, sides: int, gap: int, radius: float
) -> None:
    """Those of a square arena of 3 m, of a hexagon here and far off, and of one with a side open.

    The trees around it leave more room than there is inside.
    """
    walls = polygon_walls(x, y, size, sides, gap)
    trees = [rectangle(x + 6 * a, y + 6 * b, 0.3, 0.3) for a in (-1, 1) for b in (-1, 1)]
    suggestion = suggest_course([*walls, *trees, rectangle(x + 0.2, y, 0.2, 0.2)], radius)
    assert suggestion is not None
    assert "enclosed free region" in suggestion.place
    offsets = points_along(suggestion.course) - (x, y)
    assert np.linalg.norm(offsets, axis=1).max() < size - radius
    legs = np.linalg.norm(np.diff(suggestion.course.route(True), axis=0), axis=1)
    assert legs.min() > suggestion.course.acceptance_m


def test_a_course_turns_around_the_corner_of_a_corridor() -> None:
    """A corridor of 1.4 m leads 9 m along x from the origin, and from there 9 m along y."""
    walls = [rectangle(4, -0.75, 10, 0.1), rectangle(3.3, 0.75, 8.6, 0.1)]
    walls += [rectangle(9.05, 4, 0.1, 9.6), rectangle(7.55, 4.7, 0.1, 8.0)]
    walls += [rectangle(-1, 0, 0.1, 1.6), rectangle(8.3, 8.75, 1.6, 0.1)]
    course = suggest(walls)
    corner, end, back = np.array(course.waypoints)
    assert corner.tolist() == back.tolist()
    assert end[1] - corner[1] > 4.0


@pytest.mark.parametrize("home", [None, (200.0, 0.5)])
def test_a_course_in_a_large_world_lies_around_home_or_near_the_origin(
    home: tuple[float, float] | None,
) -> None:
    rooms = [wall for x in (0, 200) for wall in polygon_walls(x, 0, 4.0, 6)]
    middle = (0.0, 0.0) if home is None else home
    offsets = points_along(suggest(rooms, home=home)) - middle
    assert np.linalg.norm(offsets, axis=1).max() < 5.0


def test_the_place_of_a_course_is_told() -> None:
    nothing = suggest_course([], RADIUS_M)
    boxes = [rectangle(x, y, 1, 1) for x in (-4, 4) for y in (-4, 4)]
    among = suggest_course(boxes, RADIUS_M)
    assert nothing is not None
    assert among is not None
    assert "without obstacles" in nothing.place
    assert "among the obstacles" in among.place
