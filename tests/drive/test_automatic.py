"""The drive is found in descriptions as people write them, told, and refused if it is not plain."""

import re
from functools import cached_property
from typing import Any

import pytest
from drive_cases import FRONT, LIMIT, PAIR, RADIUS, REAR, Y, Z, choose, joint, link, steered, wheel

from evoros.base.errors import InputError
from evoros.drive.ackermann import AckermannDescription
from evoros.drive.automatic import AutomaticDescription
from evoros.drive.differential import DifferentialDescription
from evoros.drive.skid_steer import SkidSteerDescription
from evoros.formats.urdf import expansion
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.testing import DriveSuite


def test_a_pair_of_wheels_is_a_differential_drive(caplog: pytest.LogCaptureFixture) -> None:
    chosen = choose(PAIR)
    assert isinstance(chosen, DifferentialDescription)
    assert chosen.wheel_joints == ("left_wheel_joint", "right_wheel_joint")
    assert (chosen.wheelbase_m, chosen.max_speed_mps) == (0.2, 0.5)
    (line,) = caplog.messages
    assert "Differential; wheels left_wheel_joint, right_wheel_joint" in line


def test_two_pairs_are_skid_steer() -> None:
    chosen = choose(REAR, FRONT, turning_resistance=1.4)
    assert isinstance(chosen, SkidSteerDescription)
    assert chosen.left_wheel_joints == ("fl_wheel_joint", "rl_wheel_joint")
    assert chosen.right_wheel_joints == ("fr_wheel_joint", "rr_wheel_joint")
    assert chosen.turning_resistance == 1.4


@pytest.mark.parametrize(
    ("kind", "limit", "angle"),
    [("revolute", LIMIT, 0.6), ("continuous", "", 0.5), ("fixed", "", 0.5)],
)
def test_steered_wheels_before_others_are_ackermann(kind: str, limit: str, angle: float) -> None:
    chosen = choose(steered(kind, limit), REAR)
    assert isinstance(chosen, AckermannDescription)
    assert chosen.steering_joints == ("left_steering_hinge_joint", "right_steering_hinge_joint")
    assert chosen.front_wheel_joints == ("front_left_wheel_joint", "front_right_wheel_joint")
    assert chosen.rear_wheel_joints == ("rl_wheel_joint", "rr_wheel_joint")
    assert chosen.steering_limit_rad == angle


@pytest.mark.parametrize("lean", [0.0, 0.1, 0.35])
def test_a_car_whose_steering_axes_lean_is_no_skid_steer(lean: float) -> None:
    """Those of the AutoRally lean by 6 deg, tangent 0.1, and this one's by up to 19 deg."""
    leaning = steered("revolute", LIMIT).replace(Z, f'<axis xyz="0 {lean} 1"/>')
    assert leaning.count(f'"0 {lean} 1"') == 2
    assert isinstance(choose(leaning, REAR), AckermannDescription)


def test_fixed_wheels_are_found_by_their_name_and_shape() -> None:
    fixed = "".join(
        wheel(name, xyz, kind="fixed") for name, xyz in (("l", "0 0.1 0.05"), ("r", "0 -0.1 0.05"))
    )
    assert choose(fixed).wheel_joints == ("l_wheel_joint", "r_wheel_joint")


def test_swivel_casters_and_rockers_are_no_wheels() -> None:
    swivel = link("caster_swivel", "") + joint("swivel", "caster_swivel", "-0.2 0 0.05", more=Z)
    swivel += wheel("caster", "0 0 0", parent="caster_swivel")
    assert isinstance(choose(PAIR, swivel), DifferentialDescription)
    box = '<collision><geometry><box size="0.4 0.02 0.04"/></geometry></collision>'
    rockers = ""
    for side, y in (("left", 0.1), ("right", -0.1)):
        rockers += link(f"{side}_rocker", box)
        rockers += joint(f"{side}_rocker_joint", f"{side}_rocker", f"0 {y} 0.05")
        for end, x in (("front", 0.2), ("rear", -0.2)):
            rockers += wheel(f"{side}_{end}", f"{x} 0 0", parent=f"{side}_rocker")
    chosen = choose(rockers)
    assert isinstance(chosen, SkidSteerDescription)
    assert "left_rocker_joint" not in chosen.wheel_joints


PLUGIN = """<gazebo><plugin filename="libgazebo_ros_diff_drive.so" name="diff_drive">
<left_joint>rl_wheel_joint</left_joint><right_joint>rr_wheel_joint</right_joint>
</plugin></gazebo>"""
TRANSMISSION = '<transmission name="t{0}"><joint name="{0}"/></transmission>'
CONTROL = """<ros2_control name="c" type="system"><joint name="rl_wheel_joint">
<command_interface name="velocity"/></joint><joint name="rr_wheel_joint">
<command_interface name="velocity"/></joint></ros2_control>"""


@pytest.mark.parametrize(
    "hint",
    [
        PLUGIN,
        TRANSMISSION.format("rl_wheel_joint") + TRANSMISSION.format("rr_wheel_joint"),
        CONTROL,
    ],
)
def test_plugins_and_actuators_say_which_wheels_are_driven(hint: str) -> None:
    chosen = choose(FRONT, REAR, hint)
    assert isinstance(chosen, DifferentialDescription)
    assert chosen.wheel_joints == ("rl_wheel_joint", "rr_wheel_joint")


def test_driven_wheels_in_the_air_are_told(caplog: pytest.LogCaptureFixture) -> None:
    """A suspension at zero may hold them there."""
    middle = wheel("ml", "0 0.1 0.2") + wheel("mr", "0 -0.1 0.2")
    names = [f"{name}_wheel_joint" for name in ("fl", "fr", "ml", "mr", "rl", "rr")]
    driven = "".join(map(TRANSMISSION.format, names))
    assert len(choose(FRONT, middle, REAR, driven).wheel_joints) == 4
    assert "leaves out these driven wheels: ml_wheel_joint, mr_wheel_joint" in caplog.text


def test_free_wheels_that_cannot_swivel_are_told_and_driven_as_proposed(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Gazebo lets such wheels drag in turns."""
    plugin = "<left_joint>rl_wheel_joint</left_joint><right_joint>rr_wheel_joint</right_joint>"
    driven = f'<gazebo><plugin filename="diff_drive" name="d">{plugin}</plugin></gazebo>'
    assert isinstance(choose(FRONT, REAR, driven), DifferentialDescription)
    note = "although they cannot swivel"
    (line,) = (message for message in caplog.messages if note in message)
    assert line.endswith(": fl_wheel_joint, fr_wheel_joint")
    kind = line.partition("robot.drive.kind=")[2].partition(" ")[0]
    sides = dict(re.findall(r"robot\.drive\.(\w+_joints)=\[([\w,]+)\]", line))
    named = {side: names.split(",") for side, names in sides.items()}
    assert len(choose(FRONT, REAR, driven, kind=kind, **named).wheel_joints) == 4
    caplog.clear()
    slippery = '<gazebo reference="{}_wheel"><mu1>0</mu1></gazebo>'
    choose(FRONT, REAR, driven, slippery.format("fl"), slippery.format("fr"))
    assert note not in caplog.text


def test_groups_of_joints_in_one_element_are_read() -> None:
    group = """<gazebo><plugin filename="skid_drive" name="d"><left_joints>fl_wheel_joint,
    rl_wheel_joint</left_joints><right_joints>fr_wheel_joint rr_wheel_joint</right_joints></plugin>
    </gazebo>"""
    chosen = choose(FRONT, REAR, PAIR, group)
    assert chosen.left_wheel_joints == ("fl_wheel_joint", "rl_wheel_joint")


def test_named_wheels_are_taken() -> None:
    named = {"left_wheel_joints": ["rl_wheel_joint"], "right_wheel_joints": ["rr_wheel_joint"]}
    chosen = choose(FRONT, REAR, **named)
    assert isinstance(chosen, DifferentialDescription)
    assert chosen.wheel_joints == ("rl_wheel_joint", "rr_wheel_joint")
    with pytest.raises(InputError, match="the same number of wheels"):
        choose(FRONT, REAR, left_wheel_joints=["rl_wheel_joint"])


def test_the_speed_follows_the_slowest_wheel_and_keys_come_first() -> None:
    limit = '<limit effort="1" velocity="6"/>'
    slow = wheel("l", "0 0.1 0.05", more=Y + limit) + wheel("r", "0 -0.1 0.05", more=Y + limit)
    assert choose(slow).max_speed_mps == pytest.approx(6 * RADIUS)
    assert choose(slow, max_speed_mps=0.7).max_speed_mps == 0.7
    fast = slow.replace('velocity="6"', 'velocity="99"')
    assert choose(fast).max_speed_mps == 1.0


@pytest.mark.parametrize(
    ("parts", "values"),
    [
        (wheel("left", "0 0.1 0.05"), {}),
        (PAIR, {"kind": "ackermann"}),
        (FRONT + REAR, {"kind": "differential"}),
        (steered("revolute", LIMIT), {}),
    ],
)
def test_what_is_not_plain_is_refused_with_the_candidates(
    parts: str, values: dict[str, Any]
) -> None:
    with pytest.raises(InputError) as caught:
        choose(parts, **values)
    message = str(caught.value)
    assert message.startswith("r.urdf: ")
    assert "'robot.drive.left_wheel_joints=[LEFT]'" in message
    assert "\n" not in message
    for name in ("left_wheel_joint", "fl_wheel_joint"):
        assert name not in parts or name in message


def test_a_description_without_wheels_is_named_as_such() -> None:
    with pytest.raises(InputError, match=r"no joint turns, and no round part .*; add links"):
        choose("")


class TestAutomatic(DriveSuite):
    part = AutomaticDescription()
    bad_values = ({"kind": "tracks"}, {"max_speed_mps": 0}, {"turning_resistance": 0.9})

    @cached_property
    def urdf(self) -> Urdf:
        return read_tree(expansion.read("two_wheeler/two_wheeler.xacro")[1], "robot.urdf")
