"""Gazebo's own parser accepts the robots with their sensors and the worlds that runs leave."""

import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from lxml import etree

from evoros.config.compose import compose
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.files.resources import bundled_folder
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.model import World

pytestmark = pytest.mark.gazebo
ROBOTS = sorted(file.stem for file in (bundled_folder("conf") / "robot").glob("*.yaml"))
ROBOTS.remove("own")  # has no description
WORLDS = sorted(file.stem for file in (bundled_folder("conf") / "world").glob("*.yaml"))
FITTING = {"erle_rover", "erle_rover_as_run", "two_wheeler"}  # carry the case study's sensors


def ign(option: str, file: Path) -> str:
    """The output of ``ign sdf``, which ends with status 0 for invalid files too."""
    done = subprocess.run(["ign", "sdf", option, str(file)], capture_output=True, text=True)
    complaints = [
        line for line in done.stderr.splitlines() if "ignition-tools-backward" not in line
    ]
    assert done.returncode == 0, done.stderr
    assert not any("Error" in line for line in complaints), done.stderr
    return done.stdout


def build(*overrides: str) -> Experiment:
    return compose(["simulator=planar", *overrides]).build()


def middle_design(experiment: Experiment) -> Design:
    space = experiment.space
    return space.decode(np.full(space.size, 0.7))


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_it_keeps_every_sensor_of_a_robot(name: str, tmp_path: Path) -> None:
    design = "six_sonars" if name in FITTING else "around"
    experiment = build(f"robot={name}", f"design={design}")
    robot = experiment.members[0].with_design(middle_design(experiment)).robot
    file = tmp_path / "robot.urdf"
    file.write_text(robot.urdf)
    assert ign("-k", file).strip() == "Valid."
    converted = etree.fromstring(ign("-p", file).encode())
    names = [str(sensor.get("name")) for sensor in converted.iter("sensor")]
    expected = [f"{mount.sensor}_{i}" for i, mount in enumerate(robot.mounts)]
    assert expected
    assert names == expected


@cache  # a world is part of several choices
def count_models(sdf: str) -> int:
    with TemporaryDirectory() as folder:
        file = Path(folder) / "world.sdf"
        file.write_text(sdf)
        return len(etree.fromstring(ign("-p", file).encode()).findall("world/model"))


@pytest.mark.slow
@pytest.mark.parametrize("name", WORLDS)
def test_it_accepts_the_worlds(name: str) -> None:
    world = next(iter(build(f"world={name}").world.values()))
    assert count_models(world.sdf) == len(world.bodies)


def test_it_accepts_parts_of_meshes_height_fields_slopes_and_gravity(tmp_path: Path) -> None:
    corners = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 2.0))
    part = Shape("convex", (), corners=corners)
    other = Shape("convex", (), Pose((0.0, 0.0, 2.0)), corners)
    hills = Shape("heightfield", (8.0, 8.0), heights=((-1.0, 0.5, 0.0),) * 3)
    slope = Pose.from_rpy((0.0, 0.0, 0.0), 0.0, 0.1, 0.0)
    bodies = (
        Body("slope", slope, (Shape("plane", (0.0, 0.0, 1.0)),)),
        Body("hills", Pose((20.0, 20.0, 0.0)), (hills,)),
        Body("fixed", Pose((8.0, 8.0, 0.0)), (part,)),
        Body("movable", Pose((-8.0, 8.0, 3.0)), (part, other), 2.0, 0.8, (0.1, 0.1, 0.1)),
    )
    course = build("world=boxes").world["boxes"].course
    course = replace(course, home_x_m=0.0, home_y_m=0.0)
    world = World("all", bodies, course, "all.sdf", "0", gravity_mps2=3.7)
    for name, content in world.files("all").items():
        (tmp_path / name).write_bytes(content)
    assert ign("-k", tmp_path / "all.sdf").strip() == "Valid."
    converted = etree.fromstring(ign("-p", tmp_path / "all.sdf").encode())
    assert len(converted.findall("world/model")) == 4
    assert len(converted.findall(".//collision/geometry/mesh/submesh")) == 3
    assert len(converted.findall(".//collision/geometry/heightmap")) == 1
    assert converted.findtext("world/gravity") == "0 0 -3.7"


def test_a_faulty_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "faulty.sdf"
    file.write_text('<sdf version="1.9"><world name="w"><model/></world></sdf>')
    with pytest.raises(AssertionError):
        ign("-k", file)
