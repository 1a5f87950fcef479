"""Floors made of bodies, and worlds that are moved so that their floor is at 0."""

import logging

import pytest
from fixture_types import Log
from world_cases import GROUND, square

from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.floors import ground_height, settle


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
