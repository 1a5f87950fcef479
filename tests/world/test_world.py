"""Worlds: their ground, their obstacles, and what is refused."""

import logging
from pathlib import Path

import pytest
from fixture_types import Log
from world_cases import GROUND, box, square, world_of

from evoros.base.errors import InputError
from evoros.geometry.shapes import Body, Pose, Shape
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
