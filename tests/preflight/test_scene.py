"""Courses that leave their world, blind sensors and wrong turns are told, with typed advice."""

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_cases import grid_mesh
from proposal_sites import is_of

from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.files.resources import bundled_folder
from evoros.preflight.drive import check_drive
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


WHEEL = (
    '<link name="{0}"><inertial><mass value="{mass}"/><inertia ixx="{round}" ixy="0" ixz="0" '
    'iyy="{round}" iyz="0" izz="{round}"/></inertial><collision><origin rpy="1.5707963 0 0"/>'
    '<geometry><cylinder radius="0.14" length="{width}"/></geometry></collision></link>'
    '<joint name="{0}_joint" type="continuous"><parent link="base"/><child link="{0}"/>'
    '<origin xyz="{x} {y} 0.14"/><axis xyz="0 1 0"/><limit effort="{effort}" velocity="5"/></joint>'
)
BODY = (
    '<link name="base"><inertial><origin xyz="0 0 0.24"/><mass value="7"/><inertia ixx="0.05" '
    'ixy="0" ixz="0" iyy="0.15" iyz="0" izz="0.2"/></inertial><collision><origin xyz="0 0 0.24"/>'
    '<geometry><box size="0.3 0.1 0.1"/></geometry></collision></link>'
)


def write_robot(
    folder: Path, axles: dict[float, float], width: float, mass: float, effort: int = 30
) -> Path:
    """Write a robot whose wheels stand at x: y [m]."""
    wheels = "".join(
        WHEEL.format(
            f"w{i}{side}", x=x, y=y, width=width, mass=mass, round=0.01 * mass, effort=effort
        )
        for i, (x, half) in enumerate(axles.items())
        for side, y in (("l", half), ("r", -half))
    )
    file = folder / "r.urdf"
    file.write_text(f'<robot name="r">{BODY}{wheels}</robot>')
    return file


def warn_of_turns(file: Path, *words: str) -> str:
    overrides = ["robot=own", f"robot.description={file}", "design=around", *words]
    return " ".join(check_drive(compose([*overrides, "executor=serial"]).build()))


@pytest.mark.slow
def test_wheels_that_hop_in_turns_turn_right_on_softer_ground(tmp_path: Path) -> None:
    file = write_robot(tmp_path, {0.23: 0.235, -0.23: 0.235}, width=0.1, mass=3.0)
    line = warn_of_turns(file, "simulator=mujoco")
    assert is_of(line, "evoros/preflight/advice.py {key}.slip_impedance={value}")
    typed = re.findall(r"\S+=[\d.]+(?=[ ,])", line.rpartition("; set ")[2])
    assert warn_of_turns(file, "simulator=mujoco", *typed) == ""


@pytest.mark.parametrize(
    ("axles", "mass", "effort"), [({-0.1: 0.23}, 110.0, 30), ({0.23: 0.235, -0.23: 0.235}, 3.0, 2)]
)
def test_motors_too_weak_for_turns_are_named_with_a_limit_that_helps(
    axles: dict[float, float], mass: float, effort: int, tmp_path: Path
) -> None:
    """Where wheels hop as well, softer ground is proposed in addition."""
    file = write_robot(tmp_path, axles, width=0.06, mass=mass, effort=effort)
    line = warn_of_turns(file, "simulator=mujoco")
    (raised,) = re.findall(r"raise <limit effort> to ([\d.]+) N m for w0l_joint", line)
    file.write_text(file.read_text().replace(f'effort="{effort}"', f'effort="{raised}"'))
    typed = re.findall(r"and set (\S+),", line)
    assert len(typed) == len(axles) - 1
    assert warn_of_turns(file, "simulator=mujoco", *typed) == ""


@pytest.mark.parametrize("key", ["simulator", "simulator@confirmation.simulator"])
def test_the_planar_simulator_is_proposed_where_nothing_else_helps(
    key: str, tmp_path: Path
) -> None:
    file = write_robot(tmp_path, {-0.1: 0.23}, width=0.06, mass=110.0, effort=2)
    words = ["confirmation=physics"] if key != "simulator" else []
    line = warn_of_turns(file, *words, f"{key}=mujoco")
    assert f"or use {key}=planar, in which the robot moves as commanded" in line
    assert warn_of_turns(file, *words, f"{key}=planar") == ""
