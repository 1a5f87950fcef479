"""Machines that no drive here moves are named and refused, with a fix that works."""

import math
import re
from dataclasses import replace

import pytest
from drive_cases import (
    FRONT,
    LIMIT,
    PAIR,
    REAR,
    ROUND,
    Z,
    choose,
    joint,
    link,
    read,
    steered,
    wheel,
)
from fixture_types import Log
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.drive.ackermann import AckermannDescription
from evoros.drive.automatic import AutomaticDescription
from evoros.drive.differential import DifferentialDescription
from evoros.drive.skid_steer import SkidSteerDescription

MESH = '<visual><geometry><mesh filename="package://r/meshes/{}"/></geometry></visual>'
FOUR = (
    ("fl", "0.2 0.1 0.05"),
    ("fr", "0.2 -0.1 0.05"),
    ("rl", "-0.2 0.1 0.05"),
    ("rr", "-0.2 -0.1 0.05"),
)


def refusal(*parts: str) -> str:
    with pytest.raises(InputError) as caught:
        choose(*parts)
    message = str(caught.value)
    assert message.startswith("r.urdf: ")
    assert "\n" not in message
    return message


def four(name: str = "{}_wheel", body: str = ROUND, below: str = "") -> str:
    """Return four wheels whose links have a name, a body and more parts ``below`` them."""
    parts = []
    for corner, xyz in FOUR:
        child = name.format(corner)
        parts += [link(child, body), joint(f"{corner}_joint", child, xyz)]
        parts.append(below.replace("PARENT", child).replace("CORNER", corner))
    return "".join(parts)


PUSHED = '<gazebo><plugin filename="libnew_force_based_move.so" name="m"/></gazebo>'
SLIPPERY = '<gazebo reference="{}_wheel"><mu1>0.0</mu1></gazebo>'
ROLLERS = "".join(
    link(f"CORNER_roller_{i}", "") + joint(f"CORNER_r{i}", f"CORNER_roller_{i}", "0 0 0", more=Z)
    for i in range(3)
).replace('<parent link="base"/>', '<parent link="PARENT"/>')


@pytest.mark.parametrize(
    ("robot", "reason"),
    [
        (four("{}_mecanum_wheel"), "mecanum wheels, according to the name 'fl_mecanum_wheel'"),
        (four(body=ROUND + MESH.format("Mecanum_left.dae")), "the name 'Mecanum_left.dae'"),
        (four(below=ROLLERS), "wheels with rollers: 'fl_wheel' has 3"),
        (
            four() + '<gazebo><plugin filename="ign_ros2_control-system" name="c"><parameters>'
            "/c/mecanum_drive_controller.yaml</parameters></plugin></gazebo>",
            "Gazebo plugin mecanum_drive_controller.yaml",
        ),
        (
            four() + PUSHED + "".join(SLIPPERY.format(corner) for corner, _ in FOUR),
            "wheels slide in Gazebo, where plugin libnew_force_based_move.so moves the robot",
        ),
    ],
)
def test_wheels_that_go_sideways_are_refused_and_driven_as_plain_ones_if_asked(
    robot: str, reason: str
) -> None:
    message = refusal(robot)
    assert reason in message
    assert "fl_joint" in message
    assert "set robot.drive.kind=skid_steer" in message
    if "roller" not in reason:
        assert isinstance(choose(robot, kind="skid_steer"), SkidSteerDescription)


def test_driven_omni_wheels_are_no_casters() -> None:
    """Without a transmission, omni wheels beside two plain ones are casters."""
    omni = wheel("omni_front", "0.2 0 0.05")
    assert isinstance(choose(PAIR, omni), DifferentialDescription)
    driven = "".join(
        f'<transmission name="t{corner}"><joint name="{corner}_joint"/></transmission>'
        for corner, _ in FOUR
    )
    message = refusal(four("{}_omni_wheel") + driven)
    assert "omni wheels, according to the name 'fl_omni_wheel'" in message


def test_twin_casters_that_may_be_driven_are_named_and_drive_if_asked() -> None:
    """The PR2 stands on four swivels with two motors each."""
    parts = [
        wheel(f"{end}{side}_{twin}_caster", f"{x} {y + shift} 0.05")
        for end, x in (("f", 0.2), ("r", -0.2))
        for side, y in (("l", 0.2), ("r", -0.2))
        for twin, shift in (("l", 0.05), ("r", -0.05))
    ]
    message = refusal(*parts)
    assert "all wheels are casters, according to their names: fl_l_caster_wheel_joint" in message
    left, right = re.findall(r"_wheel_joints=\[(.*?)\]", message)
    named = {"left_wheel_joints": left.split(","), "right_wheel_joints": right.split(",")}
    chosen = choose(*parts, kind="skid_steer", **named)
    assert chosen.left_wheel_joints[0] == "fl_l_caster_wheel_joint"
    assert chosen.right_wheel_joints[0] == "fr_r_caster_wheel_joint"


def test_the_fingers_of_a_hand_are_no_rollers() -> None:
    hand = link("wrist", "") + joint("wrist_joint", "wrist", "0 0 0.5", more=Z)
    fingers = ROLLERS.replace("CORNER", "hand").replace("PARENT", "wrist")
    casters = (FRONT + REAR).replace('_wheel"', '_caster_wheel"')
    assert "all wheels are casters" in refusal(casters, hand, fingers)


def test_three_omni_wheels_have_no_drive_to_choose() -> None:
    parts = []
    for i in range(3):
        angle = i * 2.0 * math.pi / 3.0
        x, y = 0.2 * math.cos(angle), 0.2 * math.sin(angle)
        axis = f'<axis xyz="{math.cos(angle)} {math.sin(angle)} 0"/>'
        parts += [link(f"omni_{i}"), joint(f"omni_{i}_joint", f"omni_{i}", f"{x} {y} 0", more=axis)]
    message = refusal(*parts)
    assert "omni_0_joint, omni_1_joint, omni_2_joint" in message
    assert "docs/parts/drive.md" in message


def test_a_plugin_that_pushes_a_robot_on_plain_wheels_is_told(caplog: Log) -> None:
    """Missions command no sideways motion, so such wheels only have to roll."""
    move = '<gazebo><plugin filename="libgazebo_ros_planar_move.so" name="m"/></gazebo>'
    for wheels, kind in (
        (PAIR, DifferentialDescription),
        (FRONT + REAR, SkidSteerDescription),
        (steered("revolute", LIMIT) + REAR, AckermannDescription),
    ):
        caplog.clear()
        assert isinstance(choose(wheels, move), kind)
        assert "libgazebo_ros_planar_move.so can also push the robot sideways" in caplog.text


def test_a_name_with_mecanum_counts_if_a_plugin_pushes_the_robot(caplog: Log) -> None:
    """Neither the name alone counts, nor a plugin of sensors that look in all directions."""
    seen = '<gazebo><plugin filename="libvision.so" name="ir_omni_plugin"/></gazebo>'
    named = replace(read(four()), source="my_mecanum.urdf")
    assert isinstance(AutomaticDescription().choose(named), SkidSteerDescription)
    assert isinstance(choose(four(), seen), SkidSteerDescription)
    assert "sideways" not in caplog.text
    pushed = replace(read(four(), PUSHED), source="my_mecanum.urdf")
    with pytest.raises(InputError, match=r"mecanum wheels.*'my_mecanum.urdf'.*kind=skid_steer"):
        AutomaticDescription().choose(pushed)
    asked = AutomaticDescription(kind="skid_steer").choose(pushed)
    assert isinstance(asked, SkidSteerDescription)


def test_a_robot_that_faces_along_y_is_told_so() -> None:
    across = '<collision><origin rpy="0 1.5708 0"/><geometry><cylinder radius="0.05" '
    wheels = "".join(
        link(f"{side}_wheel", f'{across}length="0.03"/></geometry></collision>')
        + joint(f"{side}_joint", f"{side}_wheel", f"{x} 0 0.05", more='<axis xyz="1 0 0"/>')
        for side, x in (("left", -0.1), ("right", 0.1))
    )
    assert "must drive forward along x (REP 103), but these wheels roll along y" in refusal(wheels)
    turned = wheels.replace('<parent link="base"/>', '<parent link="old"/>')
    root = link("old", "") + joint("turn", "old", '0 0 0" rpy="0 0 -1.5708', "fixed")
    assert isinstance(choose(root, turned), DifferentialDescription)


def carried(x: float, pivot: float) -> str:
    """Return two wheels at ``x`` on a link that turns about the vertical at ``pivot``."""
    pair = "".join(
        wheel(f"turned_{side}", f"{x - pivot} {y} 0", parent="bogie")
        for side, y in (("left", 0.1), ("right", -0.1))
    )
    return link("bogie", "") + joint("hinge", "bogie", f"{pivot} 0 0.05", more=Z) + pair


@pytest.mark.parametrize("plugin", [False, True])
@pytest.mark.parametrize(
    ("x", "pivot", "name"),
    [
        (-0.3, -0.1, "the robot bends its frame"),
        (0.3, 0.1, "the robot bends its frame"),
        (-0.3, -0.3, "the robot steers a whole axle"),
    ],
)
def test_machines_that_bend_are_named_and_driven_straight_as_proposed(
    x: float, pivot: float, name: str, plugin: bool
) -> None:
    fixed = wheel("left", f"{-x} 0.1 0.05") + wheel("right", f"{-x} -0.1 0.05")
    named = "<left_joint>left_wheel_joint</left_joint><right_joint>right_wheel_joint</right_joint>"
    drive = f'<gazebo><plugin filename="diff_drive" name="d">{named}</plugin></gazebo>' * plugin
    message = refusal(fixed, carried(x, pivot), drive)
    assert name in message
    assert "'hinge'" in message
    kind = message.partition("robot.drive.kind=")[2].partition(" ")[0]
    assert len(choose(fixed, carried(x, pivot), drive, kind=kind).wheel_joints) == 4
    alone = refusal(carried(x, pivot))  # as on a turntable, on which a robot may stand alone
    assert "robot.drive.kind=differential" in alone
    assert len(choose(carried(x, pivot), kind="differential").wheel_joints) == 2


def test_more_than_one_steered_axle_is_named_and_held_as_proposed() -> None:
    rear = steered("revolute", LIMIT).replace("left", "rear_left").replace("right", "rear_right")
    rear = rear.replace('xyz="0.2', 'xyz="-0.2')
    for parts in ((steered("revolute", LIMIT), rear), (steered("revolute", LIMIT), REAR, PAIR)):
        message = refusal(*parts)
        assert "drives with steering have one steered and one fixed axle" in message
        assert "robot.drive.kind=skid_steer" in message
        assert isinstance(choose(*parts, kind="skid_steer"), SkidSteerDescription)


def test_a_rocker_bogie_is_named() -> None:
    """Curiosity and its copies: two steered axles, of which one hangs on a bogie at each side."""
    arms = "".join(
        link(f"{side}_bogie", "") + joint(f"{side}_arm", f"{side}_bogie", f"-0.1 {y} 0.1")
        for side, y in (("left", 0.1), ("right", -0.1))
    )
    rear = steered("revolute", LIMIT).replace("left", "rear_left").replace("right", "rear_right")
    for side in ("left", "right"):
        hinge = f'<child link="rear_{side}_steering_hinge"/>'
        rear = rear.replace(
            f'<parent link="base"/>{hinge}', f'<parent link="{side}_bogie"/>{hinge}'
        )
        arms += wheel(f"middle_{side}", "0.1 0 -0.05", parent=f"{side}_bogie")
    rear = rear.replace('xyz="0.2 0.1 0.05"', 'xyz="-0.1 0 -0.05"')
    rear = rear.replace('xyz="0.2 -0.1 0.05"', 'xyz="-0.1 0 -0.05"')
    parts = (steered("revolute", LIMIT), arms, rear)
    assert "2 steered and 1 other axles on a rocker-bogie (left_arm, right_arm)" in refusal(*parts)
    assert len(choose(*parts, kind="skid_steer").wheel_joints) == 6


def test_several_vehicles_in_one_file_are_named_and_each_drives_alone() -> None:
    cars = {name: f"{steered('revolute', LIMIT)}{REAR}" for name in ("v1", "v2")}
    for name, y in (("v1", 1.0), ("v2", -1.0)):
        named = cars[name].replace('name="', f'name="{name}_').replace('link="', f'link="{name}_')
        tow = joint(f"{name}_hitch", f"{name}_base", f"0 {y} 0", more=Z)
        cars[name] = link(f"{name}_base", "") + tow + named
    message = refusal(*cars.values())
    assert "2 vehicles instead of one: v1_hitch carries v1_front_left" in message
    assert message.endswith("such as v1_base with all links below it")
    alone = cars["v1"].replace("v1_base", "base").partition("</joint>")[2]
    assert isinstance(choose(alone), AckermannDescription)


def test_driven_swivels_with_trailing_wheels_are_named_and_both_proposals_hold() -> None:
    trailing = steered("revolute", LIMIT).replace('xyz="0 0 0"', 'xyz="-0.04 0 0"')
    turned = '<transmission name="t"><joint name="{}_steering_hinge_joint"/></transmission>'
    parts = (trailing, REAR, turned.format("left"), turned.format("right"))
    message = refusal(*parts)
    assert "steers wheel front_left_wheel_joint about" in message
    kinds = re.findall(r"robot\.drive\.kind=(\w+)", message)
    assert [len(choose(*parts, kind=kind).wheel_joints) for kind in kinds] == [2, 4]


def test_wheels_that_trail_behind_a_free_swivel_are_casters() -> None:
    """They look like steered wheels, and Ackermann's stand below their joints."""
    front = steered("continuous", "").replace("steering_hinge", "fork")
    assert isinstance(choose(front, REAR), AckermannDescription)
    trailing = front.replace('xyz="0 0 0"', 'xyz="-0.04 0 0"')
    assert isinstance(choose(trailing, REAR), DifferentialDescription)
    driven = '<transmission name="t"><joint name="left_fork_joint"/></transmission>'
    assert isinstance(choose(trailing, driven, REAR, kind="differential"), DifferentialDescription)


FDIR = '<gazebo reference="{}_wheel"><fdir1 ignition:expressed_in="base">{}</fdir1></gazebo>'
NAMESPACE = 'xmlns:ignition="x"'


def test_friction_along_rollers_is_told(caplog: Log) -> None:
    """Some robots on plain wheels have it, so it alone refuses none."""
    for direction, told in (("1 -1 0", True), ("1 0 0", False), ("0 1 0", False)):
        caplog.clear()
        turned = FDIR.format("fl", direction).replace("<fdir1", f"<fdir1 {NAMESPACE}")
        assert isinstance(choose(FRONT, REAR, turned), SkidSteerDescription)
        assert ("45 deg in Gazebo (<fdir1>)" in caplog.text) == told


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("<collision><surface><friction><ode><mu>x</mu></ode></friction></surface></collision>",
         "<mu> of robot 'r' must have a number for mu, not 'x'"),
        ("<fdir1>1 0</fdir1>", "<fdir1> of robot 'r' must have 3 finite numbers, not '1 0'"),
    ],
)  # fmt: skip
def test_friction_that_is_none_is_refused(content: str, problem: str) -> None:
    with pytest.raises(InputError) as caught:
        choose(PAIR, f'<gazebo reference="left_wheel">{content}</gazebo>')
    assert problem in str(caught.value)
    assert "\n" not in str(caught.value)


def steering_front(axis: str) -> str:
    """Return two front wheels on a joint each, about an axis."""
    return wheel("fl", "0.2 0.1 0.05", more=axis) + wheel("fr", "0.2 -0.1 0.05", more=axis)


def test_wheels_that_turn_about_the_vertical_steer() -> None:
    message = refusal(steering_front(Z), REAR)
    assert "steer their wheels" in message
    assert "fl_wheel_joint, fr_wheel_joint" in message
    assert "robot.drive.kind=differential" in message
    left, right = re.findall(r"_wheel_joints=\[(.*?)\]", message)
    named = {"left_wheel_joints": left.split(","), "right_wheel_joints": right.split(",")}
    assert isinstance(choose(steering_front(Z), REAR, **named), SkidSteerDescription)
    held = choose(steering_front(Z), REAR, kind="differential")
    assert held.wheel_joints == ("rl_wheel_joint", "rr_wheel_joint")


def test_steered_wheels_that_roll_are_no_such_wheels() -> None:
    """A steering link may be called a wheel and look like one."""
    parts = []
    for side, y in (("left", 0.1), ("right", -0.1)):
        parts += [
            link(f"{side}_steering_wheel"),
            joint(f"{side}_steer", f"{side}_steering_wheel", f"0.2 {y} 0.05", more=Z),
            wheel(f"front_{side}", "0 0 0", parent=f"{side}_steering_wheel"),
        ]
    assert isinstance(choose(*parts, REAR), AckermannDescription)


def test_a_ball_that_turns_about_the_vertical_does_not_steer() -> None:
    ball = '<collision><geometry><sphere radius="0.05"/></geometry></collision>'
    front = link("front_wheel", ball) + joint("front_joint", "front_wheel", "0.2 0 0.05", more=Z)
    assert isinstance(choose(PAIR, front), DifferentialDescription)


@given(st.floats(0.0, 89.0), st.sampled_from(["level", "upright"]))
def test_wheels_stand_askew_by_20_deg_at_most(angle: float, plane: str) -> None:
    sine, cosine = math.sin(math.radians(angle)), math.cos(math.radians(angle))
    xyz = f"{sine} {cosine} 0" if plane == "level" else f"0 {cosine} {sine}"
    axis = f'<axis xyz="{xyz}"/>'
    if angle < 19.99:
        assert isinstance(choose(steering_front(axis), REAR), SkidSteerDescription)
    elif angle > 20.01:
        message = refusal(steering_front(axis), REAR)
        assert "steer" in message
        assert "fl_wheel_joint" in message


def test_what_turns_about_the_vertical_is_told_where_no_wheel_is_found() -> None:
    legs = "".join(
        link(f"{corner}_leg") + joint(f"{corner}_joint", f"{corner}_leg", xyz, more=Z)
        for corner, xyz in FOUR
    )
    assert "turning joints: fl_joint (vertical axis), fr_joint (vert" in refusal(legs)
