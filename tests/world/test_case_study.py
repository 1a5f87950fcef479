"""The worlds of the case study, and their configuration."""

import hashlib
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from world_cases import GROUND, square

from evoros.config.compose import compose as compose_evoros
from evoros.files.resources import bundled_folder
from evoros.geometry.clearance import compute_clearances
from evoros.geometry.footprint import bottom_height, project_bodies
from evoros.world.loading import load_world

SHARED = "  - world/course@course: square\n"


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
    counts: dict[tuple[tuple[float, ...], float | None], int] = {}
    for body in world.obstacles:
        (shape,) = body.shapes
        assert shape.kind == "box"
        # It stands on the ground, upright, and the ground is where it must be.
        assert bottom_height(shape, body.pose @ shape.pose) == pytest.approx(0.0, abs=1e-9)
        assert abs(body.pose.rotation[2, 2]) == pytest.approx(1.0)
        counts[shape.size, body.mass] = counts.get((shape.size, body.mass), 0) + 1
    assert counts == CONTENTS[name]
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


@pytest.mark.parametrize("world", ["case_study", "[blocks,maze]"])
def test_an_experiment_takes_any_of_the_worlds(world: str) -> None:
    for name in ("as_run", "case_study", "quickstart", "free_placement"):
        experiment = compose_evoros([f"experiment={name}", f"world={world}"]).build()
        directions = {loaded.course.direction for loaded in experiment.world.values()}
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
