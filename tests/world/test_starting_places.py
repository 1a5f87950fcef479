"""Movable bodies that start in the air, in the ground or in each other."""

import logging
import math
from dataclasses import replace
from pathlib import Path

import pytest
from embedded_cases import random_bodies
from fixture_types import Log
from world_cases import GROUND, square, world_of

from evoros.config.compose import compose
from evoros.geometry.footprint import project_bodies
from evoros.geometry.overlap import Solid, overlap_depth
from evoros.geometry.shapes import Body, Pose, Shape, Vector
from evoros.world.lifting import SLACK_M, Solids, find_sunk
from evoros.world.loading import free_bodies, load_world
from evoros.world.model import World
from evoros.world.standing import outlines, standing_obstacles

CUBE = Shape("box", (0.4, 0.4, 0.4))
POST = Shape("cylinder", (0.075, 1.0))


def crate(name: str, *place: float, mass: float | None = 2.0, shape: Shape = CUBE) -> Body:
    x, y, z = place
    return Body(name, Pose((x, y, z)), (shape,), mass)


def freed(*bodies: Body) -> dict[str, Body]:
    return {body.name: body for body in free_bodies((GROUND, *bodies), "a.sdf")}


def heights(*bodies: Body) -> dict[str, float]:
    return {n: b.pose.position[2] for n, b in freed(*bodies).items() if n != "ground"}


def test_a_world_whose_bodies_touch_or_hardly_overlap_is_the_same() -> None:
    """The very same bodies, so that no bit of a mission changes."""
    bodies = (
        GROUND,
        crate("on the ground", 0.0, 0.0, 0.2),
        crate("beside it", 0.399, 0.0, 0.2),
        crate("on it", 0.0, 0.0, 0.599),
        crate("sunk by a millimetre", 3.0, 0.0, 0.199),
        crate("in the air", 3.0, 0.0, 2.0),
        crate("a wall", 0.2, 0.7, 0.2, mass=None),
        crate("a fixed body in it", 0.2, 0.9, 0.1, mass=None),
    )
    assert all(a is b for a, b in zip(free_bodies(bodies, "a.sdf"), bodies, strict=True))


@pytest.mark.parametrize("name", ["case_study", "rooms", "dense", "generated"])
def test_no_bundled_world_is_changed(name: str) -> None:
    for world in compose([f"world={name}", "simulator=planar"]).build().world.values():
        assert free_bodies(world.bodies, "x") == world.bodies


def test_half_buried_posts_are_set_on_the_ground_and_told_once(caplog: Log) -> None:
    """Posts that touch each other, as the walls of public benchmark worlds do."""
    posts = [crate(f"post_{i}", 0.15 * i, 0.0, 0.0, shape=POST) for i in range(20)]
    assert set(heights(*posts).values()) == {0.5}
    (line,) = caplog.messages
    assert line.startswith("a.sdf: 20 movable bodies start up to 0.5 m deep in the ground ")
    assert "in a body below ('post_0')" in line


def test_what_stands_on_a_sunk_body_is_lifted_with_it(caplog: Log) -> None:
    lifted = heights(
        crate("upper", 0.1, 0.0, 0.5),
        crate("sunk", 0.0, 0.0, 0.1),
        crate("alone", 2.0, 0.0, 0.2),
        crate("top", 0.2, 0.0, 0.9),
    )
    assert lifted == pytest.approx({"upper": 0.6, "sunk": 0.2, "alone": 0.2, "top": 1.0})
    assert "together with 2 on top" in caplog.text


def test_a_body_in_what_carries_it_is_lifted_onto_it() -> None:
    """The table is fixed, the lower crate is not; both carry."""
    table = crate("table", 0.0, 0.0, 0.35, mass=None, shape=Shape("box", (1.0, 1.0, 0.7)))
    lifted = heights(
        table,
        crate("on the table", 0.0, 0.0, 0.87),
        crate("lower", 2.0, 0.0, 0.2),
        crate("upper", 2.1, 0.0, 0.55),
    )
    assert lifted["on the table"] == pytest.approx(0.9)
    assert lifted["upper"] == pytest.approx(0.6)
    assert lifted["lower"] == 0.2


def test_the_ground_may_be_tilted_or_a_height_field() -> None:
    """A ball of 0.5 m touches a slope of 0.2 rad if its centre is 0.5 / cos(0.2) above it."""
    ball = Shape("sphere", (0.5,))
    slope = Body("slope", Pose.from_rpy((0.0, 0.0, 0.0), 0.0, -0.2, 0.0), GROUND.shapes)
    (_, lifted) = free_bodies((slope, crate("ball", 0.0, 0.0, 0.1, shape=ball)), "a.sdf")
    assert lifted.pose.position[2] == pytest.approx(0.5 / math.cos(0.2))
    # A field whose middle, at the origin, rises to 0.3 m between points at height 0.
    peak = ((0.0,) * 3, (0.0, 0.3, 0.0), (0.0,) * 3)
    field = Body("field", Pose(), (Shape("heightfield", (2.0, 2.0), heights=peak),))
    (_, lifted) = free_bodies((field, crate("crate", 0.0, 0.0, 0.2)), "a.sdf")
    assert lifted.pose.position[2] == pytest.approx(0.5)
    (_, lifted) = free_bodies((field, crate("ball", 0.0, 0.0, 0.2, shape=ball)), "a.sdf")
    assert lifted.pose.position[2] == pytest.approx(0.8, abs=0.005)


def test_bodies_that_overlap_at_the_side_move_as_one(caplog: Log) -> None:
    """Two cubes of 2 kg and 6 kg: the centre of mass is at three quarters of the way."""
    bodies = freed(crate("a", 0.0, 0.0, 0.2), crate("b", 0.36, 0.0, 0.2, mass=6.0))
    assert set(bodies) == {"ground", "a"}
    joined = bodies["a"]
    assert joined.mass == pytest.approx(8.0)
    assert joined.pose.position == pytest.approx((0.27, 0.0, 0.2))
    centres = sorted((joined.pose @ shape.pose).position for shape in joined.shapes)
    assert [x for x, _, _ in centres] == pytest.approx([0.0, 0.36])
    about = 8.0 * 0.4 * 0.4 / 6.0  # of both cubes about their centres; then by Huygens and Steiner
    moved = 2.0 * 0.27**2 + 6.0 * 0.09**2
    assert sorted(joined.inertia or ()) == pytest.approx([about, about + moved, about + moved])
    (line,) = caplog.messages
    assert line.startswith(
        "a.sdf: 2 movable bodies start up to 0.04 m deep inside each other ('a' in"
    )
    assert "they move as one body" in line


def test_what_overlaps_a_fixed_body_at_the_side_is_fixed(caplog: Log) -> None:
    """With all that overlaps it in turn, but not what only touches it."""
    bodies = freed(
        crate("wall", 0.0, 0.0, 1.0, mass=None, shape=Shape("box", (0.1, 4.0, 2.0))),
        crate("in the wall", 0.2, 0.0, 0.2),
        crate("in that", 0.5, 0.0, 0.2),
        crate("beside that", 0.9, 0.0, 0.2),
    )
    movable = {name for name, body in bodies.items() if body.mass is not None}
    assert movable == {"beside that"}
    (line,) = caplog.messages
    assert "deep in fixed bodies, directly or through other bodies" in line
    assert "('in the wall' in 'wall')" in line


def test_a_body_without_room_above_stays_in_the_ground(caplog: Log) -> None:
    ceiling = crate("ceiling", 0.0, 0.0, 0.5, mass=None, shape=Shape("box", (2.0, 2.0, 0.2)))
    bodies = freed(ceiling, crate("stuck", 0.0, 0.0, 0.0, shape=Shape("box", (0.4, 0.4, 0.6))))
    assert bodies["stuck"].mass is None
    assert bodies["stuck"].pose.position[2] == 0.0
    assert "('stuck' in the ground)" in caplog.text


@pytest.mark.parametrize("seed", range(30))
def test_random_bodies_are_apart_afterwards(seed: int) -> None:
    """No mass is lost, fixed bodies stay, and a second look changes nothing."""
    before = (GROUND, *random_bodies(seed))
    after = free_bodies(before, "a.sdf")
    assert free_bodies(after, "a.sdf") == after
    assert not find_sunk(after, Solids.of(after))
    solids = [(b, Solid.at(s, b.pose @ s.pose)) for b in after[1:] for s in b.shapes]
    for i, (body, solid) in enumerate(solids):
        for other, second in solids[:i]:
            if other is not body and not other.mass is body.mass is None:
                assert overlap_depth(solid, second) <= SLACK_M
    assert {body for body in before if body.mass is None} <= set(after)
    assert sum(len(body.shapes) for body in after) == sum(len(body.shapes) for body in before)
    movable = sum(body.mass or 0.0 for body in after)
    assert movable <= sum(body.mass or 0.0 for body in before) * (1.0 + 1e-12)


def test_a_file_is_told_by_its_name(tmp_path: Path, caplog: Log) -> None:
    """In the simulated world, in its SDF and in what a person is told."""
    ball = "<geometry><sphere><radius>0.5</radius></sphere></geometry>"
    path = tmp_path / "ball.sdf"
    path.write_text(
        "<sdf version='1.7'><world name='w'><model name='ball'><pose>2 0 0.1 0 0 0</pose>"
        f"<link name='l'><collision name='c'>{ball}</collision></link></model></world></sdf>"
    )
    with caplog.at_level(logging.WARNING):
        world = load_world(str(path), square())
    place: Vector = world.obstacles[0].pose.position
    assert place == pytest.approx((2.0, 0.0, 0.5))
    assert f"{path}: 1 movable body starts up to 0.4 m deep in the ground" in caplog.text
    assert "2 0 0.5" in world.sdf


BOX = (Shape("box", (0.4, 0.4, 0.4)),)
TABLE = (
    Shape("box", (1.0, 1.0, 0.1), Pose((0.0, 0.0, 0.75))),
    Shape("box", (0.1, 0.1, 0.7), Pose((0.4, 0.4, 0.35))),
)


def hung(name: str, x: float, y: float, z: float, mass: float | None = 2.0) -> Body:
    return Body(name, Pose((x, y, z)), BOX, mass)


def standing_heights(world: World) -> dict[str, float]:
    return {body.name: body.pose.position[2] for body in standing_obstacles(world)}


def test_bodies_fall_onto_ground_tables_and_each_other() -> None:
    """A crate is 0.4 m high: it rests 0.2 m above what carries it."""
    world = world_of(
        GROUND,
        Body("table", Pose((2.0, 2.0, 0.0)), TABLE),
        hung("above ground", -2.0, 0.0, 1.5),
        hung("above table", 2.1, 2.0, 3.0),
        hung("above both", 2.1, 2.1, 5.0),
        hung("beside the table", 2.7, 2.0, 1.0),
        hung("fixed", -2.0, 3.0, 1.0, None),
        hung("on the ground", 2.0, -2.0, 0.2),
    )
    assert standing_heights(world) == pytest.approx(
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
        hung("sunk", 1.0, 0.0, 0.19),
        hung("on a rounding error", 2.0, 0.0, 0.2 + 1e-9),
        hung("held", 3.2, 0.0, 0.5),
        Body("shelf", Pose((3.0, 0.0, 0.4)), BOX),
    )
    for body, other in zip(standing_obstacles(world), world.obstacles, strict=True):
        assert body is other


def test_a_body_that_fell_is_in_the_way() -> None:
    world = world_of(GROUND, hung("high", 2.0, 2.0, 4.0))
    assert len(project_bodies(world.obstacles, 0.3)) == 0
    assert len(outlines(world, 0.3).rows) == 1


def test_obstacles_on_a_slope_stand_on_it() -> None:
    """The ground rises by 0.1 rad along x, so that a post 10 m away begins 1 m higher."""
    slope = Body("slope", Pose.from_rpy((0.0, 0.0, 0.0), 0.0, -0.1, 0.0), GROUND.shapes)
    rise = 10.0 * math.tan(0.1)
    post = Body("post", Pose((10.0, 0.0, rise + 0.5)), (Shape("cylinder", (0.1, 1.0)),))
    falling = hung("falling", 10.0, 5.0, rise + 3.2)
    world = world_of(slope, post, falling, course=square())
    assert standing_heights(world) == pytest.approx({"post": 0.5, "falling": 0.2})
    assert len(outlines(world, 0.3).rows) == 2


def test_obstacles_of_300_worlds_in_turn_are_found_once() -> None:
    world = world_of(GROUND, hung("crate", 2.0, 0.0, 1.0))
    worlds = [replace(world, source_sha256=f"{number}") for number in range(300)]
    first = [(standing_obstacles(one), outlines(one, 0.5)) for one in worlds]
    for one, (standing, areas) in zip(worlds, first, strict=True):
        assert standing_obstacles(one) is standing
        assert outlines(one, 0.5) is areas
