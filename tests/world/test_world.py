"""Worlds, courses and floors: obstacles, routes, directions, moves, and what is refused."""

import logging
import math
from pathlib import Path

import numpy as np
import pytest
from fixture_types import Log
from hypothesis import given
from hypothesis import strategies as st
from world_cases import GROUND, box, square, world_of

from evoros.base.errors import InputError
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.floors import ground_height, settle
from evoros.world.loading import load_world


@pytest.mark.parametrize(
    ("x", "y", "place"), [(5.0, -5.0, r"waypoint 1 of the course, \(5, -5\) m"), (0.0, 0.0, "home")]
)
def test_a_place_in_an_obstacle_is_refused_by_name(x: float, y: float, place: str) -> None:
    with pytest.raises(InputError, match=rf"^test\.sdf: {place}.*'rock'"):
        world_of(GROUND, box("free", 2.0, 2.0, 0.5), box("rock", x + 0.4, y - 0.4, 0.5))
    world_of(GROUND, box("beside", x + 0.6, y, 0.5))
    world_of(GROUND, box("bridge", x, y, 0.9))


@pytest.mark.parametrize(
    "ground",
    [
        Body("g", Pose((0.0, 0.0, 0.1)), (Shape("plane", (0.0, 0.0, 1.0)),)),
        Body("g", Pose(), (Shape("plane", (0.0, 0.0, -1.0)),)),
        Body("g", Pose(), (Shape("plane", (1.0, 0.0, 0.0)),)),
        Body("g", Pose((1.0, 0.0, 0.0)), (Shape("plane", (0.1, 0.0, 1.0)),)),
        Body("g", Pose((0.0, 0.0, -0.1)), GROUND.shapes),
    ],
)
def test_the_ground_must_be_at_zero_at_home_and_face_up(ground: Body) -> None:
    with pytest.raises(InputError, match=r"^test\.sdf: .*ground"):
        world_of(ground)


def test_there_must_be_ground_and_there_may_be_more_below() -> None:
    with pytest.raises(InputError, match="there is none"):
        world_of(box("alone", 1.0, 1.0, 0.5))
    below = Body("below", Pose((0.0, 0.0, -1.0)), GROUND.shapes)
    assert world_of(below, GROUND, Body("twice", Pose(), GROUND.shapes * 2)).obstacles == ()


def test_tilted_planes_and_height_fields_are_ground_that_is_not_level() -> None:
    assert world_of(GROUND).is_level
    assert not world_of(Body("g", Pose(), (Shape("plane", (0.0, 0.1, 1.0)),))).is_level
    turned = Body("g", Pose.from_rpy((0.0, 0.0, 0.0), 0.1, 0.0, 0.0), GROUND.shapes)
    assert not world_of(turned).is_level
    hill = Shape("heightfield", (20.0, 20.0), heights=((-1.0, 1.0), (-1.0, 1.0)))
    assert not world_of(Body("hill", Pose(), (hill,))).is_level
    with pytest.raises(InputError, match=r"it is at 0\.5 m"):
        world_of(Body("hill", Pose((0.0, 0.0, 0.5)), (hill,)))


def test_two_bodies_of_one_name_are_refused() -> None:
    with pytest.raises(InputError, match="'twin'"):
        world_of(GROUND, box("twin", 2.0, 2.0, 0.5), box("twin", 3.0, 3.0, 0.5))


def test_a_model_alone_gets_ground_to_stand_on(tmp_path: Path, caplog: Log) -> None:
    path = tmp_path / "rock.sdf"
    path.write_text(
        "<sdf version='1.7'><model name='rock'><static>1</static><pose>2 2 0 0 0 0</pose>"
        "<link name='l'><collision name='c'><geometry><sphere><radius>1</radius></sphere>"
        "</geometry></collision></link></model></sdf>"
    )
    with caplog.at_level(logging.WARNING):
        world = load_world(str(path), square())
    assert [(body.name, body.is_ground) for body in world.bodies] == [
        ("ground", True),
        ("rock", False),
    ]
    assert world.name == "rock"
    assert "added level ground" in caplog.text


def test_a_file_that_does_not_exist_is_an_error() -> None:
    with pytest.raises(InputError, match=r"nowhere\.sdf"):
        load_world("nowhere.sdf", square())


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


def slab(name: str, top: float, length: float = 20.0, x: float = 0.0, y: float = 0.0) -> Body:
    return Body(name, Pose((x, y, top - 0.05)), (Shape("box", (length, length, 0.1)),))


def place(*bodies: Body) -> dict[str, Body]:
    return {body.name: body for body in settle(bodies, square(), "test.sdf")}


def test_a_slab_that_carries_the_course_is_a_floor_and_no_obstacle(caplog: Log) -> None:
    with caplog.at_level(logging.WARNING):
        world = place(slab("slab", 0.0), Body("post", Pose((2, 2, 1)), (Shape("sphere", (1.0,)),)))
    assert {name: body.is_ground for name, body in world.items()} == {"slab": True, "post": False}
    assert not caplog.records


def test_a_raised_floor_moves_the_world_down(caplog: Log) -> None:
    cart = Body("cart", Pose((2.0, 2.0, 0.5)), (Shape("box", (0.2, 0.2, 0.2)),), 1.0)
    with caplog.at_level(logging.WARNING):
        world = place(GROUND, slab("slab", 0.3), slab("roof", 3.0), cart)
    assert [name for name, body in world.items() if body.is_ground] == ["ground", "slab"]
    heights = [body.pose.position[2] for body in world.values()]
    assert heights == pytest.approx([-0.3, -0.05, 2.65, 0.2])
    (message,) = caplog.messages
    assert "0.3 m" in message


def test_posts_of_one_height_at_home_and_waypoints_are_no_floor() -> None:
    places = [(0.0, 0.0), (5.0, 5.0), (5.0, -5.0), (-5.0, -5.0), (-5.0, 5.0)]
    posts = [
        Body(f"post {i}", Pose((x, y, 0.25)), (Shape("cylinder", (0.2, 0.5)),))
        for i, (x, y) in enumerate(places)
    ]
    world = place(GROUND, *posts)
    assert not any(body.floor for body in world.values())
    assert world["ground"] == GROUND


def test_rooms_of_several_slabs_make_one_floor() -> None:
    corners = [(5, 5), (5, -5), (-5, -5), (-5, 5)]
    slabs = [slab(f"room {i}", 0.1 + i * 1e-3, 10.0, x, y) for i, (x, y) in enumerate(corners)]
    world = place(*slabs)
    assert all(body.floor for body in world.values())
    assert len(world) == 4


def test_a_mat_on_the_ground_is_floor_and_moves_nothing() -> None:
    assert place(GROUND, slab("mat", 0.01, 2.0))["mat"] == Body(
        "mat", slab("mat", 0.01).pose, slab("mat", 0.01, 2.0).shapes, floor=True
    )
    assert not place(GROUND, slab("step", 0.02, 2.0, 2.0, 2.0))["step"].floor


def test_only_the_level_shapes_of_a_body_are_floor() -> None:
    wall = Shape("box", (20.0, 0.1, 2.0), Pose((0.0, 9.0, 1.0)))
    house = Body("house", Pose((0, 0, -0.05)), (Shape("box", (20.0, 20.0, 0.1)), wall))
    world = place(house)
    assert world["house"].shapes == (wall,)
    assert not world["house"].is_ground
    assert world["house::floor"].is_ground


def test_ground_is_added_where_the_course_stands_on_nothing(caplog: Log) -> None:
    with caplog.at_level(logging.WARNING):
        world = place(slab("pad", 0.0, 4.0))
    assert "(5, 5)" in caplog.text
    assert list(world) == ["ground", "pad"]


def test_the_height_of_tilted_ground_is_exact() -> None:
    plane = Body("g", Pose((1.0, 2.0, 0.5)), (Shape("plane", (-0.1, 0.2, 1.0)),))
    assert ground_height([plane], (3.0, 1.0)) == pytest.approx(0.5 + 0.1 * 2.0 + 0.2 * 1.0)
    rows = tuple(tuple(0.1 * x + 0.2 * y for x in range(5)) for y in range(3))
    field = Body("f", Pose((1.0, 2.0, 0.5)), (Shape("heightfield", (4.0, 2.0), heights=rows),))
    assert ground_height([field], (0.5, 2.25)) == pytest.approx(0.5 + 0.1 * 1.5 + 0.2 * 1.25)
    assert ground_height([field], (9.0, 2.0)) is None
