"""Courses: routes, directions, and what is refused."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from world_cases import square

from evoros.base.errors import InputError


def test_the_case_study_s_route_has_ten_legs_that_end_at_home() -> None:
    forward = [(5, 5), (5, -5), (-5, -5), (-5, 5), (0, 0)]
    backward = [(-5, 5), (-5, -5), (5, -5), (5, 5), (0, 0)]
    np.testing.assert_array_equal(square().route(True), forward + backward)
    np.testing.assert_array_equal(square().route(False), backward + forward)


@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), min_size=1, max_size=6))
def test_both_phases_visit_all_corners_and_end_at_home(corners: list[tuple[float, float]]) -> None:
    course = square(waypoints=corners, home_x_m=1.0, home_y_m=-2.0)
    for forward in (True, False):
        out, back = np.split(course.route(forward), 2)
        np.testing.assert_array_equal(out[-1], [1.0, -2.0])
        np.testing.assert_array_equal(back[-1], [1.0, -2.0])
        np.testing.assert_array_equal(out[:-1], corners if forward else corners[::-1])
        np.testing.assert_array_equal(back[:-1], out[:-1][::-1])


def test_the_direction_is_drawn_or_given() -> None:
    rng = np.random.default_rng(0)
    draws = [square().goes_forward(0, rng) for _ in range(1000)]
    assert 400 < sum(draws) < 600
    before = rng.bit_generator.state
    parity = [square(direction="parity").goes_forward(g, rng) for g in range(4)]
    assert parity == [True, False, True, False]
    assert square(direction="forward").goes_forward(1, rng)
    assert not square(direction="backward").goes_forward(0, rng)
    assert rng.bit_generator.state == before  # only what is random draws


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("home_x_m", math.nan),
        ("home_y_m", "0"),
        ("home_z_m", -0.1),
        ("home_yaw_rad", math.inf),
        ("waypoints", []),
        ("waypoints", 5),
        ("waypoints", [[1, 2, 3]]),
        ("waypoints", [[1, math.nan]]),
        ("waypoints", [1, 2]),
        ("waypoints", [["a", "b"]]),
        ("acceptance_m", 0),
        ("time_limit_s", -1),
        ("direction", "left"),
        ("end_on_collision", 1),
    ],
)
def test_a_bad_value_of_a_course_is_named(field: str, value: object) -> None:
    with pytest.raises(InputError, match=rf"^Course\.{field}: .*, not "):
        square(**{field: value})


@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), min_size=1, max_size=6))
def test_one_way_ends_at_the_last_corner(corners: list[tuple[float, float]]) -> None:
    course = square(waypoints=corners, direction="one_way")
    rng = np.random.default_rng(0)
    before = rng.bit_generator.state
    assert course.goes_forward(3, rng)
    assert rng.bit_generator.state == before
    np.testing.assert_array_equal(course.route(True), corners)
    np.testing.assert_array_equal(course.first_phase, [course.home[:2], *corners])
    there_and_back = square(waypoints=corners)
    np.testing.assert_array_equal(there_and_back.first_phase[-1], there_and_back.home[:2])
