"""Worlds and courses: the case study's three, their configuration, and what is refused."""

import hashlib
import logging
import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.base.resources import bundled_folder
from evoros.config.compose import compose as compose_evoros
from evoros.geometry.clearance import compute_clearances
from evoros.geometry.footprint import bottom_height, project_bodies
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.course import Course
from evoros.world.loading import load_world
from evoros.world.model import World

SHARED = "  - world/course@course: square\n"
CORNERS = [[5.0, 5.0], [5.0, -5.0], [-5.0, -5.0], [-5.0, 5.0]]
GROUND = Body("ground", Pose(), (Shape("plane", (0.0, 0.0, 1.0)),))


def square(**changes: Any) -> Course:
    fields: dict[str, Any] = {
        "home_x_m": 0.0,
        "home_y_m": 0.0,
        "home_z_m": 0.08,
        "home_yaw_rad": 1.562,
        "waypoints": CORNERS,
        "acceptance_m": 1.0,
        "time_limit_s": 540.0,
        "direction": "random",
        "end_on_collision": True,
    }
    return Course(**(fields | changes))


def world_of(*bodies: Body, course: Course | None = None) -> World:
    return World("test", bodies, course or square(), "test.sdf", "0" * 64)


def box(name: str, x: float, y: float, z: float, size: float = 1.0) -> Body:
    return Body(name, Pose((x, y, z)), (Shape("box", (size, size, size)),))


# ---- The case study.

UNIT, BRICK, TALL = (1.0, 1.0, 1.0), (3.0, 1.0, 3.0), (7.5, 0.2, 2.8)
BLOCK, WIDE = (0.194, 0.397, 0.143), (0.387, 0.387, 0.143)
CONTENTS = {
    "boxes": {(UNIT, 50.0): 19},
    "maze": {(BRICK, None): 10, (TALL, None): 12},
    "blocks": {(BLOCK, 5.0): 5, (WIDE, 5.0): 2, (BRICK, None): 1, (TALL, None): 2},
}


@pytest.mark.parametrize("name", CONTENTS)
def test_the_case_study_has_what_the_study_had(name: str) -> None:
    world = load_world(f"{name}.sdf", square())
    found: dict[tuple[tuple[float, ...], float | None], int] = {}
    for body in world.obstacles:
        (shape,) = body.shapes
        assert shape.kind == "box"
        # It stands on the ground, upright, and the ground is where it must be.
        assert bottom_height(shape, body.pose @ shape.pose) == pytest.approx(0.0, abs=1e-9)
        assert abs(body.pose.rotation[2, 2]) == pytest.approx(1.0)
        found[shape.size, body.mass] = found.get((shape.size, body.mass), 0) + 1
    assert found == CONTENTS[name]
    assert [body for body in world.bodies if body not in world.obstacles] == [GROUND]
    assert {body.friction for body in world.bodies} == {1.0}


@pytest.mark.parametrize("name", CONTENTS)
def test_a_movable_obstacle_has_the_inertia_of_its_box(name: str) -> None:
    for body in load_world(f"{name}.sdf", square()).obstacles:
        if body.mass is None:
            assert body.inertia is None
        else:
            x, y, z = body.shapes[0].size
            expected = [body.mass / 12 * (a * a + b * b) for a, b in ((y, z), (x, z), (x, y))]
            assert body.inertia == pytest.approx(expected)


@pytest.mark.parametrize("name", CONTENTS)
def test_no_obstacle_of_the_case_study_overlaps_another_and_home_is_free(name: str) -> None:
    world = load_world(f"{name}.sdf", square())
    areas = project_bodies(world.obstacles)
    robot = np.array([[-0.215, -0.1625], [0.25, -0.1625], [0.25, 0.1625], [-0.215, 0.1625]])
    x, y, _, yaw = world.course.home
    assert compute_clearances(robot, np.array([[x, y, yaw]]), areas)[0] > 1.0
    # Movable ones would fly apart if they did; walls may share corners.
    for i, area in enumerate(areas):
        if world.obstacles[i].mass is not None:
            others = areas[:i] + areas[i + 1 :]
            assert compute_clearances(area.vertices, np.zeros((1, 3)), others)[0] > 0


@pytest.mark.parametrize("name", CONTENTS)
def test_a_world_pickles_and_knows_its_source(name: str) -> None:
    world = load_world(f"{name}.sdf", square())
    assert pickle.loads(pickle.dumps(world)) == world
    content = (bundled_folder("worlds") / f"{name}.sdf").read_bytes()
    assert world.source_sha256 == hashlib.sha256(content).hexdigest()
    assert (world.name, world.source) == (name, f"{name}.sdf")


# ---- The configuration.


def configured(tmp_path: Path, world: str, *overrides: str) -> Any:
    (tmp_path / "config.yaml").write_text(f"defaults:\n  - world: {world}\n{SHARED}  - _self_\n")
    search = f"hydra.searchpath=[file://{bundled_folder('conf')}]"
    with initialize_config_dir(str(tmp_path), version_base=None):
        config = compose("config", overrides=[search, *overrides])
    return instantiate(config, _convert_="all")["world"]


@pytest.mark.parametrize("name", CONTENTS)
def test_a_world_file_gives_one_world_under_its_name(name: str, tmp_path: Path) -> None:
    worlds = configured(tmp_path, name)
    assert worlds == {name: load_world(f"{name}.sdf", square())}


def test_the_case_study_is_the_three_in_order(tmp_path: Path) -> None:
    worlds = configured(tmp_path, "case_study")
    assert list(worlds) == ["boxes", "maze", "blocks"]
    assert list(worlds) == [world.name for world in worlds.values()]


def test_the_course_is_changed_in_all_worlds_at_once(tmp_path: Path) -> None:
    changes = ("course.time_limit_s=60.0", "world.maze.course.time_limit_s=30.0")
    worlds = configured(tmp_path, "case_study", *changes)
    limits = {name: world.course.time_limit_s for name, world in worlds.items()}
    assert limits == {"boxes": 60.0, "maze": 30.0, "blocks": 60.0}


@pytest.mark.parametrize("world", ["boxes", "maze", "blocks", "case_study", "[blocks,maze]"])
def test_an_experiment_takes_any_of_the_worlds(world: str) -> None:
    for name in ("as_run", "case_study", "quickstart", "free_placement"):
        experiment = compose_evoros([f"experiment={name}", f"world={world}"]).build()
        directions = {each.course.direction for each in experiment.world.values()}
        assert directions == {"parity" if name == "as_run" else "random"}


def test_one_world_s_course_can_be_changed_alone(tmp_path: Path) -> None:
    worlds = configured(tmp_path, "case_study", "world.maze.course.time_limit_s=60.0")
    assert worlds["maze"].course == square(time_limit_s=60.0)
    assert worlds["boxes"].course == square()


def test_another_course_can_be_chosen_and_a_world_added(tmp_path: Path) -> None:
    (tmp_path / "world" / "course").mkdir(parents=True)
    line = "_target_: evoros.world.course.Course\nwaypoints: [[2, 0]]\nhome_x_m: -2\nhome_y_m: 0\n"
    line += "home_z_m: 0\nhome_yaw_rad: 0\nacceptance_m: 1\ntime_limit_s: 9\ndirection: forward\n"
    (tmp_path / "world" / "course" / "line.yaml").write_text(line + "end_on_collision: false\n")
    changes = ("world/course@world.boxes.course=line", "world.maze.course.acceptance_m=2")
    worlds = configured(tmp_path, "[boxes,maze]", *changes)
    assert worlds["boxes"].course.waypoints == ((2.0, 0.0),)
    assert worlds["maze"].course == square(acceptance_m=2)


# ---- Courses.


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
    with pytest.raises(InputError, match=rf"^Course\.{field}: .*; "):
        square(**{field: value})


# ---- Worlds.


@pytest.mark.parametrize(
    ("x", "y", "place"), [(5.0, -5.0, r"waypoint 1 \(5.0, -5.0\)"), (0.0, 0.0, "home")]
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
        Body("g", Pose(), (Shape("plane", (0.0, 0.1, 1.0)),)),
        Body("g", Pose(), (Shape("plane", (0.0, 0.0, -1.0)),)),
        Body("g", Pose.from_rpy((0.0, 0.0, 0.0), 0.1, 0.0, 0.0), GROUND.shapes),
        Body("g", Pose((0.0, 0.0, -0.1)), GROUND.shapes),
    ],
)
def test_the_ground_must_be_level_at_zero(ground: Body) -> None:
    with pytest.raises(InputError, match=r"^test\.sdf: .*ground"):
        world_of(ground)


def test_there_must_be_ground_and_there_may_be_more_below() -> None:
    with pytest.raises(InputError, match="it has none"):
        world_of(box("alone", 1.0, 1.0, 0.5))
    below = Body("below", Pose((0.0, 0.0, -1.0)), GROUND.shapes)
    assert world_of(below, GROUND, Body("twice", Pose(), GROUND.shapes * 2)).obstacles == ()


def test_two_bodies_of_one_name_are_refused() -> None:
    with pytest.raises(InputError, match="'twin'"):
        world_of(GROUND, box("twin", 2.0, 2.0, 0.5), box("twin", 3.0, 3.0, 0.5))


def test_a_model_alone_gets_ground_to_stand_on(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
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
    assert "ground is added" in caplog.text


def test_a_file_that_does_not_exist_is_an_error() -> None:
    with pytest.raises(InputError, match=r"nowhere\.sdf"):
        load_world("nowhere.sdf", square())


@pytest.mark.parametrize(
    "build",
    [
        lambda: Pose((0.0, 0.0, math.nan)),
        lambda: Pose(quaternion=(0.0, 0.0, 0.0, 2.0)),
        lambda: Shape("cone", (1.0, 1.0)),
        lambda: Shape("box", (1.0, 1.0)),
        lambda: Shape("box", (1.0, 0.0, 1.0)),
        lambda: Shape("sphere", (math.inf,)),
        lambda: Shape("plane", (0.0, 0.0, 0.0)),
        lambda: Body("", Pose(), GROUND.shapes),
        lambda: Body("b", Pose(), ()),
        lambda: Body("b", Pose(), GROUND.shapes, mass=1.0),
        lambda: Body("b", Pose(), (Shape("sphere", (1.0,)),), mass=0.0),
        lambda: Body("b", Pose(), (Shape("sphere", (1.0,)),), friction=-1.0),
        lambda: Body("b", Pose(), (Shape("sphere", (1.0,)),), 1.0, 1.0, (1.0, 1.0, 0.0)),
    ],
)
def test_a_bad_description_is_refused(build: Any) -> None:
    with pytest.raises(InputError, match=r"^(Pose|Shape|Body)\.\w+: [^\n]*; "):
        build()
