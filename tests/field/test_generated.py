"""Generated worlds: what they promise, their SDF, and new worlds from the draws of missions."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from evoros.analysis.drawing.worlds import draw_worlds
from helpers import USER_PARTS, content, tiny
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.base.resources import bundled_folder
from evoros.cli.world import evoros_world
from evoros.config.compose import compose
from evoros.design.design import Design
from evoros.field.generated import FIXED, Field, generate_world
from evoros.field.kinds import Box, Cylinder, ObstacleKind
from evoros.field.passage import Passage
from evoros.formats.sdf.reader import read_sdf
from evoros.formats.sdf.writer import write_sdf
from evoros.geometry.footprint import Footprint, bottom_height, distances, project_shape
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.mission.plan import Plan
from evoros.session.replay import replay
from evoros.storage.reading import load_run
from evoros.world.course import Course
from evoros.world.loading import load_world
from evoros.world.model import World

SQUARE = [[5.0, 5.0], [5.0, -5.0], [-5.0, -5.0], [-5.0, 5.0]]
CRATES = Box([0.3, 0.8], [0.3, 0.8], [0.3, 0.8])
POSTS = Cylinder([0.1, 0.3], 1.0)
LIGHT = Box([0.2, 0.4], 0.2, 0.2, 0.5, mass_kg=5.0)
BARRELS = Cylinder(0.4, [0.3, 0.9], 0.5, mass_kg=8.0)
KINDS: dict[str, ObstacleKind] = {
    "crates": CRATES,
    "posts": POSTS,
    "light": LIGHT,
    "barrels": BARRELS,
}


def course(waypoints: Any = SQUARE, x: float = 0.0, y: float = 0.0) -> Course:
    return Course(x, y, 0.08, 1.562, waypoints, 1.0, 540.0, "random", True)


def field(**changes: Any) -> Field:
    values: dict[str, Any] = {
        "course": course(),
        "extent_m": [14.0, 14.0],
        "density": 0.25,
        "kinds": KINDS,
        "clearing_m": 1.0,
        "gap_m": 0.3,
        "passage_m": 0.9,
        "enclosed": True,
    }
    return Field(**(values | changes))


@st.composite
def fields(draw: st.DrawFn) -> Field:
    gap = draw(st.sampled_from([0.0, 0.2, 0.5]))
    return field(
        course=course(draw(st.sampled_from([SQUARE, [[3.0, 1.0]]])), 1.0, -2.0),
        extent_m=[draw(st.sampled_from([14.0, 16.5])), 15.3],
        density=draw(st.sampled_from([0.0, 0.1, 0.25])),
        gap_m=gap,
        passage_m=draw(st.sampled_from([0.6, 0.9, 1.2])),
        enclosed=draw(st.booleans()),
        seed=draw(st.integers(0, 10**6)),
    )


def areas(bodies: tuple[Body, ...]) -> list[Footprint]:
    return [project_shape(s, b.pose @ s.pose) for b in bodies for s in b.shapes if not b.is_ground]


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


# ---- What a field promises.


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


@settings(max_examples=12, deadline=None)
@given(fields())
def test_a_way_of_the_promised_width_leads_along_each_leg(one: Field) -> None:
    world = one.draw_world(FIXED)
    ways = one.find_ways(world.bodies)
    home = one.course.home[:2]
    places = [home, *one.course.waypoints, home]
    assert len(ways) == len(places) - 1
    solid = areas(world.bodies)
    for way, start, goal in zip(ways, places, places[1:], strict=False):
        np.testing.assert_array_equal(way[[0, -1]], [start, goal])
        steps = np.diff(way, axis=0)
        assert np.sqrt((steps**2).sum(axis=1)).max() < 0.3
        part = np.linspace(0.0, 1.0, 10)[:, None, None]
        points = (way[:-1] + part * steps).reshape(-1, 2)
        for area in solid:
            assert distances(area, points).min() >= one.passage_m / 2


def test_a_closed_way_stays_open() -> None:
    """A wall with a door: what would close it is left out, what stands beside it is not."""
    low, high = np.array([-4.0, -2.0]), np.array([4.0, 2.0])
    places = np.array([[-3.0, 0.0], [3.0, 0.0]])

    def wall(y: float, length: float) -> Footprint:
        return project_shape(Shape("box", (0.2, length, 1.0)), Pose((0.0, y, 0.5)))

    for width, open_ in ((0.5, True), (0.7, True), (1.3, False)):
        passage = Passage(low, high, places, width)
        assert passage.add(wall(-1.4, 1.6))  # from y = -2.2 to -0.6
        assert passage.add(wall(1.4, 1.6)) == open_
        assert not passage.add(wall(0.0, 5.0))
        (way,) = passage.ways
        assert np.abs(way[np.abs(way[:, 0]) < 0.3, 1]).max() < (0.6 if open_ else 2.2)


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


# ---- Determinism, SDF.


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
    assert read_sdf(world.sdf.encode(), "a file") == world.bodies
    again = World("generated", read_sdf(world.sdf.encode(), "a file"), one.course, "x", "y")
    assert again.sdf == world.sdf.replace(f"<!-- {world.note} -->\n", "")


def noted(sdf: str) -> tuple[Field, str]:
    """The field and the key of draws that an SDF file names."""
    comment = sdf[sdf.index("<!--") + 4 : sdf.index("-->")]
    lines = [line.partition(": ") for line in comment.splitlines() if ": " in line]
    values = {key: json.loads(value, object_hook=_rebuild) for key, _, value in lines}
    draws = values.pop("draws")
    return Field(**values), draws


def _rebuild(values: dict[str, Any]) -> Any:
    types = {"box": Box, "cylinder": Cylinder, "course": Course}
    return types[values.pop("type")](**values) if "type" in values else values


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


@pytest.mark.parametrize("name", DENSE)
def test_the_dense_fields_are_what_their_comments_say(name: str) -> None:
    content = (bundled_folder("worlds") / f"{name}.sdf").read_text()
    made, draws = noted(content)
    assert made.draw_world(draws).sdf == content
    experiment = compose(["world=dense"]).build()
    assert tuple(experiment.world) == DENSE
    assert experiment.world[name].bodies == made.draw_world(draws).bodies


@pytest.mark.parametrize("name", ["boxes", "maze", "blocks"])
def test_the_bundled_worlds_survive_being_written(name: str) -> None:
    world = load_world(f"{name}.sdf", course())
    again = read_sdf(world.sdf.encode(), "written")
    assert_alike(world.bodies, again)


angles = st.floats(-math.pi, math.pi)


@given(st.lists(st.tuples(angles, angles, angles, st.booleans()), min_size=1, max_size=3))
def test_any_pose_survives_being_written(turns: list[tuple[float, float, float, bool]]) -> None:
    bodies = tuple(
        Body(
            f"body{i}",
            Pose.from_rpy((1.25, -3.5, 1e-3 * i), roll, pitch, yaw),
            (Shape("box", (0.1, 0.2, 0.3)),),
            4.0 if movable else None,
            0.7,
            (0.1, 0.2, 0.25) if movable else None,
        )
        for i, (roll, pitch, yaw, movable) in enumerate(turns)
    )
    assert_alike(bodies, read_sdf(write_sdf("x", bodies).encode(), "x"))


def test_straight_up_and_down_survive_being_written() -> None:
    for pitch in (math.pi / 2, -math.pi / 2):
        body = Body(
            "b", Pose.from_rpy((0, 0, 1), 0.3, pitch, 0.9), (Shape("cylinder", (0.1, 2.0)),)
        )
        assert_alike((body,), read_sdf(write_sdf("x", (body,)).encode(), "x"))


def assert_alike(bodies: tuple[Body, ...], others: tuple[Body, ...]) -> None:
    for one, other in zip(bodies, others, strict=True):
        assert (one.name, one.mass, one.friction) == (other.name, other.mass, other.friction)
        np.testing.assert_allclose(one.pose.position, other.pose.position, atol=1e-9)
        np.testing.assert_allclose(one.pose.rotation, other.pose.rotation, atol=1e-8)
        for shape, another in zip(one.shapes, other.shapes, strict=True):
            assert shape.kind == another.kind
            assert shape.size == pytest.approx(another.size, abs=1e-9)
        assert (one.inertia or ()) == pytest.approx(other.inertia or ())


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
    with pytest.raises(InputError, match=rf"^Field\.{key}: [^\n]*; "):
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
    with pytest.raises(InputError, match=r"^(Box|Cylinder)\.\w+: [^\n]*; "):
        make()


def test_a_corridor_full_of_posts_has_a_way_through() -> None:
    narrow = field(
        course=course([[8.0, 0.0]]), extent_m=[11.0, 2.4], density=0.4, kinds={"posts": POSTS}
    )
    for seed in range(5):
        one = Field(**{**vars(narrow), "seed": seed})
        assert all(len(way) for way in one.find_ways(one.draw_world(FIXED).bodies))


# ---- New worlds from the draws of missions.


def renewed() -> World:
    one = field(density=0.1)
    values = {name: getattr(one, name) for name in one.__dataclass_fields__}
    return generate_world(**values, renew=True)


def test_missions_that_share_their_draws_meet_the_same_world_and_others_do_not() -> None:
    plan, design = Plan(0, ("generated",), 2, 2, "generation"), Design(())
    world = renewed()

    def met(missions: Any) -> list[str]:
        return [world.at(mission.draws).source_sha256 for mission in missions]

    first, second = met(plan.selection(3, 1, design)), met(plan.selection(3, 2, design))
    assert first == second
    assert len(set(first)) == 2  # another one in each trial
    validated = met(plan.validation(3, 1, design))
    assert met(plan.validation(9, 8, design)) == validated
    fresh = met(plan.evaluation(0, 1, design))
    others = [*met(plan.selection(4, 1, design)), *validated, *fresh]
    assert len({*first, *others}) == len(first) + len(others)


def test_a_world_that_is_not_renewed_is_the_same_in_every_mission() -> None:
    values = {name: getattr(field(), name) for name in field().__dataclass_fields__}
    world = generate_world(**values)
    assert world.at("a") is world.at("b") is world
    assert renewed().bodies == renewed().bodies  # the example that a renewed one is itself
    with pytest.raises(InputError, match="renew"):
        generate_world(**values, renew="yes")  # type: ignore[arg-type]


# ---- The command.


def test_the_command_writes_what_the_configuration_describes(tmp_path: Path) -> None:
    path = tmp_path / "field.sdf"
    assert evoros_world([str(path), "world.generated.seed=3"]) == 0
    experiment = compose(["world=generated", "world.generated.seed=3"]).build()
    assert path.read_text() == experiment.world["generated"].sdf
    bodies = load_world(str(path), course()).bodies
    assert bodies == experiment.world["generated"].bodies


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["there.sdf"], "must be a new file"),
        (["new.sdf", "world=case_study"], "must be one world, not 3"),
        (["new.sdf", "world.generated.densty=1"], "did you mean density"),
        (["nowhere/new.sdf"], "cannot be written"),
        (["seed=1"], "must be the name of a new file"),
    ],
)
def test_the_command_says_what_is_wrong(
    arguments: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.sdf").write_text("mine")
    assert evoros_world(arguments) == 2
    assert said in capsys.readouterr().err
    assert (tmp_path / "there.sdf").read_text() == "mine"
    assert not (tmp_path / "new.sdf").exists()


def test_the_champion_keeps_the_worlds_that_it_met(tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    small = ["world.generated.density=0.1", "world.generated.course.time_limit_s=10"]
    for place, executor in ((here, "serial"), (there, "processes")):
        renewal = ["world=generated", "world.generated.renew=true", f"executor={executor}"]
        assert tiny(place, *renewal, *small) == 0
    assert content(here) == content(there)
    run = load_run(here)
    champion = int(pd.read_csv(here / "champion" / "design.csv").design.iloc[0])
    rows = run.missions[(run.missions.design == champion) & (run.missions.purpose == "selection")]
    kept = (here / "champion" / "world_generated.sdf").read_text()
    made, draws = noted(kept)
    assert draws == rows.draws.iloc[0]
    assert made.draw_world(draws).sdf == kept
    assert run.missions.draws.nunique() == 4  # three generations and the validation
    row = rows.iloc[0]
    outcome, track = replay(
        here, int(row.generation), champion, row.world, int(row.trial), USER_PARTS
    )
    assert outcome.time_s == row.time_s
    assert len(track) == len(run.trajectory("generated"))


# ---- From above.


def test_a_picture_has_every_obstacle_where_it_stands() -> None:
    open_, closed = field(enclosed=False).draw_world(FIXED), field().draw_world(FIXED)
    track = np.array([[0.0, 0.0], [1.0, 2.0]])
    drawn = draw_worlds({"open": open_, "closed": closed}, {"closed": [track]}, width=5.0)
    assert drawn.get_figwidth() == 5.0
    for axes, world in zip(drawn.axes[:2], (open_, closed), strict=True):
        (solids,) = axes.collections
        found = [path.get_extents() for path in solids.get_paths()]
        for box, area in zip(found, areas(world.bodies), strict=True):
            low = area.vertices.min(axis=0) - area.radius
            high = area.vertices.max(axis=0) + area.radius
            np.testing.assert_allclose([box.p0, box.p1], [low, high], atol=1e-3)
        tops = np.asarray(solids.get_array())
        heights = [b.shapes[0].size[-1] for b in world.obstacles]
        np.testing.assert_allclose(tops, heights, atol=1e-9)
    lines = [np.asarray(line.get_xydata()) for line in drawn.axes[1].get_lines()]
    assert any(np.array_equal(line, track) for line in lines)
    assert drawn.axes[0].get_title() == "open"


def test_a_picture_has_what_leans_and_what_is_raised() -> None:
    world = field().draw_world(FIXED)
    ground = [body for body in world.bodies if body.is_ground]
    lean = Pose.from_rpy((6.0, 0.0, 0.5), 1e-6, 0.0, 0.0)  # as a file with rounded angles has it
    post = Body("post", lean, (Shape("cylinder", (0.3, 1.0)),))
    shelf = Body("shelf", Pose((0.0, 6.0, 1.05)), (Shape("box", (1.0, 1.0, 0.1)),))
    drawn = draw_worlds({"two": replace(world, bodies=(*ground, post, shelf))})
    (solids,) = drawn.axes[0].collections
    boxes = [path.get_extents().bounds for path in solids.get_paths()]
    np.testing.assert_allclose(boxes[0], (5.7, -0.3, 0.6, 0.6), atol=1e-5)
    np.testing.assert_allclose(boxes[1], (-0.5, 5.5, 1.0, 1.0), atol=1e-9)
    np.testing.assert_allclose(np.asarray(solids.get_array()), (1.0, 1.1), atol=1e-5)
