"""Movable bodies in the air, set down onto what is below them."""

import math
from dataclasses import replace

import pytest
from world_cases import GROUND, square, world_of

from evoros.geometry.footprint import project_bodies
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.model import World
from evoros.world.standing import outlines, standing_obstacles

BOX = (Shape("box", (0.4, 0.4, 0.4)),)
TABLE = (
    Shape("box", (1.0, 1.0, 0.1), Pose((0.0, 0.0, 0.75))),
    Shape("box", (0.1, 0.1, 0.7), Pose((0.4, 0.4, 0.35))),
)


def crate(name: str, x: float, y: float, z: float, mass: float | None = 2.0) -> Body:
    return Body(name, Pose((x, y, z)), BOX, mass)


def heights(world: World) -> dict[str, float]:
    return {body.name: body.pose.position[2] for body in standing_obstacles(world)}


def test_bodies_fall_onto_ground_tables_and_each_other() -> None:
    """A crate is 0.4 m high: it rests 0.2 m above what carries it."""
    world = world_of(
        GROUND,
        Body("table", Pose((2.0, 2.0, 0.0)), TABLE),
        crate("above ground", -2.0, 0.0, 1.5),
        crate("above table", 2.1, 2.0, 3.0),
        crate("above both", 2.1, 2.1, 5.0),
        crate("beside the table", 2.7, 2.0, 1.0),
        crate("fixed", -2.0, 3.0, 1.0, None),
        crate("on the ground", 2.0, -2.0, 0.2),
    )
    assert heights(world) == pytest.approx(
        {
            "table": 0.0,
            "above ground": 0.2,
            "above table": 1.0,
            "above both": 1.4,
            "beside the table": 0.2,
            "fixed": 1.0,
            "on the ground": 0.2,
        }
    )


def test_bodies_that_stand_are_those_of_the_world() -> None:
    """Not copies, whose last bits might differ; a sunken body and one held by another stay."""
    world = world_of(
        GROUND,
        crate("sunk", 1.0, 0.0, 0.19),
        crate("on a rounding error", 2.0, 0.0, 0.2 + 1e-9),
        crate("held", 3.2, 0.0, 0.5),
        Body("shelf", Pose((3.0, 0.0, 0.4)), BOX),
    )
    for body, other in zip(standing_obstacles(world), world.obstacles, strict=True):
        assert body is other


def test_a_body_that_fell_is_in_the_way() -> None:
    """From above the robot's height to the ground."""
    world = world_of(GROUND, crate("high", 2.0, 2.0, 4.0))
    assert len(project_bodies(world.obstacles, 0.3)) == 0
    assert len(outlines(world, 0.3).rows) == 1


def test_obstacles_on_a_slope_stand_on_it() -> None:
    """The ground rises by 0.1 rad along x, so that a post 10 m away begins 1 m higher."""
    slope = Body("slope", Pose.from_rpy((0.0, 0.0, 0.0), 0.0, -0.1, 0.0), GROUND.shapes)
    rise = 10.0 * math.tan(0.1)
    post = Body("post", Pose((10.0, 0.0, rise + 0.5)), (Shape("cylinder", (0.1, 1.0)),))
    falling = crate("falling", 10.0, 5.0, rise + 3.2)
    world = world_of(slope, post, falling, course=square())
    assert heights(world) == pytest.approx({"post": 0.5, "falling": 0.2})
    assert len(outlines(world, 0.3).rows) == 2


def test_obstacles_of_300_worlds_in_turn_are_found_once() -> None:
    world = world_of(GROUND, crate("crate", 2.0, 0.0, 1.0))
    worlds = [replace(world, source_sha256=f"{number}") for number in range(300)]
    first = [(standing_obstacles(one), outlines(one, 0.5)) for one in worlds]
    for one, (standing, areas) in zip(worlds, first, strict=True):
        assert standing_obstacles(one) is standing
        assert outlines(one, 0.5) is areas
