"""Courses that leave their world, and sensors that see no obstacle, are told."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_cases import grid_mesh
from proposal_sites import is_of

from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.files.resources import bundled_folder
from evoros.preflight.scene import check_meshes, check_view, check_waypoints, list_subjects

PLANE = ("simulator=planar", "executor=serial", "world=maze")
EXPERIMENTS = sorted(path.stem for path in (bundled_folder("conf") / "experiment").glob("*.yaml"))


def build(*overrides: str) -> Experiment:
    return compose(list(overrides)).build()


def warn(experiment: Experiment) -> list[str]:
    views = [text for subject in list_subjects(experiment) for text in check_view(subject)]
    return [*check_waypoints(experiment), *views]


@pytest.mark.slow
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_no_bundled_experiment_is_doubted(name: str) -> None:
    assert warn(build(f"experiment={name}", "executor=serial")) == []


def test_a_waypoint_outside_the_walls_is_told() -> None:
    (warning,) = warn(build(*PLANE, "course.waypoints=[[1.0,1.0],[900.0,1.0]]"))
    assert "(900, 1)" in warning
    assert "(1, 1)" not in warning


@pytest.mark.slow
def test_a_sensor_above_all_obstacles_is_told_unless_it_looks_down() -> None:
    high = (*PLANE, "robot.mount.z_m=9")
    (warning,) = warn(build(*high, "robot.mount.pitch_deg=60"))
    assert "looks over all obstacles" in warning
    assert warn(build(*high, "robot.mount.pitch_deg=-60")) == []


def test_a_yard_that_counts_as_full_is_told_with_what_empties_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    walls = np.ones((3, 3, 1), dtype=bool)
    walls[1, 1:] = False  # a yard of 3.6 x 3.8 m, open to one side
    triangles = grid_mesh(walls, [[4.0, 4.2, 7.8, 8.0], [-2.0, -1.8, 1.0, 2.0], [0.0, 1.0]])
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    trimesh.Trimesh(triangles.reshape(-1, 3), faces).export(tmp_path / "yard.stl")
    (tmp_path / "w.sdf").write_text(
        "<sdf version='1.6'><world name='w'><model name='yard'><static>1</static><link name='l'>"
        "<collision name='c'><geometry><mesh><uri>yard.stl</uri></mesh></geometry></collision>"
        "</link></model></world></sdf>"
    )
    words = (f"world.boxes.sdf={tmp_path / 'w.sdf'}", "world.boxes.course.waypoints=[[2,0]]")

    def warn_of_meshes(word: str) -> list[str]:
        experiment = build("simulator=planar", "executor=serial", "world=boxes", *words, word)
        return [text for part in list_subjects(experiment) for text in check_meshes(part)]

    (warning,) = warn_of_meshes("+world.boxes.mesh_effort=1e-9")
    # 3.56 x 3.78 of 16 m2: what is within 2 cm of a wall does not count.
    assert "yard.stl: its convex parts cover 13 m2 (84 %) of free area at" in warning
    assert is_of(warning, "evoros/preflight/scene.py ++world.{name}.mesh_effort=10")
    typed = warning.partition("type ")[2].partition(",")[0]
    assert warn_of_meshes(typed) == []
