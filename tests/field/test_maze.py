"""Mazes and objects of two sizes: what they promise, their files, and what is refused."""

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from field_cases import areas
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.field.drawn import FIXED
from evoros.field.maze import FILL, KEEP, OPEN, Doors, Maze, generate_maze
from evoros.field.objects import BEHIND_M, Objects, generate_objects
from evoros.formats.sdf.reader import read_sdf
from evoros.geometry.footprint import distances
from evoros.geometry.free_space import CELL_M, FreeSpace, find_connected
from evoros.world.course import Course
from evoros.world.model import World

unhurried = settings(max_examples=15)
WALL_M = 0.2


def maze(columns: int = 5, rows: int = 3, width: float = 2.0, **changes: Any) -> Maze:
    """A maze whose course leads from corner to corner, about a point off the origin."""
    end = (width + WALL_M) * (np.array([columns, rows]) - 1.0) + (1.0, -2.0)
    course = Course(1.0, -2.0, 0.08, 0.0, [end.tolist()], 1.0, 60.0, "one_way", True)
    return replace(Maze(course, columns, rows, width, WALL_M, 0.5, FILL), **changes)


@st.composite
def mazes(draw: st.DrawFn) -> Maze:
    size = st.integers(2, 6)
    return maze(
        draw(size),
        draw(size),
        draw(st.sampled_from([0.8, 2.0])),
        dead_ends=draw(st.sampled_from([KEEP, OPEN, FILL])),
        seed=draw(st.integers(0, 10**6)),
    )


def reach(doors: Doors, start: tuple[int, int]) -> set[tuple[int, int]]:
    found, waiting = {start}, [start]
    while waiting:
        for near in doors[waiting.pop()] - found:
            found.add(near)
            waiting.append(near)
    return found


def test_equal_seeds_and_draws_give_equal_bytes_and_others_other_mazes() -> None:
    made = [
        maze(6, 6, seed=seed).draw_world(draws).sdf for seed in (0, 1) for draws in (FIXED, "a")
    ]
    assert len(set(made)) == 4
    assert Maze(**vars(maze(6, 6))).draw_bodies("a") == maze(6, 6).draw_bodies("a")
    read = read_sdf(made[0].encode(), "a file").bodies
    assert read == maze(6, 6).draw_world(FIXED).bodies


@unhurried
@given(mazes())
def test_doors_are_mutual_and_dead_ends_are_as_asked(one: Maze) -> None:
    doors = one.draw_doors("x")
    assert all(cell in doors[near] for cell in doors for near in doors[cell])
    assert all(abs(a - c) + abs(b - d) == 1 for a, b in doors for c, d in doors[a, b])
    home, goal = one.route
    counts = {cell: len(near) for cell, near in doors.items()}
    reached, edges = reach(doors, home), sum(counts.values()) // 2
    assert goal in reached
    if one.dead_ends == FILL:
        assert edges == len(reached) - 1
        ends = {cell for cell, count in counts.items() if count == 1}
        assert ends == {home, goal}
        assert set(counts.values()) <= {0, 1, 2}
        return
    assert reached == set(doors)
    if one.dead_ends == KEEP:
        assert edges == len(doors) - 1  # connected without a loop
    else:
        assert min(counts.values()) >= 2


@unhurried
@given(mazes())
def test_a_robot_reaches_exactly_the_cells_with_doors(one: Maze) -> None:
    """A disc that nearly fills a corridor reaches each of them, and nothing outside."""
    radius = one.corridor_m / 2 - 1.5 * CELL_M
    corners = one.centre((-1, -1)), one.centre((one.columns, one.rows))
    low, high = corners[0] - one.pitch_m, corners[1] + one.pitch_m
    space = FreeSpace.within(low, high, areas(one.draw_world("x").obstacles), radius)

    def place(cell: tuple[int, int]) -> tuple[int, int]:
        column, row = np.floor((one.centre(cell) - low) / CELL_M).astype(int).tolist()
        return row, column

    connected = find_connected(space.free, place(one.route[0]))
    inside = {cell for cell, near in one.draw_doors("x").items() if near}
    around = range(-1, one.columns + 1), range(-1, one.rows + 1)
    cells = {(x, y) for x in around[0] for y in around[1]}
    assert {cell for cell in cells if connected[place(cell)]} == inside


@unhurried
@given(mazes())
def test_a_wall_stands_between_cells_without_a_door_and_none_in_a_door(one: Maze) -> None:
    doors, solid = one.draw_doors("x"), areas(one.draw_bodies("x"))
    for (x, y), near in doors.items():
        for other in ((x + 1, y), (x, y + 1)):
            middle = (one.centre((x, y)) + one.centre(other)) / 2
            gap = min(distances(area, middle[None])[0] for area in solid)
            if other in near:
                assert gap >= one.corridor_m / 2 - 1e-5  # more where four cells have no wall
            elif near or doors.get(other):
                assert gap == 0.0


@cache
def configured_maze() -> Maze:
    """The distribution of ``world=mazes``."""
    sampler = compose(["world=mazes", "world.mazes.renew=true"]).build().world["mazes"].sampler
    assert isinstance(sampler, Maze)
    return sampler


@unhurried
@given(st.integers(0, 10**6))
def test_the_corridor_visits_the_waypoints_in_their_order(seed: int) -> None:
    one = replace(configured_maze(), seed=seed)
    doors, way = one.draw_doors(FIXED), [one.route[0]]
    while len(way) < 2 or len(doors[way[-1]]) > 1:
        way += [cell for cell in doors[way[-1]] if cell not in way[-2:]]
    places = [way.index(cell) for cell in one.route]
    assert all(before < after for before, after in pairwise(places))
    assert places[-1] == len(way) - 1


def test_missions_with_other_draws_meet_other_mazes() -> None:
    values = vars(maze(6, 6))
    fixed, renewed = generate_maze(**values), generate_maze(**values, renew=True)
    assert fixed.at("a") is fixed.at("b") is fixed
    assert renewed.at("a").bodies != renewed.at("b").bodies
    assert renewed.at("a").bodies == renewed.at("a").bodies
    with pytest.raises(InputError, match=r"^generate_maze\.renew: [^\n]*, not [^\n]+$"):
        generate_maze(**values, renew="yes")  # type: ignore[arg-type]


OFF = Course(0.0, 0.0, 0.1, 0.0, [[4.9, 0.0]], 1.0, 60.0, "forward", True)
CROSSED = Course(0.0, 0.0, 0.1, 0.0, [[4.4, 0.0], [2.2, 0.0]], 1.0, 60.0, "forward", True)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"columns": 0}, "columns"),
        ({"columns": 1, "rows": 1}, "columns"),
        ({"rows": 2.5}, "rows"),
        ({"corridor_m": 0.0}, "corridor_m"),
        ({"wall_m": 0.0}, "wall_m"),
        ({"wall_height_m": -1.0}, "wall_height_m"),
        ({"dead_ends": "none"}, "dead_ends"),
        ({"seed": -1}, "seed"),
        ({"columns": 4}, "course"),  # home is between two cells
        ({"columns": 3}, "course"),  # home is outside
        ({"course": OFF}, "course"),
        ({"course": CROSSED, "columns": 3, "rows": 1}, r"course\.waypoints"),
    ],
)
def test_a_bad_parameter_is_named(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(InputError, match=rf"^Maze\.{key}: [^\n]*, not [^\n]+$"):
        replace(maze(), **changes).draw_world(FIXED)


COURSE = Course(1.0, -2.0, 0.08, 0.3, [[3.0, -2.0]], 0.5, 25.0, "one_way", True)
SCENE = Objects(COURSE, 0.2, 1.0, 2, [1.5, 2.5], 60.0, 0.5)
patient = settings(deadline=None, max_examples=30)


def places(world: World) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """The distances [m] and bearings [rad] of the objects from home."""
    offsets = np.array([b.pose.position[:2] for b in world.obstacles]) - world.course.home[:2]
    return np.hypot(*offsets.T), np.arctan2(offsets[:, 1], offsets[:, 0])


@patient
@given(st.integers(0, 10**6), st.integers(1, 3), st.floats(0.0, 55.0))  # room for three
def test_objects_are_apart_and_at_their_distances(seed: int, decoys: int, apart: float) -> None:
    one = replace(SCENE, seed=seed, decoys=decoys, apart_deg=apart)
    world = one.draw_world("x")
    far, bearings = places(world)
    assert [body.name.split("_")[0] for body in world.obstacles] == ["target", *["decoy"] * decoys]
    assert far[0] == pytest.approx(2.0 + BEHIND_M + one.target_m / 2, abs=1e-3)
    assert bearings[0] == pytest.approx(0.0, abs=1e-3)
    nearest = far[1:] - one.decoy_m / 2
    assert ((nearest >= 1.5 - 1e-3) & (nearest <= 2.5 + 1e-3)).all()
    for i, bearing in enumerate(bearings):
        turns = np.abs(np.angle(np.exp(1j * (bearings[i + 1 :] - bearing))))
        assert (np.degrees(turns) >= apart - 0.1).all()
    goal = np.array(one.course.waypoints[0])
    decoy_places = [np.array(body.pose.position[:2]) for body in world.obstacles[1:]]
    assert all(np.linalg.norm(place - goal) > 0.5 + 0.5 - 1e-3 for place in decoy_places)
    sizes = [body.shapes[0].size[0] for body in world.obstacles]
    assert sizes == [0.1, *[0.5] * decoys]


def test_equal_seeds_and_draws_give_equal_bytes_and_others_other_decoys() -> None:
    made = [replace(SCENE, seed=s).draw_world(d).sdf for s in (0, 1) for d in (FIXED, "a")]
    assert len(set(made)) == 4
    assert Objects(**vars(SCENE)).draw_bodies("a") == SCENE.draw_bodies("a")
    assert read_sdf(made[0].encode(), "a file").bodies == SCENE.draw_world(FIXED).bodies
    fixed, renewed = generate_objects(**vars(SCENE)), generate_objects(**vars(SCENE), renew=True)
    assert fixed.at("a") is fixed
    assert renewed.at("a").bodies != renewed.at("b").bodies
    with pytest.raises(InputError, match=r"^generate_objects\.renew: [^\n]*, not [^\n]+$"):
        generate_objects(**vars(SCENE), renew="yes")  # type: ignore[arg-type]


@cache
def configured() -> dict[str, World]:
    return dict(compose(["experiment=eyes_detection"]).build().world)


def test_the_six_worlds_show_the_narrow_object_on_all_sides_and_share_their_numbers() -> None:
    worlds = configured()
    bearings = [places(world)[1][0] - world.course.home_yaw_rad for world in worlds.values()]
    assert sorted(np.degrees(bearings).round()) == [-150, -90, -30, 30, 90, 150]
    samplers = [world.sampler for world in worlds.values()]
    assert all(isinstance(sampler, Objects) for sampler in samplers)
    numbers = [{k: v for k, v in vars(sampler).items() if k != "course"} for sampler in samplers]
    assert all(values == numbers[0] for values in numbers)


def test_decoys_are_everywhere_that_is_allowed() -> None:
    one = replace(SCENE, decoys=1)
    drawn = [float(places(one.draw_world(str(key)))[1][1]) for key in range(200)]
    shares = np.histogram(np.mod(drawn, 2 * math.pi), 4, (math.pi / 3, 5 * math.pi / 3))[0] / 200
    assert shares.sum() == 1.0
    assert (np.abs(shares - 0.25) < 0.12).all()  # four standard deviations


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"target_m": 0.0}, "target_m"),
        ({"decoy_m": -1.0}, "decoy_m"),
        ({"decoys": 0}, "decoys"),
        ({"decoys": 6}, "apart_deg"),  # no room: six of 60 deg besides the narrow one
        ({"distance_m": [0.0, 1.0]}, "distance_m"),
        ({"apart_deg": 181.0}, "apart_deg"),
        ({"height_m": 0.0}, "height_m"),
        ({"seed": -1}, "seed"),
        ({"course": replace(COURSE, waypoints=[[1.0, -2.0]])}, "course"),
    ],
)
def test_a_bad_parameter_of_objects_is_named(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(InputError, match=rf"^Objects\.{key}: [^\n]*, not [^\n]+$"):
        replace(SCENE, **changes).draw_world(FIXED)
