"""Faulty descriptions of robots: each is one clear line."""

from pathlib import Path

import pytest
from lxml import etree
from robot_cases import WHEEL, Edit, append, find, load, rover

from evoros.base.errors import InputError


def drop(path: str) -> Edit:
    def edit(root: etree._Element) -> None:
        element = find(root, path)
        parent = element.getparent()
        assert parent is not None
        parent.remove(element)

    return edit


def put(path: str, **attributes: str) -> Edit:
    return lambda root: find(root, path).attrib.update(attributes)


WHEEL_JOINT = "joint[@name='rear_left_wheel_joint']"


STEERING = "joint[@name='front_left_steering_joint']"


FAULTS: dict[str, tuple[Edit, str]] = {
    "negative mass": (put(f"{WHEEL}/inertial/mass", value="-1"), "greater than 0"),
    "mass not finite": (put(f"{WHEEL}/inertial/mass", value="nan"), "finite"),
    "mass in words": (put(f"{WHEEL}/inertial/mass", value="much"), "'much'"),
    "two numbers": (put(f"{WHEEL_JOINT}/origin", xyz="0 1"), "3 finite numbers"),
    "no such child": (put(f"{WHEEL_JOINT}/child", link="nothing"), "'nothing'"),
    "no such parent": (put(f"{WHEEL_JOINT}/parent", link="nothing"), "'nothing'"),
    "no parent": (drop(f"{WHEEL_JOINT}/parent"), "parent"),
    "unknown type": (put(WHEEL_JOINT, type="rubber"), "rubber"),
    "fixed wheel": (put(WHEEL_JOINT, type="fixed"), "continuous or revolute, not fixed"),
    "missing wheel joint": (put(WHEEL_JOINT, name="other"), "rear_left_wheel_joint"),
    "missing steering joint": (put(STEERING, name="other"), "front_left_steering_joint"),
    "no name": (put(WHEEL_JOINT, name=""), "name"),
    "same link twice": (append('<link name="base_link"/>'), "base_link"),
    "same joint twice": (put(STEERING, name="rear_left_wheel_joint"), "rear_left_wheel_joint"),
    "two roots": (drop(WHEEL_JOINT), "rear_left_wheel"),
    "circle": (put(f"{WHEEL_JOINT}/parent", link="rear_left_wheel"), "cycle"),
    "two parents": (
        put(f"{STEERING}/child", link="rear_left_wheel"),
        "more than one parent joint of",
    ),
    "wheel of a mesh": (append("<mesh/>", f"{WHEEL}/collision/geometry"), "mesh"),
    "other radius": (put(f"{WHEEL}/collision/geometry/sphere", radius="0.04"), "ground"),
    "in the air": (put(f"{WHEEL_JOINT}/origin", xyz="-0.15 0.1345 0.08"), "ground"),
    "not opposite": (put(f"{WHEEL_JOINT}/origin", xyz="-0.17 0.1345 0.0635"), "opposite"),
    "on the right": (put(f"{WHEEL_JOINT}/origin", xyz="-0.15 -0.2 0.0635"), "left of"),
    "axis 0": (put(f"{WHEEL_JOINT}/axis", xyz="0 0 0"), "length 0"),
    "narrow steering": (put(f"{STEERING}/limit", lower="-0.5"), "at most 0.5"),
    "another document": (lambda root: setattr(root, "tag", "sdf"), "<robot>"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_robot_is_one_clear_line(tmp_path: Path, fault: str) -> None:
    edit, says = FAULTS[fault]
    root = etree.fromstring(rover().base_urdf.text.encode())
    edit(root)
    path = tmp_path / "faulty.urdf"
    path.write_bytes(etree.tostring(root))
    with pytest.raises(InputError) as caught:
        load(description=str(path), arguments={})
    message = str(caught.value)
    assert says in message
    assert "\n" not in message
    assert ";" in message
    assert str(path) in message or "steering_limit_rad" in message


def test_exchanged_limits_of_steering_are_switched_as_in_gazebo_and_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    root = etree.fromstring(rover().base_urdf.text.encode())
    limit = find(root, f"{STEERING}/limit")
    lower, upper = limit.get("lower", ""), limit.get("upper", "")
    put(f"{STEERING}/limit", lower=upper, upper=lower)(root)
    path = tmp_path / "exchanged.urdf"
    path.write_bytes(etree.tostring(root))
    robot = load(description=str(path), arguments={})
    assert robot.drive == rover().drive
    loaded = find(robot.urdf_elements(), f"{STEERING}/limit")
    assert (float(loaded.get("lower", "")), float(loaded.get("upper", ""))) == (
        float(lower),
        float(upper),
    )
    assert any(
        "limits of steering joints are put in order: front_left" in message
        for message in caplog.messages
    )
