"""Generated worlds: what a field promises, what is refused, and their files."""

import math
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from field_cases import BARRELS, CRATES, KINDS, LIGHT, POSTS, areas, course, field, fields, noted
from hypothesis import given, settings

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.field.drawn import FIXED
from evoros.field.generated import Field
from evoros.field.obstacles import Box, Cylinder, Passage
from evoros.files.resources import bundled_folder
from evoros.formats.sdf.reader import read_sdf
from evoros.geometry.footprint import Footprint, bottom_height, distances, project_shape
from evoros.geometry.free_space import FreeSpace, find_connected
from evoros.geometry.shapes import Pose, Shape
from evoros.world.model import World


def border(area: Footprint) -> Array:
    """Points (n, 2) on the border of a footprint, 2 cm apart or less."""
    if area.radius:
        turn = np.linspace(0.0, 2 * math.pi, 64)
        circle: Array = area.vertices[0] + area.radius * np.column_stack(
            (np.cos(turn), np.sin(turn))
        )
        return circle
    ends = np.roll(area.vertices, -1, axis=0)
    part = np.linspace(0.0, 1.0, 100)[:, None]
    return np.vstack([a + part * (b - a) for a, b in zip(area.vertices, ends, strict=True)])


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(fields())
def test_a_field_keeps_its_promises(one: Field) -> None:
    world = one.draw_world(FIXED)
    walls = [body for body in world.obstacles if body.name.startswith("wall_")]
    obstacles = tuple(body for body in world.obstacles if body not in walls)
    assert len(walls) == 4 * one.enclosed
    assert len(obstacles) == round(one.density * one.extent_m[0] * one.extent_m[1])
    places = np.array([one.course.home[:2], *one.course.waypoints])
    low, high = one.corners
    np.testing.assert_allclose((low + high) / 2, (places.min(axis=0) + places.max(axis=0)) / 2)
    np.testing.assert_allclose(high - low, one.extent_m)
    courses = (one.course, *one.others)
    places = np.array(
        [place for course in courses for place in (course.home[:2], *course.waypoints)]
    )
    keep = one.gap_m if one.enclosed else 0.0
    all_areas = areas(obstacles)
    for i, area in enumerate(all_areas):
        points = border(area)
        assert (points >= low + keep - 1e-9).all()
        assert (points <= high - keep + 1e-9).all()
        assert distances(area, places).min() >= one.clearing_m
        for other in all_areas[i + 1 :]:
            apart = distances(other, points).min()
            assert apart > 0
            assert apart >= one.gap_m - 1e-9
    for body in obstacles:
        assert bottom_height(body.shapes[0], body.pose) == pytest.approx(0.0, abs=1e-9)


def is_passable(one: Field) -> bool:
    """Whether a disc of the promised width, but for a cell, comes to all stops of each course."""
    solid = areas(one.draw_world(FIXED).bodies)
    space = FreeSpace.within(*one.corners, solid, one.passage_m / 2 - 0.05, cell_m=0.05)
    for way in (one.course, *one.others):
        stops = np.array([way.home[:2], *way.waypoints])
        rows = np.floor((stops - space.low) / 0.05).astype(int)[:, ::-1].tolist()
        reached = find_connected(space.free, tuple(rows[0]))
        if not all(reached[tuple(row)] for row in rows):
            return False
    return True


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(fields())
def test_a_way_of_the_promised_width_leads_along_each_leg(one: Field) -> None:
    assert is_passable(one)


def test_a_closed_way_stays_open() -> None:
    """A wall with a door: what would close it is left out, what stands beside it is not."""
    low, high = np.array([-4.0, -2.0]), np.array([4.0, 2.0])
    places = np.array([[-3.0, 0.0], [3.0, 0.0]])

    def wall(y: float, length: float) -> Footprint:
        return project_shape(Shape("box", (0.2, length, 1.0)), Pose((0.0, y, 0.5)))

    for width, open_ in ((0.5, True), (0.7, True), (1.3, False)):
        passage = Passage(low, high, [places], width)
        assert passage.add(wall(-1.4, 1.6))  # from y = -2.2 to -0.6
        assert passage.add(wall(1.4, 1.6)) == open_
        assert not passage.add(wall(0.0, 5.0))


def test_kinds_come_by_their_shares_and_sizes() -> None:
    big = field(extent_m=[40.0, 40.0], density=0.25, gap_m=0.0)
    bodies = [b for b in big.draw_world(FIXED).obstacles if not b.name.startswith("wall_")]
    count = {name: sum(b.name.startswith(name) for b in bodies) for name in KINDS}
    total = sum(kind.share for kind in KINDS.values())
    for name, kind in KINDS.items():
        assert count[name] / len(bodies) == pytest.approx(kind.share / total, abs=0.07)
    sizes = np.array([b.shapes[0].size for b in bodies if b.name.startswith("crates")])
    assert sizes.min() >= 0.3
    assert sizes.max() <= 0.8
    assert sizes.mean() == pytest.approx(0.55, abs=0.03)
    yaw = np.array([b.pose.yaw for b in bodies])
    assert abs(np.exp(1j * yaw).mean()) < 0.15  # all headings


def test_movable_obstacles_have_the_inertia_of_their_shape() -> None:
    for body in field(kinds={"light": LIGHT, "barrels": BARRELS}).draw_world(FIXED).obstacles:
        if body.name.startswith("wall_"):
            assert body.mass is None
            continue
        (shape,) = body.shapes
        assert body.mass == (5.0 if shape.kind == "box" else 8.0)
        if shape.kind == "box":
            x, y, z = shape.size
            squares = ((y, z), (x, z), (x, y))
            expected = [5.0 / 12 * (a * a + b * b) for a, b in squares]
        else:
            r, h = shape.size
            expected = [8.0 / 12 * (3 * r * r + h * h)] * 2 + [8.0 / 2 * r * r]
        assert body.inertia == pytest.approx(expected, rel=1e-8)


# ---- What is refused.


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"density": -0.1}, "density"),
        ({"density": 3.0}, "density"),  # no room
        ({"extent_m": [14.0]}, "extent_m"),
        ({"extent_m": [11.0, 14.0]}, "extent_m"),  # a waypoint's clearing would reach out
        ({"clearing_m": 0.7}, "clearing_m"),
        ({"passage_m": 0.0}, "passage_m"),
        ({"gap_m": -1.0}, "gap_m"),
        ({"kinds": {}}, "kinds"),
        ({"kinds": {"a b": CRATES}}, "kinds"),
        ({"kinds": {"a": 3}}, "kinds"),
        ({"enclosed": 1}, "enclosed"),
        ({"seed": -1}, "seed"),
    ],
)
def test_a_bad_parameter_is_named(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(InputError, match=rf"^Field\.{key}: [^\n]*, not [^\n]+$"):
        field(**changes).draw_world(FIXED)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Box(0.0, 1.0, 1.0),
        lambda: Box([1.0, 0.5], 1.0, 1.0),
        lambda: Box(1.0, 1.0, 1.0, share=0.0),
        lambda: Cylinder(1.0, -1.0),
        lambda: Cylinder(1.0, 1.0, mass_kg=0.0),
    ],
)
def test_a_bad_kind_is_refused(make: Any) -> None:
    with pytest.raises(InputError, match=r"^(Box|Cylinder)\.\w+: [^\n]*, not [^\n]+$"):
        make()


def test_a_corridor_full_of_posts_has_a_way_through() -> None:
    narrow = field(
        course=course([[8.0, 0.0]]), extent_m=[11.0, 2.4], density=0.4, kinds={"posts": POSTS}
    )
    for seed in range(5):
        one = Field(**{**vars(narrow), "seed": seed})
        assert is_passable(one)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_in_another_process() -> None:
    code = (
        "from evoros.config.compose import compose\n"
        "experiment = compose(['world=generated', 'executor=serial']).build()\n"
        "print(experiment.world['generated'].sdf, end='')"
    )
    other = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={}
    )
    here = compose(["world=generated", "executor=serial"]).build().world["generated"]
    assert other.stdout == here.sdf


def test_every_seed_and_every_key_of_draws_gives_another_field() -> None:
    made = [
        field(seed=seed).draw_world(draws).source_sha256 for seed in (0, 1) for draws in ("a", "b")
    ]
    assert len(set(made)) == 4
    assert field().draw_world("a") is field().draw_world("a")  # kept, not drawn again


@settings(max_examples=10, deadline=None)
@given(fields())
def test_the_file_is_the_world_in_every_bit(one: Field) -> None:
    world = one.draw_world(FIXED)
    assert read_sdf(world.sdf.encode(), "a file").bodies == world.bodies
    again = World("generated", read_sdf(world.sdf.encode(), "a file").bodies, one.course, "x", "y")
    assert again.sdf == world.sdf.replace(f"<!-- {world.note} -->\n", "")


def test_the_comment_is_enough_to_make_the_file_again() -> None:
    for one, draws in ((field(kinds={"a--b": CRATES}), "0/selection/3/x--y/1"), (field(), FIXED)):
        sdf = one.draw_world(draws).sdf
        made, key = noted(sdf)
        assert (made, key) == (one, draws)
        assert made.draw_world(key).sdf == sdf


def test_the_comment_does_not_name_the_place_of_a_class() -> None:
    moved = type("Box", (Box,), {"__module__": "elsewhere"})
    one = field(kinds={"crates": moved(**vars(CRATES))})
    assert one.draw_world(FIXED).sdf == field(kinds={"crates": CRATES}).draw_world(FIXED).sdf


DENSE = ("dense_crates", "dense_barrels", "dense_mixed")


@pytest.mark.slow
@pytest.mark.parametrize("name", DENSE)
def test_the_dense_fields_are_what_their_comments_say(name: str) -> None:
    content = (bundled_folder("worlds") / f"{name}.sdf").read_text()
    made, draws = noted(content)
    drawn = made.draw_world(draws)
    assert drawn.sdf == content
    experiment = compose(["world=dense"]).build()
    assert tuple(experiment.world) == DENSE
    assert experiment.world[name].bodies == drawn.bodies
