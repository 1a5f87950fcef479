"""Changes that are proposed for a robot that an engine turns wrongly are typed and work."""

import re
from pathlib import Path

import pytest
from proposal_sites import is_of

from evoros.config.compose import compose
from evoros.preflight.drive import check_drive

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


def warn(file: Path, *words: str) -> str:
    overrides = ["robot=own", f"robot.description={file}", "design=around", *words]
    return " ".join(check_drive(compose([*overrides, "executor=serial"]).build()))


def test_wheels_that_hop_in_turns_turn_right_on_softer_ground(tmp_path: Path) -> None:
    file = write_robot(tmp_path, {0.23: 0.235, -0.23: 0.235}, width=0.1, mass=3.0)
    line = warn(file, "simulator=mujoco")
    assert is_of(line, "evoros/preflight/advice.py {key}.slip_impedance={value}")
    typed = re.findall(r"\S+=[\d.]+(?=[ ,])", line.rpartition("; set ")[2])
    assert warn(file, "simulator=mujoco", *typed) == ""


def test_motors_too_weak_for_wide_heavy_wheels_are_named_with_a_limit_that_helps(
    tmp_path: Path,
) -> None:
    file = write_robot(tmp_path, {-0.1: 0.23}, width=0.06, mass=110.0)
    line = warn(file, "simulator=mujoco")
    raised = dict(re.findall(r"([\d.]+) N m for (\w+)", line)[::-1])
    (effort,) = raised
    file.write_text(file.read_text().replace('effort="30"', f'effort="{effort}"'))
    assert warn(file, "simulator=mujoco") == ""


@pytest.mark.parametrize("key", ["simulator", "simulator@confirmation.simulator"])
def test_the_planar_simulator_is_proposed_where_nothing_else_helps(
    key: str, tmp_path: Path
) -> None:
    file = write_robot(tmp_path, {-0.1: 0.23}, width=0.06, mass=110.0, effort=2)
    words = ["confirmation=physics"] if key != "simulator" else []
    line = warn(file, *words, f"{key}=mujoco")
    assert f"or use {key}=planar, in which the robot moves as commanded" in line
    assert warn(file, *words, f"{key}=planar") == ""
