"""Absent packages of a robot's description: one message, keys ready to type, or left out."""

import logging
import re
import shlex
import subprocess
from pathlib import Path

import pytest
from fixture_types import Log, Patch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml.etree import _Element as Element
from xacro_cases import XACRO, write

from evoros.base.errors import InputError
from evoros.files.resources import bundled_folder
from evoros.formats.urdf.expansion import read
from evoros.formats.urdf.packages import index_packages
from evoros.formats.urdf.xacro_expansion import ReadOptions

BASE = '<link name="base"/>'
INCLUDE = '\n<xacro:include filename="$(find {0})/{0}.xacro"/>'
MESH = '<link name="{0}"><collision><geometry><mesh filename="{1}"/></geometry></collision></link>'


def expand(name: str, **options: object) -> Element:
    return read(name, ReadOptions(**options))[1]  # type: ignore[arg-type]


def refused(name: str, **options: object) -> str:
    with pytest.raises(InputError) as caught:
        expand(name, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


packages = st.lists(st.sampled_from(["arm", "box2", "zoo2", "ur_5"]), min_size=1, unique=True)


@pytest.mark.slow
@settings(
    deadline=None, max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(packages, packages)
def test_the_proposed_keys_are_those_that_help(
    tmp_path: Path, absent: list[str], called: list[str]
) -> None:
    calls = "".join(f"<xacro:{name}_mount/>" for name in called if name in absent)
    name = write(tmp_path, BASE + "".join(map(INCLUDE.format, absent)) + calls)
    if not calls:
        assert [child.get("name") for child in expand(name)] == ["base"]
        return
    message = refused(name)
    lines = range(2, 2 + len(absent))
    assert all(f"{name}:{n}:" in message or f"(line {n})" in message for n in lines)
    typed = re.search(r"'robot\.ignored_packages=\[([^\]]*)\]'", message)
    assert typed is not None
    assert typed[1].split(",") == absent
    assert [c.get("name") for c in expand(name, ignored_packages=typed[1].split(","))] == ["base"]


def test_what_nothing_calls_is_left_out_and_told(tmp_path: Path, caplog: Log) -> None:
    name = write(tmp_path, BASE + INCLUDE.format("lms1xx") + INCLUDE.format("zed2"))
    with caplog.at_level(logging.WARNING):
        expand(name)
    (message,) = caplog.messages
    assert "missing items that only accessories need are left out: lms1xx, zed2" in message


@pytest.mark.parametrize(
    "rest",
    [
        '<joint name="j" type="fixed"><parent link="arm_base"/><child link="base"/></joint>',
        '<link name="$(find arm)"/>',
        '<link name="x"><collision><geometry><mesh filename="$(find arm)/x.stl"/></geometry>'
        "</collision></link>",
    ],
)
def test_what_needs_an_absent_package_names_it(tmp_path: Path, rest: str) -> None:
    message = refused(write(tmp_path, BASE + INCLUDE.format("arm") + rest))
    assert "r.xacro:2: names the package arm, which is missing" in message
    assert "robot.ignored_packages=[arm]" in message


@pytest.mark.parametrize("ignored", [(), ("arm",)])
def test_a_name_that_an_absent_package_may_define_asks_for_the_package_alone(
    tmp_path: Path, ignored: tuple[str, ...]
) -> None:
    """Without the package the file cannot be expanded, so ignoring it does not help."""
    name = write(tmp_path, BASE + INCLUDE.format("arm") + '\n<link name="${arm_size}"/>')
    message = refused(name, ignored_packages=ignored)
    assert f"{name}:3: xacro cannot expand the file: name 'arm_size' is not defined" in message
    assert (
        "; provide arm (left out, but may define the name) with robot.packages, or edit" in message
    )


def test_a_renamed_file_is_named_and_the_proposed_command_mends_it(tmp_path: Path) -> None:
    (tmp_path / "deg to_rad.xacro").write_text(XACRO.format('<xacro:property name="d" value="2"/>'))
    include = '<xacro:include filename="deg to_rad.urdf.xacro"/>'
    name = write(tmp_path, BASE + "\n" + include + '<link name="${d}"/>')
    message = refused(name)
    assert f"{name}:2 includes deg to_rad.urdf.xacro, which does not exist" in message
    command = message.partition("only renamed, type ")[2].partition(" (")[0]
    subprocess.run(shlex.split(command), check=True)
    assert expand(name)[1].get("name") == "2"


def test_an_argument_without_a_value_is_told_before_absent_packages(tmp_path: Path) -> None:
    name = write(tmp_path, BASE + INCLUDE.format("arm") + '<link name="$(arg side)"/>')
    assert "add ++robot.arguments.side=" in refused(name)


MOUNTED = """
<link name="x"><visual><geometry><mesh filename="{0}/x.stl"/></geometry></visual></link>
<joint name="j" type="fixed"><parent link="base"/><child link="x"/></joint>"""


@pytest.mark.parametrize(
    "rest",
    [
        MOUNTED.format("file://$(find arm)"),
        "<gazebo><plugin><parameters>$(find arm)/control.yaml</parameters></plugin></gazebo>",
        '<ros2_control name="c" type="system"><hardware><p>$(find arm)/c.yaml</p></hardware>'
        "</ros2_control>",
    ],
)
def test_what_decorations_alone_need_is_left_out_and_told(
    tmp_path: Path, rest: str, caplog: Log
) -> None:
    with caplog.at_level(logging.WARNING):
        root = expand(write(tmp_path, BASE + rest))
    assert root[0].get("name") == "base"
    (message,) = caplog.messages
    assert "only accessories need are left out: arm" in message
    assert [mesh.get("filename") for mesh in root.iter("mesh")] in ([], ["package://arm/x.stl"])


def test_sensors_of_absent_packages_are_left_out_and_named(tmp_path: Path, caplog: Log) -> None:
    """Designs have sensors of their own. A joint that hangs on one still asks for a key."""
    called = BASE + INCLUDE.format("lms1xx") + "<xacro:sick/>"
    with caplog.at_level(logging.WARNING):
        assert [link.get("name") for link in expand(write(tmp_path, called))] == ["base"]
    assert "only accessories need are left out: lms1xx, <xacro:sick>" in caplog.text
    macros = BASE + INCLUDE.format("parts") + "<xacro:front.rplidar_a2/><xacro:imu_9/>"
    assert [link.get("name") for link in expand(write(tmp_path, macros))] == ["base"]
    assert "[parts]" in refused(write(tmp_path, macros + "<xacro:simulated_arm/>"))
    hanging = '<joint name="j" type="fixed"><parent link="laser"/><child link="base"/></joint>'
    assert "'robot.ignored_packages=[lms1xx]'" in refused(write(tmp_path, called + hanging))


def test_what_hangs_on_an_ignored_package_is_left_out_and_told(tmp_path: Path, caplog: Log) -> None:
    """The joint to the arm, and the gripper that the arm carries with the finger on it."""
    joint = '<joint name="{0}_{1}" type="fixed"><parent link="{0}"/><child link="{1}"/></joint>'
    ends = [("base", "wheel"), ("base", "arm_base"), ("arm_tool", "grip"), ("grip", "finger")]
    links = "".join(f'<link name="{name}"/>' for name in ("wheel", "grip", "finger"))
    body = BASE + INCLUDE.format("arm") + "<xacro:arm/>" + links
    name = write(tmp_path, body + "".join(joint.format(*pair) for pair in ends))
    typed = re.search(r"'robot\.ignored_packages=\[([^\]]*)\]'", refused(name))
    assert typed is not None
    with caplog.at_level(logging.WARNING):
        root = expand(name, ignored_packages=typed[1].split(","))
    assert [part.get("name") for part in root] == ["base", "wheel", "base_wheel"]
    for part in ("base_arm_base", "arm_tool_grip", "grip", "finger"):
        assert part in caplog.text


def test_a_description_without_a_link_names_what_it_lacks(tmp_path: Path) -> None:
    assert "the package base" in refused(write(tmp_path, INCLUDE.format("base")))


def test_packages_files_and_meshes_are_in_one_list(tmp_path: Path) -> None:
    (tmp_path / "package.xml").write_text("<package><name>bot</name></package>")
    body = (
        BASE
        + INCLUDE.format("arm")
        + '\n<xacro:include filename="$(find bot)/urdf/gone.xacro"/><xacro:arm/>'
        + MESH.format("a", "package://bot/gone.dae")
        + MESH.format("b", "package://nobody/b.dae")
        + MESH.format("c", "package://nobody/b.dae")
        + MESH.format("d", "package://bot/there.stl")
    )
    (tmp_path / "there.stl").write_text("solid")
    name = write(tmp_path, body, "urdf/r.xacro")
    message = refused(name)
    assert message.startswith(f"{name}: refers to 4 missing items: ")
    for part in (
        "package arm (line 2)",
        "gone.xacro (line 3)",
        "package://bot/gone.dae (link a)",
        "package://nobody/b.dae (link b, 2 times)",
        "add the folder that holds arm, nobody to robot.packages",
        f"add the missing mesh to the folder {tmp_path}",
        "'robot.ignored_packages=[arm]'",
        "robot.missing=leave_out",
    ):
        assert part in message
    assert "there.stl" not in message


@pytest.mark.parametrize("missing", ["leave_out", "box"])
def test_a_mesh_may_be_missing_if_the_key_says_so(tmp_path: Path, missing: str) -> None:
    name = write(tmp_path, MESH.format("a", "package://nobody/b.dae"))
    assert "missing=leave_out" in refused(name)
    assert expand(name, missing=missing).find("link/collision") is not None


def test_install_rules_are_followed(tmp_path: Path) -> None:
    (tmp_path / "package.xml").write_text("<package><name>bot</name></package>")
    (tmp_path / "CMakeLists.txt").write_text(
        "project(bot)\ninstall(DIRECTORY description/urdf description/meshes description/config\n"
        "  DESTINATION share/${PROJECT_NAME})\n"
    )
    write(tmp_path, '<xacro:macro name="wheel"><link name="w"/></xacro:macro>',
          "description/urdf/wheel.xacro")  # fmt: skip
    mesh = tmp_path / "description" / "meshes" / "w.stl"
    mesh.parent.mkdir()
    mesh.write_text("solid")
    (tmp_path / "description" / "config").mkdir()
    (tmp_path / "description" / "config" / "c.yaml").write_text("a: 7")
    body = (
        '<xacro:include filename="$(find bot)/urdf/wheel.xacro"/><xacro:wheel/>'
        "<link name=\"l${xacro.load_yaml('$(find bot)/config/c.yaml')['a']}\"/>"
        + MESH.format("m", "package://bot/meshes/w.stl")
        + MESH.format("n", "file://$(find bot)/meshes/w.stl")
    )
    root = expand(write(tmp_path, body, "description/urdf/bot.urdf.xacro"))
    assert [link.get("name") for link in root] == ["w", "l7", "m", "n"]
    assert {mesh.get("filename") for mesh in root.iter("mesh")} == {f"file://{mesh}"}


def test_a_folder_above_serves_as_a_package_without_package_xml(tmp_path: Path) -> None:
    write(tmp_path, '<link name="arm"/>', "parts/arm.xacro")
    include = '<xacro:include filename="$(find unstated)/parts/arm.xacro"/>'
    name = write(tmp_path, BASE + include, "robots/bot.urdf.xacro")
    assert [link.get("name") for link in expand(name)] == ["base", "arm"]


def test_letter_case_of_a_name_does_not_matter_and_is_told(tmp_path: Path, caplog: Log) -> None:
    write(tmp_path, '<link name="w"/>', "Wheel.xacro")
    (tmp_path / "w.STL").write_text("solid")
    body = '<xacro:include filename="wheel.xacro"/>' + MESH.format("m", "w.stl")
    with caplog.at_level(logging.WARNING):
        root = expand(write(tmp_path, body))
    assert [link.get("name") for link in root] == ["w", "m"]
    assert str(tmp_path / "Wheel.xacro") in caplog.text
    assert str(tmp_path / "w.STL") in caplog.text


def test_a_loaded_file_that_is_absent_is_named(tmp_path: Path) -> None:
    message = refused(write(tmp_path, "${xacro.load_yaml('sizes.yaml')}" + BASE))
    assert "sizes.yaml does not exist" in message
    assert "Errno" not in message


def test_an_included_file_that_is_absent_is_named_without_keys_that_do_not_help(
    tmp_path: Path,
) -> None:
    message = refused(write(tmp_path, f'{BASE}\n<xacro:include filename="gone.xacro"/><xacro:x/>'))
    assert message.endswith("r.xacro:2: includes gone.xacro, which does not exist; "
                            "correct the name gone.xacro")  # fmt: skip


def test_a_package_of_ones_own_comes_before_a_bundled_one_of_its_name(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    package = tmp_path / "ros" / "evoros_parts"
    package.mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>evoros_parts</name></package>")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    (tmp_path / "robots").mkdir()
    file = tmp_path / "robots" / "cart.urdf"
    file.write_text("<robot/>")
    assert index_packages(file, ()).find("evoros_parts") == package
    assert index_packages(file, ()).find("mule") == bundled_folder("robots") / "mule"
    assert index_packages(file, ()).find("absent") is None
