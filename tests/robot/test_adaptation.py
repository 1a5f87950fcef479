"""Descriptions as people write them are completed for engines, and each assumption is told."""

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fixture_types import Log
from lxml import etree

from evoros.base.errors import InputError
from evoros.drive.ackermann import Ackermann
from evoros.drive.automatic import AutomaticDescription
from evoros.drive.differential import Differential, DifferentialDescription
from evoros.drive.protocol import DriveDescription
from evoros.robot.loading import GRAVITY_MPS2, load_robot
from evoros.robot.model import Robot

INERTIAL = (
    '<inertial><mass value="{0}"/>'
    '<inertia ixx="{1}" iyy="{1}" izz="{1}" ixy="0" ixz="0" iyz="0"/></inertial>'
)
BOX = (
    '<collision><origin xyz="0 0 0.08"/><geometry><box size="0.3 0.2 0.1"/></geometry></collision>'
)
DISC = '<origin rpy="1.5707963 0 0"/><geometry><cylinder radius="0.05" length="0.03"/></geometry>'
BALL = '<collision><geometry><sphere radius="0.02"/></geometry></collision>'
AXIS = '<axis xyz="0 1 0"/>'
LIMIT = '<limit effort="1" velocity="8"/>'


def link(name: str, *parts: str) -> str:
    return f'<link name="{name}">{"".join(parts)}</link>'


def joint(
    name: str,
    child: str,
    xyz: str = "0 0 0",
    kind: str = "fixed",
    more: str = "",
    rpy: str = "0 0 0",
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="base_link"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/>{more}</joint>'
    )


def wheel(
    side: str,
    shape: str = f"<collision>{DISC}</collision>",
    more: str = f'<axis xyz="0 1 0"/>{LIMIT}',
    mass: str = INERTIAL.format(0.2, 0.0003),
    z: float = 0.05,
    rpy: str = "0 0 0",
    y: float = 0.0,
    x: float = 0.0,
    kind: str = "continuous",
) -> str:
    place = y + (0.12 if side == "left" else -0.12)
    name = f"{side}_wheel"
    return link(name, shape, mass) + joint(
        f"{name}_joint", name, f"{x} {place} {z}", kind, more, rpy
    )


CASTER = link("caster_link", BALL, INERTIAL.format(0.05, 0.0001)) + joint(
    "caster_joint", "caster_link", "-0.12 0 0.02"
)
BASE = link("base_link", BOX, INERTIAL.format(2.0, 0.02))
WHEELS = wheel("left") + wheel("right")


def load(folder: Path, *parts: str, drive: DriveDescription | None = None, **keys: Any) -> Robot:
    (folder / "bot.urdf").write_text(f'<robot name="bot">\n{"".join(parts)}\n</robot>')
    name = str(folder / "bot.urdf")
    return load_robot(name, drive or AutomaticDescription(), **keys)


def told(caplog: Log, text: str) -> str:
    """The only message with a text; it names the file and has one line."""
    (line,) = (message for message in caplog.messages if text in message)
    assert "bot.urdf: " in line
    assert "\n" not in line
    return line


def two_wheeled(robot: Robot) -> Differential:
    assert isinstance(robot.drive, Differential)
    return robot.drive


def element(robot: Robot, path: str) -> etree._Element:
    part = robot.urdf_elements().find(path)
    assert part is not None
    return part


def shapes(robot: Robot, name: str) -> list[str]:
    return [str(s.tag) for s in robot.urdf_elements().findall(f"link[@name='{name}']/*/geometry/*")]


@pytest.mark.parametrize("mass", ["4_0", "\u0664", "0x4", "4,0", "nan"])
def test_numbers_are_what_ros_takes_for_one(tmp_path: Path, mass: str) -> None:
    heavy = INERTIAL.replace("{0}", mass).format("", 0.02)
    with pytest.raises(InputError, match="must have 1 finite number in value"):
        load(tmp_path, link("base_link", BOX, heavy), WHEELS, CASTER)


def test_a_link_that_is_denser_than_metal_is_told(tmp_path: Path, caplog: Log) -> None:
    """The box has 6 l."""
    for mass in (4000.0, 40.0):
        caplog.clear()
        load(tmp_path, link("base_link", BOX, INERTIAL.format(mass, 0.5 * mass)), WHEELS, CASTER)
        assert ("denser than any metal, but their masses are kept: base_link" in caplog.text) == (
            mass == 4000.0
        )


def test_a_wheel_that_mimics_the_other_is_driven_by_itself(tmp_path: Path, caplog: Log) -> None:
    mimic = f'<axis xyz="0 1 0"/>{LIMIT}<mimic joint="left_wheel_joint"/>'
    robot = load(tmp_path, BASE, wheel("left"), wheel("right", more=mimic), CASTER)
    told(caplog, "wheels that mimic another joint get their own motor: right_wheel_joint")
    assert robot.urdf_elements().find(".//mimic") is None
    slow, fast = robot.drive.targets(0.3, 0.4)[1]
    assert slow < fast


ABSENT = '<visual><geometry><mesh filename="absent.stl"/></geometry></visual>'


def test_a_body_that_shows_an_absent_mesh_alone_loads_with_the_option_that_is_named(
    tmp_path: Path,
) -> None:
    parts = (link("base_link", ABSENT, INERTIAL.format(2.0, 0.02)), WHEELS, CASTER)
    with pytest.raises(InputError, match=r"absent\.stl.*robot\.missing=leave_out"):
        load(tmp_path, *parts)
    assert two_wheeled(load(tmp_path, *parts, missing="leave_out")).track_m == 0.24


def test_no_robot_is_refused_for_the_looks_of_its_steering_wheel(tmp_path: Path) -> None:
    steering = link("steering_wheel", ABSENT) + joint("column", "steering_wheel", "0 0 0.3")
    assert two_wheeled(load(tmp_path, BASE, WHEELS, CASTER, steering)).track_m == 0.24


def test_a_sound_description_is_not_changed(tmp_path: Path) -> None:
    robot = load(tmp_path, BASE, WHEELS, CASTER)
    assert robot.engine_urdf is None
    assert two_wheeled(robot).caster_links == ("caster_link",)


def test_links_without_inertial_are_frames(tmp_path: Path) -> None:
    frames = link("base_footprint") + link("scan") + joint("scan_joint", "scan", "0.1 0 0.15")
    foot = joint("foot", "base_link").replace('parent link="base_link"', 'parent link="foot"')
    foot = foot.replace('parent link="foot"', 'parent link="base_footprint"')
    robot = load(tmp_path, frames, foot, BASE, WHEELS, CASTER)
    assert robot.engine_urdf is None
    assert "scan" in robot.sensor_links


def test_the_description_of_the_file_is_kept(tmp_path: Path) -> None:
    plugin = '<gazebo><plugin filename="libx.so" name="x"><a>1</a></plugin></gazebo>'
    lifted = wheel("left", z=0.02) + wheel("right", z=0.02)
    robot = load(tmp_path, BASE, lifted, CASTER.replace(" 0.02", " -0.01"), plugin)
    assert robot.engine_urdf is not None
    assert "libx.so" in robot.urdf
    assert "evoros_ground" not in robot.urdf


@pytest.mark.parametrize("z", [0.02, 0.07])
def test_the_root_may_be_above_or_below_the_ground(tmp_path: Path, caplog: Log, z: float) -> None:
    caster = CASTER.replace("-0.12 0 0.02", f"-0.12 0 {z - 0.03}")
    robot = load(tmp_path, BASE, wheel("left", z=z), wheel("right", z=z), caster)
    assert two_wheeled(robot).wheel_radii_m[0] == pytest.approx(0.05)
    assert robot.height_m == pytest.approx(0.13 + 0.05 - z)
    assert robot.sensor_links["base_link"] == pytest.approx((0.0, 0.0, 0.05 - z, 0.0))
    assert set(robot.sensor_links) == {"base_link", "caster_link"}
    assert f"{abs(0.05 - z):.4g} m" in told(caplog, "wheels touch the ground")


def test_wheels_beside_the_middle_are_found(tmp_path: Path, caplog: Log) -> None:
    robot = load(tmp_path, BASE, wheel("left", y=0.03), wheel("right", y=0.03), CASTER)
    assert robot.sensor_links["base_link"][1] == pytest.approx(-0.03)
    assert "0.03 m to the left" in told(caplog, "wheels touch the ground")


@pytest.mark.parametrize(
    ("changes", "says"),
    [({"x": 0.004}, "are offset by 4.0 mm"), ({"z": 0.053}, "above the ground by 3.0 mm")],
)
def test_wheels_may_be_off_by_millimetres(
    tmp_path: Path, caplog: Log, changes: dict[str, float], says: str
) -> None:
    load(tmp_path, BASE, wheel("left"), wheel("right", **changes), CASTER)  # type: ignore[arg-type]
    assert told(caplog, says)


@pytest.mark.parametrize("changes", [{"x": 0.02}, {"z": 0.063}])
def test_wheels_farther_off_are_refused(tmp_path: Path, changes: dict[str, float]) -> None:
    explicit = DifferentialDescription(
        ["left_wheel_joint", "right_wheel_joint"], ["caster_link"], 0.24, 0.9, 0.5
    )
    moved = wheel("right", **changes)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="<origin>"):
        load(tmp_path, BASE, wheel("left"), moved, CASTER, drive=explicit)


def test_radii_may_differ_a_little(tmp_path: Path, caplog: Log) -> None:
    larger = f"<collision>{DISC.replace('0.05', '0.052')}</collision>"
    robot = load(tmp_path, BASE, wheel("left"), wheel("right", larger, z=0.052), CASTER)
    assert two_wheeled(robot).wheel_radii_m[0] == pytest.approx(0.051)
    assert told(caplog, "radii of the wheels of an axle differ by 2.0 mm")


@pytest.mark.parametrize("limit", ["", '<limit velocity="5"/>'])
def test_a_joint_without_effort_gets_the_weight_at_the_radius(
    tmp_path: Path, caplog: Log, limit: str
) -> None:
    more = f'<axis xyz="0 1 0"/>{limit}'
    robot = load(tmp_path, BASE, wheel("left", more=more), wheel("right", more=more), CASTER)
    motor = element(robot, "joint[@name='left_wheel_joint']/limit")
    weight = (2.0 + 0.2 + 0.2 + 0.05) * GRAVITY_MPS2
    assert float(str(motor.get("effort"))) == pytest.approx(weight * 0.05)
    assert "left_wheel_joint, right_wheel_joint" in told(caplog, "without an effort limit")


@pytest.mark.parametrize(
    ("rpy", "axis", "forwards"),
    [
        ("0 0 0", "0 1 0", "0 1 0"),
        ("0 0 0", "0 -1 0", "0 1 0"),
        ("-1.5707963 0 0", "0 0 1", "0 0 1"),
        ("-1.57 0 0", "0 0 1", "0 0 1"),
        ("1.5707963 0 0", "0 0 1", "0 0 -1"),
        ("0 0 3.1415927", "0 1 0", "0 -1 0"),
    ],
)
def test_every_wheel_turns_forwards(tmp_path: Path, rpy: str, axis: str, forwards: str) -> None:
    """The frames of wheels are turned in public files, and so are their axes."""
    shape = "<collision>" + DISC.replace(
        "1.5707963 0 0", "0 0 0" if "1.57" in rpy else "1.5708 0 0"
    )
    more = f'<axis xyz="{axis}"/>{LIMIT}'
    sides = [
        wheel(side, f"{shape}</collision>", more, rpy=rpy, kind=kind)
        for side, kind in (("left", "continuous"), ("right", "revolute"))
    ]
    robot = load(tmp_path, BASE, *sides, CASTER)
    for side in ("left", "right"):
        axle = element(robot, f"joint[@name='{side}_wheel_joint']")
        assert axle.get("type") == "continuous"
        numbers = [float(word) for word in str(axle.find("axis").get("xyz")).split()]  # type: ignore[union-attr]
        assert numbers == pytest.approx([float(word) for word in forwards.split()], abs=2e-3)


def slanted(degrees: float) -> str:
    """Return two wheels whose axes are level and this far from across the robot."""
    angle = math.radians(degrees)
    more = f'<axis xyz="{math.sin(angle)} {math.cos(angle)} 0"/>{LIMIT}'
    return wheel("left", more=more) + wheel("right", more=more)


NAMED = DifferentialDescription(
    wheel_joints=["left_wheel_joint", "right_wheel_joint"],
    caster_links=[],
    wheelbase_m=0.24,
    steering_limit_rad=0.9,
    max_speed_mps=0.5,
)


def test_a_wheel_askew_is_set_across_the_robot_with_its_angle_told(
    tmp_path: Path, caplog: Log
) -> None:
    robot = load(tmp_path, BASE, slanted(12.0), CASTER, drive=NAMED)
    line = told(caplog, "skewed axes")
    assert "left_wheel_joint (12.0 deg), right_wheel_joint (12.0 deg)" in line
    axis = element(robot, "joint[@name='left_wheel_joint']/axis").get("xyz")
    assert [float(x) for x in str(axis).split()] == pytest.approx([0.0, 1.0, 0.0])


def test_a_wheel_turned_by_1_57_stands_on_its_whole_tread(tmp_path: Path, caplog: Log) -> None:
    pair = slanted(0.0).replace('xyz="0.0 1.0 0"', 'xyz="0 0 -1"').replace("1.5707963", "0")
    robot = load(tmp_path, BASE, pair.replace('0.05" rpy="0 0 0"', '0.05" rpy="1.57 0 0"'), CASTER)
    axis = element(robot, "joint[@name='left_wheel_joint']/axis").get("xyz")
    across = [float(x) for x in str(axis).split()]
    assert math.atan2(across[1], -across[2]) == pytest.approx(math.pi / 2 - 1.57, rel=1e-6)
    assert not [line for line in caplog.messages if "skewed" in line or "one cylinder" in line]


@pytest.mark.parametrize(
    ("wheels", "said"),
    [
        (slanted(25.0), "deviate by 25 deg: left_wheel_joint; correct the <axis>"),
        (
            slanted(0.0).replace('xyz="0.0 1.0 0"', 'xyz="0 0 1"'),
            "vertical axis steer their wheels",
        ),
    ],
)
def test_a_named_wheel_that_turns_elsewhere_is_refused(
    tmp_path: Path, wheels: str, said: str
) -> None:
    with pytest.raises(InputError) as caught:
        load(tmp_path, BASE, wheels, CASTER, drive=NAMED)
    assert said in str(caught.value)
    assert "steer" in str(caught.value)
    assert "\n" not in str(caught.value)


TETRAHEDRA = {
    "mesh": '<geometry><mesh filename="wheel.stl" scale="0.001 0.001 0.001"/></geometry>',
    "box": '<geometry><box size="0.0707106781 0.03 0.0707106781"/></geometry>',
    "capsule": '<origin rpy="1.5707963 0 0"/><geometry><capsule radius="0.05" length="0.001"/>'
    "</geometry>",
    "ellipsoid": '<geometry><ellipsoid radii="0.05 0.02 0.05"/></geometry>',
}


def write_wheel(path: Path, radius: float = 50.0, half: float = 15.0) -> None:
    """Write a round part about y, in millimetres."""
    rim = [2 * math.pi * i / 48 for i in range(48)]
    left = [(radius * math.cos(a), half, radius * math.sin(a)) for a in rim]
    right = [(x, -y, z) for x, y, z in left]
    triangles: list[Sequence[tuple[float, float, float]]] = []
    for i in range(48):
        j = (i + 1) % 48
        triangles += [(left[i], left[j], right[i]), (left[j], right[j], right[i])]
        triangles += [(left[0], left[i], left[j]), (right[0], right[j], right[i])]
    facets = [
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in corners)
        + "endloop\nendfacet\n"
        for corners in triangles
        if len(set(corners)) == 3
    ]
    path.write_text("solid wheel\n" + "".join(facets) + "endsolid wheel\n")


@pytest.mark.parametrize("kind", TETRAHEDRA)
@pytest.mark.parametrize("part", ["collision", "visual"])
def test_a_wheel_of_any_shape_becomes_a_cylinder(
    tmp_path: Path, caplog: Log, kind: str, part: str
) -> None:
    write_wheel(tmp_path / "wheel.stl")
    shape = f"<{part}>{TETRAHEDRA[kind]}</{part}>"
    if kind == "box":  # not round: it must be named
        drive: DriveDescription | None = DifferentialDescription(
            ["left_wheel_joint", "right_wheel_joint"], ["caster_link"], 0.24, 0.9, 0.5
        )
    else:
        drive = None
    robot = load(tmp_path, BASE, wheel("left", shape), wheel("right", shape), CASTER, drive=drive)
    assert two_wheeled(robot).wheel_radii_m[0] == pytest.approx(0.05, rel=0.02)
    tags = [s.tag for s in robot.urdf_elements().findall("link[@name='left_wheel']/collision//*")]
    assert tags.count("cylinder") == 1
    assert not {"convex", "sphere", "box"} & set(tags)
    assert "left_wheel" in told(caplog, "one cylinder")


def test_a_box_in_place_of_a_wheel_yields_to_the_round_wheel_that_is_shown(
    tmp_path: Path, caplog: Log
) -> None:
    box = '<collision><geometry><box size="0.1 0.03 0.1"/></geometry></collision>'
    parts = [wheel(side, box + f"<visual>{DISC}</visual>") for side in ("left", "right")]
    robot = load(tmp_path, BASE, *parts, CASTER)
    assert two_wheeled(robot).wheel_radii_m[0] == pytest.approx(0.05)
    assert shapes(robot, "left_wheel").count("box") == 0
    assert "left_wheel, right_wheel" in told(caplog, "angular collision shapes")


def test_several_shapes_of_a_wheel_become_one(tmp_path: Path) -> None:
    tyre = link("tyre", f"<collision>{DISC}</collision>", INERTIAL.format(0.1, 1e-4))
    fixed = joint("tyre_joint", "tyre").replace("base_link", "left_wheel")
    hub = f"<collision>{DISC.replace('0.05', '0.03')}</collision>"
    robot = load(tmp_path, BASE, wheel("left", hub), tyre, fixed, wheel("right"), CASTER)
    assert two_wheeled(robot).wheel_radii_m[0] == pytest.approx(0.05)
    assert shapes(robot, "tyre") == []


@pytest.mark.parametrize("place", ["0 0.04 0", "0 -0.04 0"])
def test_a_hub_beside_the_tread_changes_neither_track_nor_width(tmp_path: Path, place: str) -> None:
    hub = DISC.replace("0.05", "0.03").replace('"0.03"/', '"0.1"/')
    gear = f"<collision>{hub}</collision>".replace("<origin", f'<origin xyz="{place}"')
    disc = f"<collision>{DISC}</collision>"
    robot = load(tmp_path, BASE, wheel("left", disc + gear), wheel("right", disc + gear), CASTER)
    assert two_wheeled(robot).track_m == pytest.approx(0.24)
    cylinder = element(robot, "link[@name='left_wheel']/collision/geometry/cylinder")
    assert float(cylinder.get("length", "")) == pytest.approx(0.03)


def test_masses_are_completed(tmp_path: Path, caplog: Log) -> None:
    """A description that was made to be looked at has none at all."""
    wheels = wheel("left", mass="") + wheel("right", mass="")
    robot = load(tmp_path, link("base_link", BOX), wheels, CASTER)
    mass = {
        str(link.get("name")): float(str(link.find("inertial/mass").get("value")))  # type: ignore[union-attr]
        for link in robot.urdf_elements().findall("link")
    }
    assert mass["left_wheel"] == pytest.approx(500 * 0.1 * 0.1 * 0.03)
    assert "left_wheel, right_wheel" in told(caplog, "masses are estimated")


@pytest.mark.parametrize(
    "inertial",
    [
        INERTIAL.format(2.0, 0.0),  # zero
        INERTIAL.format(2.0, 1e-12),  # tiny
        INERTIAL.format(2.0, -1.0),
        INERTIAL.format(2.0, 50.0),  # as of a robot of ten metres
        '<inertial><mass value="2"/></inertial>',
        '<inertial><mass value="2"/><inertia ixx="1" iyy="0.01" izz="0.01"/></inertial>',
    ],
)
def test_impossible_inertias_become_those_of_the_shape(
    tmp_path: Path, caplog: Log, inertial: str
) -> None:
    robot = load(tmp_path, link("base_link", BOX, inertial), WHEELS, CASTER)
    inertia = element(robot, "link[@name='base_link']/inertial/inertia")
    moments = sorted(float(str(inertia.get(name))) for name in ("ixx", "iyy", "izz"))
    expected = sorted(2 / 12 * (a * a + b * b) for a, b in ((0.2, 0.1), (0.3, 0.1), (0.3, 0.2)))
    assert moments == pytest.approx(expected)
    assert "base_link" in told(caplog, "impossible inertias")


@pytest.mark.parametrize(("z", "warns"), [(0.1, False), (120.0, True)])
def test_a_centre_of_mass_far_from_the_robot_is_told(
    tmp_path: Path, caplog: Log, z: float, warns: bool
) -> None:
    """As in millimetres: physics would turn the robot over."""
    inertial = INERTIAL.format(2.0, 0.02).replace("<mass", f'<origin xyz="0 0 {z}"/><mass')
    load(tmp_path, link("base_link", BOX, inertial), WHEELS, CASTER)
    assert any("not be in metres" in m and "base_link" in m for m in caplog.messages) == warns


@pytest.mark.parametrize(("x", "moved"), [(0.04, False), (0.16, True)])
def test_a_wheel_whose_mass_is_elsewhere_is_balanced(
    tmp_path: Path, caplog: Log, x: float, moved: bool
) -> None:
    """As if the wheel had the body's <inertial>: it would throw the robot about."""
    mass = INERTIAL.format(2.0, 0.02).replace("<mass", f'<origin xyz="{x} 0 0"/><mass')
    robot = load(tmp_path, BASE, wheel("left", mass=mass), wheel("right"), CASTER)
    origin = element(robot, "link[@name='left_wheel']/inertial").find("origin")
    centre = "0 0 0" if origin is None else str(origin.get("xyz"))
    assert float(centre.split()[0]) == (0.0 if moved else x)
    assert any("outside their wheels" in message for message in caplog.messages) == moved


def test_a_wheel_gets_no_inertia_that_no_wheel_of_its_size_has(tmp_path: Path, caplog: Log) -> None:
    """The robot of the URDF tutorial has 1 kg m2 in wheels of 3.5 cm: it rears up."""
    mass = INERTIAL.format(1.0, 0.1)
    robot = load(tmp_path, BASE, wheel("left", mass=mass), wheel("right"), CASTER)
    inertia = element(robot, "link[@name='left_wheel']/inertial/inertia")
    assert float(str(inertia.get("iyy"))) == pytest.approx(0.5 * 0.05**2)
    assert told(caplog, "left_wheel (0.1 kg m2, at most 0.0025 on its rim)")


@pytest.mark.parametrize(("limit", "warns"), [(0.6, False), (3.1416, False), (35, True)])
def test_stops_of_a_steering_in_degrees_are_told(
    tmp_path: Path, caplog: Log, limit: float, warns: bool
) -> None:
    stops = (
        f'<axis xyz="0 0.1 1"/><limit lower="{-limit}" upper="{limit}" effort="1" velocity="1"/>'
    )
    front = "".join(
        link(f"{side}_hinge", INERTIAL.format(0.1, 1e-4))
        + joint(f"{side}_steering", f"{side}_hinge", f"0.2 {y} 0.05", "revolute", stops)
        + link(
            f"{side}_front_wheel", f"<collision>{DISC}</collision>", INERTIAL.format(0.2, 0.0003)
        )
        + joint(
            f"{side}_front_joint",
            f"{side}_front_wheel",
            kind="continuous",
            more=f'<axis xyz="0 1 0"/>{LIMIT}',
        ).replace('parent link="base_link"', f'parent link="{side}_hinge"')
        for side, y in (("left", 0.12), ("right", -0.12))
    )
    robot = load(tmp_path, BASE, WHEELS, front)
    assert isinstance(robot.drive, Ackermann)
    assert any("may be in degrees: left_st" in m for m in caplog.messages) == warns
    assert "left_steering (5.7 deg), right_steering (5.7 deg)" in told(caplog, "skewed axes")


def test_a_mass_of_zero_makes_a_frame(tmp_path: Path, caplog: Log) -> None:
    scan = link("scan", INERTIAL.format(0, 0)) + joint("scan_joint", "scan", "0.1 0 0.2")
    robot = load(tmp_path, BASE, WHEELS, CASTER, scan)
    assert element(robot, "link[@name='scan']").find("inertial") is None
    assert "scan" in told(caplog, "mass of 0")


HELD = {
    "revolute": '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>',
    "continuous": '<axis xyz="0 0 1"/>',
    "prismatic": '<axis xyz="0 0 1"/><limit lower="0" upper="0.1" effort="1" velocity="1"/>',
    "floating": "",
    "planar": '<axis xyz="0 0 1"/>',
}


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ('<limit lower="1" upper="2" effort="1" velocity="1"/>', "zero: arm_joint (from 1"),
        ('<limit lower="-1" upper="1"/><mimic joint="o" offset="0.5"/>', "arm_joint (offset 0.5)"),
        ('<limit lower="-1" upper="0"/><mimic joint="o" multiplier="2"/>', ""),
    ],
)
def test_a_joint_that_cannot_be_at_zero_is_told(
    tmp_path: Path, caplog: Log, more: str, says: str
) -> None:
    arm = link("arm", BALL, INERTIAL.format(0.2, 1e-4))
    axis = '<axis xyz="0 1 0"/>'
    arm += joint("arm_joint", "arm", "0 0 0.2", "revolute", axis + more)
    load(tmp_path, BASE, WHEELS, CASTER, arm)
    assert any(says in line for line in caplog.messages if "exclude zero" in line) == bool(says)


@pytest.mark.parametrize(("rpy", "warns"), [("0 -15 90", True), ("0 -0.26 1.571", False)])
def test_angles_in_degrees_are_told(tmp_path: Path, caplog: Log, rpy: str, warns: bool) -> None:
    camera = link("camera") + joint("camera_joint", "camera", "0 0 0.2", rpy=rpy)
    load(tmp_path, BASE, WHEELS, CASTER, camera)
    assert (
        any("'camera_joint'" in m and "convert them to radians" in m for m in caplog.messages)
        == warns
    )


@pytest.mark.parametrize("kind", HELD)
def test_joints_beside_the_drive_are_held(tmp_path: Path, caplog: Log, kind: str) -> None:
    """An arm, a pan-tilt unit, a spring: none of them may brake or swing unheard of."""
    arm = link("arm", BALL, INERTIAL.format(0.2, 1e-4))
    mimic = '<mimic joint="other"/>' if kind == "revolute" else ""
    arm += joint("arm_joint", "arm", "0 0 0.2", kind, HELD[kind] + mimic)
    robot = load(tmp_path, BASE, WHEELS, CASTER, arm)
    assert element(robot, "joint[@name='arm_joint']").get("type") == "fixed"
    assert told(caplog, "joints outside the drive are locked at zero: arm_joint")
    assert "arm" in robot.sensor_links


def test_a_shape_of_the_body_near_the_ground_slides(tmp_path: Path, caplog: Log) -> None:
    foot = '<collision><origin xyz="-0.12 0 0.021"/><geometry><sphere radius="0.02"/></geometry>'
    base = link("base_link", BOX, f"{foot}</collision>", INERTIAL.format(2.0, 0.02))
    robot = load(tmp_path, base, WHEELS)
    assert robot.drive.caster_links == ("base_link_caster",)
    assert "base_link_caster" in robot.exposed_links
    assert shapes(robot, "base_link_caster") == ["sphere"]
    assert "base_link" in told(caplog, "low parts of the body slide")


def test_a_swivel_caster_is_held_and_slides(tmp_path: Path, caplog: Log) -> None:
    swivel = link("swivel", INERTIAL.format(0.1, 1e-4))
    swivel += joint("swivel_joint", "swivel", "-0.12 0 0.05", "continuous", '<axis xyz="0 0 1"/>')
    roll = link("caster_wheel", f"<collision>{DISC.replace('0.05', '0.03')}</collision>")
    roll += joint(
        "roll", "caster_wheel", "-0.01 0 -0.02", "continuous", '<axis xyz="0 1 0"/>'
    ).replace("base_link", "swivel")
    robot = load(tmp_path, BASE, WHEELS, swivel, roll)
    assert robot.drive.caster_links == ("caster_wheel",)
    assert told(caplog, "locked at zero: swivel_joint, roll")
    assert told(caplog, "links found as casters slide without friction: caster_wheel")


def test_a_caster_below_the_ground_is_raised(tmp_path: Path, caplog: Log) -> None:
    robot = load(tmp_path, BASE, WHEELS, CASTER.replace("-0.12 0 0.02", "-0.12 0 0.015"))
    origin = element(robot, "link[@name='caster_link']/collision/origin")
    assert float(str(origin.get("xyz")).split()[2]) == pytest.approx(0.005)
    assert told(caplog, "raised to its surface: caster_link")


def test_a_body_far_below_the_ground_is_cut_off(tmp_path: Path, caplog: Log) -> None:
    base = BASE.replace('xyz="0 0 0.08"', 'xyz="0 0 0.02"')
    robot = load(tmp_path, base, WHEELS, CASTER)
    assert shapes(robot, "base_link") == ["convex"]
    (solid,) = (solid for solid in robot.solids if solid.link == "base_link")
    assert solid.height_range == pytest.approx((0.02, 0.07))
    assert told(caplog, "just above it: base_link")


@pytest.mark.parametrize("x", [0.05, -0.05])
def test_a_robot_without_casters_slides_on_assumed_balls(
    tmp_path: Path, caplog: Log, x: float
) -> None:
    robot = load(tmp_path, BASE, WHEELS)
    assert set(robot.drive.caster_links) == {"evoros_support_front", "evoros_support_rear"}
    assert told(caplog, "support at the front and rear of the robot is assumed")
    caplog.clear()
    heavy = BASE.replace("<inertial>", f'<inertial><origin xyz="{x} 0 0.1"/>')
    robot = load(tmp_path, heavy, WHEELS, CASTER)
    assert len(robot.drive.caster_links) == (2 if x > 0 else 1)


@pytest.mark.parametrize(("y", "sides"), [(0.1, {"right"}), (-0.1, {"left"}), (0.0, set())])
def test_casters_on_one_side_are_mirrored_if_the_robot_would_tip(
    tmp_path: Path, y: float, sides: set[str]
) -> None:
    heavy = BASE.replace("<inertial>", '<inertial><origin xyz="-0.1 0 0.1"/>')
    robot = load(tmp_path, heavy, WHEELS, CASTER.replace("-0.12 0 0.02", f"-0.12 {y} 0.02"))
    assert set(robot.drive.caster_links) - {"caster_link"} == {f"evoros_support_{s}" for s in sides}
    for side in sides:
        place = element(robot, f"joint[@name='evoros_support_{side}_joint']/origin").get("xyz", "")
        assert [float(word) for word in place.split()] == pytest.approx([-0.12, -y, 0.01])
    light = BASE.replace("<inertial>", '<inertial><origin xyz="-0.02 0 0.1"/>')
    robot = load(tmp_path, light, WHEELS, CASTER.replace("-0.12 0 0.02", f"-0.12 {y} 0.02"))
    assert robot.drive.caster_links == ("caster_link",)


def test_an_assumed_support_is_as_high_as_its_counterpart_and_names_what_ends_above_it(
    tmp_path: Path, caplog: Log
) -> None:
    """One caster of the Tracer Mini has a radius of 1 cm in its file, the other of 5 cm."""
    heavy = BASE.replace("<inertial>", '<inertial><origin xyz="-0.1 0 0.1"/>')
    left = CASTER.replace("-0.12 0 0.02", "-0.12 0.1 0.023")
    right = CASTER.replace("caster", "small").replace("-0.12 0 0.02", "-0.12 -0.1 0.05")
    robot = load(tmp_path, heavy, WHEELS, left, right)
    place = element(robot, "joint[@name='evoros_support_right_joint']/origin").get("xyz", "")
    assert [float(word) for word in place.split()] == pytest.approx([-0.12, -0.1, 0.013])
    assert told(caplog, "(small_link ends 30 mm above the ground there, its counterpart at 3 mm")


def test_a_body_without_collision_shapes_has_the_hull_of_its_visuals(
    tmp_path: Path, caplog: Log
) -> None:
    shown = BOX.replace("collision", "visual")
    robot = load(tmp_path, link("base_link", shown, INERTIAL.format(2.0, 0.02)), WHEELS, CASTER)
    assert np.ptp(robot.outline, axis=0) == pytest.approx([0.3, 0.27])  # with the wheels
    assert robot.height_m == pytest.approx(0.13)
    assert told(caplog, "no collision shapes, so the hull of its visuals is used")
    tiny = BOX.replace("0.3 0.2 0.1", "0.01 0.01 0.01")
    load(tmp_path, link("base_link", shown, tiny, INERTIAL.format(2.0, 0.02)), WHEELS, CASTER)
    assert told(caplog, "only small collision shapes")


MESH = '<collision><geometry><mesh filename="{}"/></geometry></collision>'


def test_a_mesh_of_the_body_becomes_convex_parts(tmp_path: Path, caplog: Log) -> None:
    write_wheel(tmp_path / "body.stl", 0.1, 0.08)
    mesh = MESH.format("body.stl").replace("<geometry>", '<origin xyz="0 0 0.13"/><geometry>')
    robot = load(tmp_path, link("base_link", mesh, INERTIAL.format(2.0, 0.02)), WHEELS, CASTER)
    assert shapes(robot, "base_link") == ["convex"]
    assert robot.height_m == pytest.approx(0.23, abs=1e-3)
    assert f"file://{tmp_path / 'body.stl'}" in robot.urdf
    assert told(caplog, "collision meshes replaced with convex parts: 1")


def test_a_mesh_in_millimetres_is_told(tmp_path: Path, caplog: Log) -> None:
    write_wheel(tmp_path / "body.stl", 100.0, 80.0)
    load(tmp_path, link("base_link", MESH.format("body.stl"), INERTIAL.format(2, 0.02)), WHEELS)
    (line,) = (message for message in caplog.messages if "millimetres; set the scale" in message)
    assert line.startswith(str(tmp_path / "body.stl"))


def test_a_missing_mesh_is_an_error_or_a_box(tmp_path: Path, caplog: Log) -> None:
    mesh = MESH.format("package://bot/meshes/body.dae")
    base = link("base_link", mesh, BOX, INERTIAL.format(2.0, 0.02))
    with pytest.raises(InputError, match=r"bot\.urdf:2: <mesh>.*body\.dae.*robot\.missing=box"):
        load(tmp_path, base, WHEELS, CASTER)
    robot = load(tmp_path, base, WHEELS, CASTER, missing="box")
    assert set(shapes(robot, "base_link")) == {"box", "convex"}  # its lower part is cut off
    assert "package://bot/meshes/body.dae" in told(caplog, "missing meshes are replaced with boxes")
    with pytest.raises(InputError, match=r"robot\.missing"):
        load(tmp_path, base, WHEELS, CASTER, missing="ignore")


def test_a_mesh_of_many_parts_is_its_hull_and_told_so(tmp_path: Path, caplog: Log) -> None:
    """A sieve of 9 x 9 bars, 6 mm wide and 12 mm apart: its hull is up to 3 mm off, at the top."""
    import trimesh

    bars = []
    for i in range(9):
        for j in range(9):
            bar = trimesh.creation.box((0.012, 0.006, 0.1))
            bars.append(bar.apply_translation((0.03 * (i - 4), 0.02 * (j - 4), 0.13)))
    sieve: Any = trimesh.util.concatenate(bars)
    sieve.export(tmp_path / "sieve.stl")
    robot = load(
        tmp_path,
        link("base_link", MESH.format("sieve.stl"), INERTIAL.format(2.0, 0.02)),
        WHEELS,
        CASTER,
    )
    assert shapes(robot, "base_link") == ["convex"]
    (line,) = (text for text in caplog.messages if "replaced with its convex hull" in text)
    assert "the mesh has 81 convex parts, more than 64" in line
    assert told(caplog, "collision meshes replaced with convex hulls: 1")
    assert not any("replaced with convex parts" in message for message in caplog.messages)


def test_a_body_whose_mesh_is_missing_has_a_box(tmp_path: Path, caplog: Log) -> None:
    """The mass is in a frame, so that the link of the mesh has no inertia to make a box of."""
    body = link("base_link", MESH.format("package://bot/meshes/body.dae"))
    mass = link("mass", INERTIAL.format(2.0, 0.02)) + joint("mass_joint", "mass")
    robot = load(tmp_path, body, mass, WHEELS, CASTER, missing="box")
    assert shapes(robot, "base_link") == ["box"]
    low, high = robot.outline.min(axis=0), robot.outline.max(axis=0)
    assert low == pytest.approx([-0.14, -0.135])  # from the caster to the front of the wheels
    assert high == pytest.approx([0.05, 0.135])
    assert robot.height_m == pytest.approx(0.1)
    assert "package://bot/meshes/body.dae" in told(caplog, "missing meshes are left out")
    assert "0.19 x 0.27 x 0.08 m" in told(caplog, "box around the wheels replaces them")
    assert not any("replaced with boxes" in message for message in caplog.messages)


def test_shapes_without_a_size_are_left_out(tmp_path: Path, caplog: Log) -> None:
    none = '<collision><geometry><box size="0 0 0"/></geometry></collision><collision/>'
    robot = load(tmp_path, link("base_link", BOX, none, INERTIAL.format(2, 0.02)), WHEELS, CASTER)
    assert shapes(robot, "base_link") == ["box"]
    assert "base_link" in told(caplog, "without a size")


@pytest.mark.parametrize(("axial", "radial"), [(0.02, 0.0101), (0.005, 0.0252)])
def test_absent_meshes_of_wheels_become_wheels_with_their_inertia(
    axial: float, radial: float, tmp_path: Path, caplog: Log
) -> None:
    inertial = INERTIAL.format(1.0, radial).replace(f'iyy="{radial}"', f'iyy="{axial}"')
    mesh = '<collision><geometry><mesh filename="wheel.stl"/></geometry></collision>'
    radius = math.sqrt(2.0 * axial)
    wheels = wheel("left", mesh, mass=inertial, z=radius) + wheel(
        "right", mesh, mass=inertial, z=radius
    )
    with pytest.raises(InputError, match=r"; or set robot\.missing=box for meshes"):
        load(tmp_path, BASE, wheels, CASTER)
    robot = load(tmp_path, BASE, wheels, CASTER, missing="box")
    assert two_wheeled(robot).max_speed_mps == pytest.approx(min(8.0 * radius, 1.0))
    assert f"wheel.stl (radius {radius:.3g} m)" in told(caplog, "replaced with cylinders")


@pytest.mark.parametrize("size", ['radius="0" length="0.03"', 'radius="0.05" length="0"'])
def test_a_wheel_without_a_size_is_refused_by_its_line(size: str, tmp_path: Path) -> None:
    flat = WHEELS.replace('radius="0.05" length="0.03"', size)
    stated = size.replace('="', " ").replace('"', "")
    problem = f"bot.urdf:2: <cylinder> of link 'left_wheel' .* not '{stated}'; write the lengths"
    with pytest.raises(InputError, match=problem):
        load(tmp_path, BASE, flat, CASTER)


def test_tiny_wheels_are_told_and_drive_when_they_are_named(tmp_path: Path) -> None:
    tiny = WHEELS.replace('radius="0.05"', 'radius="0.005"').replace(" 0.05", " 0.005")
    with pytest.raises(
        InputError, match=r"left_wheel_joint \(radius 0.005 m, too small to be a wheel unless"
    ):
        load(tmp_path, BASE, tiny, CASTER)
    sides: dict[str, Any] = {
        f"{side}_wheel_joints": [f"{side}_wheel_joint"] for side in ("left", "right")
    }
    robot = load(tmp_path, BASE, tiny, CASTER, drive=AutomaticDescription(**sides))
    assert two_wheeled(robot).max_speed_mps == pytest.approx(8 * 0.005)


def test_stops_and_missing_friction_of_wheels_are_told(tmp_path: Path, caplog: Log) -> None:
    stops = f'{AXIS}<limit lower="-1" upper="2" effort="1" velocity="8"/>'
    wheels = wheel("left", kind="revolute", more=stops) + wheel("right")
    slippery = '<gazebo reference="right_wheel"><mu1>0</mu1><mu2 value="0.0"/></gazebo>'
    halved = '<gazebo reference="left_wheel"><mu1>0</mu1><mu2>1</mu2></gazebo>'
    load(tmp_path, BASE, wheels, CASTER, slippery, halved)
    assert told(caplog, "stops in the joints").endswith("left_wheel_joint (from -1 to 2 rad)")
    assert told(caplog, "slide in Gazebo").endswith("(<mu> is 0): right_wheel_joint")


def test_an_absent_mesh_of_a_sensor_is_left_out_and_told(tmp_path: Path, caplog: Log) -> None:
    mesh = '<collision><geometry><mesh filename="{0}.stl"/></geometry></collision>'
    laser, payload = (
        link(name, mesh.format(name)) + joint(f"{name}_joint", name)
        for name in ("front_laser", "payload")
    )
    load(tmp_path, BASE, WHEELS, CASTER, laser)
    assert told(caplog, "missing meshes are left out").endswith("front_laser.stl")
    with pytest.raises(InputError, match=r"payload.stl"):
        load(tmp_path, BASE, WHEELS, CASTER, payload)


def test_wheels_on_the_wrong_sides_are_told_by_their_places(tmp_path: Path) -> None:
    sides: dict[str, Any] = {
        "left_wheel_joints": ["right_wheel_joint"],
        "right_wheel_joints": ["left_wheel_joint"],
    }
    problem = "'right_wheel_joint' must be left of 'left_wheel_joint', but they are at y = -0.12"
    with pytest.raises(InputError, match=problem):
        load(tmp_path, BASE, WHEELS, CASTER, drive=AutomaticDescription(**sides))


def test_a_file_of_something_else_is_told_as_such(tmp_path: Path) -> None:
    (tmp_path / "bot.urdf").write_text("<sdf><model name='m'><mesh/></model></sdf>")
    with pytest.raises(InputError, match=r"bot\.urdf:1: <sdf> must be <robot>, not <sdf>; name"):
        load_robot(str(tmp_path / "bot.urdf"), AutomaticDescription())


def test_a_mesh_scaled_to_nothing_is_refused_by_its_line(tmp_path: Path) -> None:
    (tmp_path / "body.stl").write_text("solid nothing")
    flat = BOX.replace('<box size="0.3 0.2 0.1"/>', '<mesh filename="body.stl" scale="1 1 0"/>')
    with pytest.raises(InputError, match=r"bot.urdf:2: <mesh> .* scale per axis, not '1 1 0'"):
        load(tmp_path, link("base_link", flat, INERTIAL.format(2, 0.02)), WHEELS, CASTER)


def test_a_robot_that_is_only_moved_sideways_is_not_told_to_be_raised(
    tmp_path: Path, caplog: Log
) -> None:
    aside = wheel("left", z=0.05, y=0.02) + wheel("right", z=0.05, y=0.02)
    load(tmp_path, BASE, aside, CASTER)
    assert "the ground 0.02 m to the left of the root link" in told(caplog, "touch the ground")


def test_slips_that_other_readers_take_are_taken(tmp_path: Path, caplog: Log) -> None:
    inside = BOX.replace("</geometry>", '<origin xyz="0 0 1"/></geometry>')
    robot = load(tmp_path, link("base_link", inside, INERTIAL.format(2, 0.02)), WHEELS, CASTER)
    assert robot.height_m == pytest.approx(0.13)
    assert "<origin> of base_link" in told(caplog, "left out")
    text = (tmp_path / "bot.urdf").read_text()
    (tmp_path / "late.urdf").write_text(f'<!-- by hand -->\n<?xml version="1.0"?>\n{text}')
    load_robot(str(tmp_path / "late.urdf"), AutomaticDescription())
    assert any("XML declaration" in message for message in caplog.messages)


def test_names_with_slashes_and_spaces_are_names(tmp_path: Path) -> None:
    parts = "".join((BASE, WHEELS, CASTER)).replace("base_link", "bot 1/base_link")
    parts = parts.replace("left_wheel", "/tf/left_wheel")
    robot = load(tmp_path, parts)
    assert two_wheeled(robot).wheel_joints == ("/tf/left_wheel_joint", "right_wheel_joint")
    assert robot.mount_link == "bot 1/base_link"


@pytest.mark.parametrize("touch", [True, False])
def test_wheels_that_stick_out_belong_to_the_outline(tmp_path: Path, touch: bool) -> None:
    robot = load(tmp_path, BASE, WHEELS, CASTER, wheels_touch=touch)
    assert robot.exposed_links == ({"left_wheel", "right_wheel"} if touch else set())
    assert np.ptp(robot.outline, axis=0)[1] == pytest.approx(0.27 if touch else 0.2)


def test_a_ball_with_a_narrow_wheel_shown_counts_as_that_wheel(tmp_path: Path) -> None:
    shape = '<collision><geometry><sphere radius="0.05"/></geometry></collision>'
    shape += f"<visual>{DISC}</visual>"
    robot = load(tmp_path, BASE, wheel("left", shape), wheel("right", shape), CASTER)
    assert np.ptp(robot.outline, axis=0)[1] == pytest.approx(0.27)


@pytest.mark.parametrize("key", ["ignored_packages", "environment", "packages", "mount"])
def test_a_key_of_another_type_is_named(tmp_path: Path, key: str) -> None:
    wrong: dict[str, Any] = {key: "x"}
    with pytest.raises(InputError, match=rf"robot\.{key}"):
        load(tmp_path, BASE, WHEELS, CASTER, **wrong)


def test_all_wheels_of_one_mistake_are_in_the_keys_that_mend_it(tmp_path: Path) -> None:
    """Their frames and axes are both turned, as if they rolled about the vertical.

    Only the rear ones are called wheels.
    """
    shown = DISC.partition("/>")[2]
    parts = "".join(
        link(f"{side}_{name}", f"<visual>{shown}</visual>")
        + joint(name + side, f"{side}_{name}", f"{x} {y} 0.05", "continuous", AXIS, "1.5707963 0 0")
        for name, x in (("front", 0.1), ("wheel", -0.1))
        for side, y in (("left", 0.12), ("right", -0.12))
    )
    with pytest.raises(InputError) as caught:
        load(tmp_path, BASE, parts)
    words = re.findall(r"'robot\.drive\.(\w+)=\[([^\]]*)\]'", str(caught.value))
    keys: dict[str, Any] = {key: tuple(names.split(",")) for key, names in words}
    assert [len(joints) for joints in keys.values()] == [2, 2]
    robot = load(tmp_path, BASE, parts, drive=AutomaticDescription(**keys))
    assert len(robot.drive.wheel_joints) == 4


def test_fixed_wheels_that_are_only_shown_are_found_on_a_solid_body(tmp_path: Path) -> None:
    shown: Any = {"shape": f"<visual>{DISC}</visual>", "kind": "fixed", "more": "", "mass": ""}
    robot = load(tmp_path, BASE, wheel("left", **shown), wheel("right", **shown), CASTER)
    assert two_wheeled(robot).track_m == pytest.approx(0.24)


def test_a_steered_wheel_that_only_supports_is_no_body(tmp_path: Path) -> None:
    """The body has no collision shape: it collides with what it shows, the wheel does not do."""
    shown = BOX.replace("collision", "visual")
    base = link("base_link", shown, INERTIAL.format(2.0, 0.02))
    steer = link("steer") + joint("steer_joint", "steer", "-0.1 0 0.05", "continuous",
                                  '<axis xyz="0 0 1"/>')  # fmt: skip
    disc = f"<collision>{DISC}</collision>"
    third = link("third_wheel", disc) + joint("third_joint", "third_wheel", kind="continuous",
                                              more='<axis xyz="0 1 0"/>')  # fmt: skip
    third = third.replace('parent link="base_link"', 'parent link="steer"')
    robot = load(tmp_path, base, WHEELS, steer, third)
    assert np.ptp(robot.outline, axis=0) == pytest.approx([0.3, 0.27])


def test_each_axle_has_the_torque_of_its_own_radius(tmp_path: Path) -> None:
    """A motor without a limit of effort carries the robot's weight at its wheel's radius."""
    large = DISC.replace('radius="0.05"', 'radius="0.1"')
    big: Any = {"shape": f"<collision>{large}</collision>", "z": 0.1, "x": -0.2}
    rear = "".join(wheel(side, more=AXIS, **big) for side in ("left", "right"))
    rear = rear.replace("left_wheel", "left_rear_wheel").replace("right_wheel", "right_rear_wheel")
    front = "".join(wheel(side, more=AXIS) for side in ("left", "right"))
    robot = load(tmp_path, BASE, front, rear)
    weight = (2.0 + 4 * 0.2) * GRAVITY_MPS2
    for name, radius in (("left_wheel", 0.05), ("right_rear_wheel", 0.1)):
        limit = element(robot, f"joint[@name='{name}_joint']/limit")
        assert float(limit.get("effort", "")) == pytest.approx(weight * radius)
