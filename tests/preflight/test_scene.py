"""Courses that leave their world, and sensors that see no obstacle, are told."""

import pytest

from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.files.resources import bundled_folder
from evoros.preflight.scene import check_view, check_waypoints
from evoros.preflight.subject import list_subjects

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
