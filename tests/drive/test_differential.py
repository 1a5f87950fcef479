"""Differential drive, against the motion of a rigid body."""

import copy
import dataclasses
import math
from collections.abc import Callable
from functools import cache, cached_property
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from evoros.base.errors import InputError
from evoros.drive.differential import Differential, DifferentialDescription
from evoros.formats.urdf import expansion
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.testing import DriveSuite


def drive(
    wheelbase: float = 0.3, track: float = 0.29, limit: float = 0.9, fastest: float = 0.45
) -> Differential:
    return Differential(
        wheel_joints=("l", "r"),
        caster_links=("c",),
        wheelbase_m=wheelbase,
        track_m=track,
        wheel_radii_m=(0.06,),
        rear_axle_x_m=-0.1,
        steering_limit_rad=limit,
        max_speed_mps=fastest,
    )


length = st.floats(0.1, 2.0)
drives = st.builds(drive, length, length, st.floats(0.05, 1.5), st.floats(0.1, 2.0))
speeds = st.floats(-3.0, 3.0)
fractions = st.floats(-1.0, 1.0)


@given(drives, speeds, fractions)
def test_both_wheels_roll_as_one_rigid_body(
    robot: Differential, speed: float, fraction: float
) -> None:
    """The bicycle model, its speed clipped as ``speed_limit_offset_m`` tells every simulator."""
    steering = fraction * robot.steering_limit
    curvature = math.tan(steering) / robot.wheelbase_m
    fastest = robot.max_speed_mps / (1.0 + abs(curvature) * robot.speed_limit_offset_m)
    rolled = min(max(speed, -fastest), fastest)
    angles, rates = robot.targets(speed, steering)
    assert angles == ()
    assert robot.steering_joints == ()
    for side, rate in zip((1, -1), rates, strict=True):
        at_wheel = rolled - rolled * curvature * side * 0.5 * robot.track_m
        assert rate * robot.wheel_radii_m[0] == pytest.approx(at_wheel, abs=1e-12)


@given(drives, st.floats(-1e6, 1e6), st.floats(-9.0, 9.0))
def test_no_wheel_passes_its_limit_and_the_curve_is_kept(
    robot: Differential, speed: float, steering: float
) -> None:
    lock = robot.steering_limit
    curvature = math.tan(min(max(steering, -lock), lock)) / robot.wheelbase_m
    left, right = (rate * robot.wheel_radii_m[0] for rate in robot.targets(speed, steering)[1])
    outer = max(abs(left), abs(right))
    assert outer <= robot.max_speed_mps * (1.0 + 1e-12)
    if abs(speed) >= robot.max_speed_mps:
        assert outer == pytest.approx(robot.max_speed_mps, rel=1e-12)
    turned = (right - left) / robot.track_m
    assert turned == pytest.approx(0.5 * (left + right) * curvature, rel=1e-9, abs=1e-12)


@given(drives, speeds, fractions)
def test_left_and_right_are_mirror_images(
    robot: Differential, speed: float, fraction: float
) -> None:
    _, (left, right) = robot.targets(speed, fraction * robot.steering_limit)
    assert robot.targets(speed, -fraction * robot.steering_limit) == ((), (right, left))


@given(drives, speeds)
def test_straight_ahead_is_exact(robot: Differential, speed: float) -> None:
    rolled = min(max(speed, -robot.max_speed_mps), robot.max_speed_mps)
    assert robot.targets(speed, 0.0)[1] == (rolled / robot.wheel_radii_m[0],) * 2


def test_where_the_centre_of_rotation_is_under_a_wheel_it_stands() -> None:
    pivot = math.atan(0.3 / 0.145)
    _, (left, right) = drive(limit=1.2).targets(0.1, pivot)
    assert left == pytest.approx(0.0, abs=1e-12)
    assert right == pytest.approx(0.2 / 0.06)


# Descriptions.

GOOD = {
    "wheel_joints": ["left_wheel_joint", "right_wheel_joint"],
    "caster_links": ["caster"],
    "wheelbase_m": 0.3,
    "steering_limit_rad": 0.9,
    "max_speed_mps": 0.45,
}


def described(**values: Any) -> DifferentialDescription:
    return DifferentialDescription(**{**GOOD, **values})


def test_a_gene_out_of_range_is_named() -> None:
    with pytest.raises(InputError, match="max_speed_mps"):
        dataclasses.replace(drive(), max_speed_mps=0.0)


Edit = Callable[[etree._Element], object]


@cache
def expanded() -> etree._Element:
    _, root = expansion.read("two_wheeler/two_wheeler.xacro")
    return root


def edited(edit: Edit) -> Urdf:
    root = copy.deepcopy(expanded())
    edit(root)
    return read_tree(root, "robot.urdf")


def put(path: str, **attributes: str) -> Edit:
    def edit(root: etree._Element) -> None:
        (element,) = root.findall(path)
        element.attrib.update(attributes)

    return edit


class TestDifferential(DriveSuite):
    part = described()
    bad_values = (
        {"wheel_joints": ["a"]}, {"wheel_joints": ["a", "a"]}, {"wheel_joints": "ab"},
        {"caster_links": None}, {"caster_links": "caster"}, {"caster_links": [""]},
        {"caster_links": ["a", "a"]}, {"wheelbase_m": 0}, {"steering_limit_rad": 1.6},
        {"steering_limit_rad": math.nan}, {"max_speed_mps": -1}, {"max_speed_mps": "fast"},
    )  # fmt: skip

    @cached_property
    def urdf(self) -> Urdf:
        return read_tree(expanded(), "robot.urdf")


def without_caster_shape(root: etree._Element) -> None:
    (link,) = root.findall("link[@name='caster']")
    for collision in link.findall("collision"):
        link.remove(collision)


@settings(deadline=None)  # a busy machine is no failure
@given(st.floats(-0.2, 0.1), st.floats(0.1, 0.5), st.floats(0.03, 0.1))
def test_track_axle_and_radius_are_those_of_the_robot(x: float, track: float, r: float) -> None:
    def edit(root: etree._Element) -> None:
        for name, side in (("left", 1), ("right", -1)):
            put(f"joint[@name='{name}_wheel_joint']/origin", xyz=f"{x} {side * track / 2} {r}")(
                root
            )
            put(f"link[@name='{name}_wheel']/collision/geometry/sphere", radius=f"{r}")(root)

    fitted = described().fit(edited(edit))
    assert fitted.rear_axle_x_m == pytest.approx(x, abs=1e-12)
    assert fitted.track_m == pytest.approx(track, abs=1e-12)
    assert fitted.speed_limit_offset_m == pytest.approx(track / 2, abs=1e-12)
    assert fitted.wheel_radii_m[0] == pytest.approx(r, abs=1e-12)


LEFT = "joint[@name='left_wheel_joint']"
CASTER = "joint[@name='caster_joint']"
FAULTS: dict[str, tuple[dict[str, Any], Edit, str]] = {
    "no such wheel": ({"wheel_joints": ["a", "right_wheel_joint"]}, list, "there is no joint 'a'"),
    "swapped": ({"wheel_joints": ["right_wheel_joint", "left_wheel_joint"]}, list, "left of"),
    "fixed wheel": ({"wheel_joints": ["left_wheel_joint", "caster_joint"]}, list, "continuous"),
    "backwards": ({}, put(f"{LEFT}/axis", xyz="0 -1 0"), "must point left"),
    "no motor": ({}, put(f"{LEFT}/limit", effort="0"), "an effort limit above 0"),
    "not opposite": ({}, put(f"{LEFT}/origin", xyz="-0.1 0.2 0.06"), "opposite each other"),
    "off the ground": ({}, put(f"{LEFT}/origin", xyz="-0.1 0.145 0.08"), "touch the ground"),
    "no such caster": ({"caster_links": ["ball"]}, list, "name one of: base_link, caster"),
    "a wheel": ({"caster_links": ["left_wheel"]}, list, "'left_wheel' must not be a driven wheel"),
    "the chassis": ({"caster_links": ["base_link"]}, list, "a separate link"),
    "shapeless caster": ({}, without_caster_shape, "with a collision shape"),
    "caster in the air": (
        {},
        put(f"{CASTER}/origin", xyz="0.18 0 0.05"),
        "lowest point is at 0.02",
    ),
    "caster in the ground": (
        {},
        put(f"{CASTER}/origin", xyz="0.18 0 0"),
        "lowest point is at -0.03",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_robot_that_does_not_fit_is_one_clear_line(fault: str) -> None:
    values, edit, says = FAULTS[fault]
    with pytest.raises(InputError) as caught:
        described(**values).fit(edited(edit))
    message = str(caught.value)
    assert says in message
    assert message.startswith("robot.urdf: ")
    assert "; " in message
    assert "\n" not in message


def test_wheels_of_two_sizes_are_refused() -> None:
    def edit(root: etree._Element) -> None:
        put(f"{LEFT}/origin", xyz="-0.1 0.145 0.07")(root)
        put("link[@name='left_wheel']/collision/geometry/sphere", radius="0.07")(root)

    with pytest.raises(InputError, match=r"equal radii, not 0\.07 and 0\.06 m"):
        described().fit(edited(edit))
