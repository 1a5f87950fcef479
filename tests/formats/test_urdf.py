"""Robot descriptions are expanded; each faulty file gives one line with the file and the fault."""

import os
import time
from pathlib import Path

import pytest
from executor_calls import alive, wait_until
from fixture_types import Log, Patch
from lxml import etree
from xacro_cases import XACRO, write

from evoros.base.errors import InputError
from evoros.formats.strict_xml import parse
from evoros.formats.urdf import expansion as description
from evoros.formats.urdf import xacro_child
from evoros.formats.urdf.parts import read_origin
from evoros.formats.urdf.solids import SolidsReader
from evoros.formats.urdf.tree import read_tree
from evoros.formats.urdf.xacro_expansion import ReadOptions

DEFAULT = "erle_rover/erle_rover.xacro"


def refused(name: str, *, limit: float = 5.0, where: str = "") -> str:
    with pytest.raises(InputError) as caught:
        description.read(name, ReadOptions(time_limit_s=limit))
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(where or name)
    assert ";" in message  # the cure
    return message


def text(name: str, packages: tuple[str, ...] = (), **arguments: object) -> str:
    return etree.tostring(
        description.read(name, ReadOptions(arguments, packages))[1], encoding="unicode"
    )


def test_expansion_is_deterministic_and_free_of_paths() -> None:
    first = text(DEFAULT)
    assert text(DEFAULT) == first
    assert str(Path.cwd()) not in first
    assert "xacro" not in first


def test_arguments_reach_the_file(tmp_path: Path) -> None:
    name = write(tmp_path, '<xacro:arg name="n" default="2"/><link name="l${$(arg n) * 2}"/>')
    assert 'name="l4"' in text(name)
    assert 'name="l14"' in text(name, n=7)
    flag = write(tmp_path, '<xacro:arg name="n" default="x"/><link name="$(arg n)"/>')
    assert 'name="true"' in text(flag, n=True)


def test_an_unknown_argument_names_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"radius.*the arguments are .*wheel_radius"):
        description.read(DEFAULT, ReadOptions({"radius": 1.0}))


def test_an_argument_must_be_a_plain_value() -> None:
    with pytest.raises(InputError, match="wheel_radius"):
        description.read(DEFAULT, ReadOptions({"wheel_radius": [1]}))


def test_a_plain_urdf_takes_no_arguments(tmp_path: Path) -> None:
    path = tmp_path / "r.urdf"
    path.write_text('<robot name="r"/>')
    with pytest.raises(InputError, match="unknown argument a"):
        description.read(str(path), ReadOptions({"a": 1}))


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ("<link>", "mismatch"),
        ("${1 / 0}", "division by zero"),
        ("${unknown}", "unknown"),
        ("<xacro:nothing/>", "nothing"),
        ("$(arg missing)", "missing"),
        ("$(find elsewhere)", "elsewhere"),
        ("$(env HOME)", "HOME"),
        ('<xacro:include filename="no.xacro"/>', "no.xacro"),
        ('<xacro:include filename="r.xacro"/>', "endlessly"),
        ('<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>', "endlessly"),
        ("${'a' * 2000000000}", ""),
        ("${'a' * 20000000}", "16 MiB"),
        ('<mesh filename="file:///etc/passwd"/>', "passwd"),
        ('<mesh filename="https://example.org/x.stl"/>', "local"),
        ("<mesh/>", "filename"),
    ],
)
def test_a_faulty_xacro_is_one_clear_line(tmp_path: Path, body: str, says: str) -> None:
    assert says in refused(write(tmp_path, body))


def test_an_endless_expression_is_stopped(tmp_path: Path) -> None:
    assert "within 1 s" in refused(write(tmp_path, "${9**9**9}"), limit=1.0)


def test_a_waiting_file_is_stopped(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.xacro")
    name = write(tmp_path, '<xacro:include filename="pipe.xacro"/>')
    assert "within 0.3 s" in refused(name, limit=0.3)


@pytest.mark.parametrize("end", ["", "; time.sleep(600)"])
def test_what_the_expansion_has_started_ends_with_it(
    tmp_path: Path, monkeypatch: Patch, end: str
) -> None:
    """A process that holds the pipes open must neither hold up the run nor stay behind."""
    process = tmp_path / "process"
    code = "import subprocess, time; p = subprocess.Popen(['sleep', '600'])"
    program = f"{code}; open({str(process)!r}, 'w').write(str(p.pid)){end}"
    (tmp_path / "child.py").write_text(program)
    monkeypatch.setattr(xacro_child, "__file__", str(tmp_path / "child.py"))
    since = time.monotonic()
    assert "within 1 s" in refused(write(tmp_path, ""), limit=1.0)
    assert time.monotonic() - since < 200
    assert wait_until(lambda: not alive(int(process.read_text())))


def test_a_doctype_is_refused_wherever_it_is(tmp_path: Path) -> None:
    doctype = '<!DOCTYPE robot [<!ENTITY e SYSTEM "file:///etc/hostname">]>'
    (tmp_path / "part.xacro").write_text(doctype + '<robot name="r">&e;</robot>')
    for name in ("plain.urdf", "r.xacro"):
        (tmp_path / name).write_text(doctype + XACRO.format(""))
        assert "DOCTYPE" in refused(str(tmp_path / name))
    part = str(tmp_path / "part.xacro")
    include = write(tmp_path, '<xacro:include filename="part.xacro"/>')
    assert "DOCTYPE" in refused(include, where=part)


def test_a_fault_in_an_included_file_gives_its_line(tmp_path: Path) -> None:
    (tmp_path / "part.xacro").write_text("<robot>\n<link>\n</robot>")
    include = write(tmp_path, '<xacro:include filename="part.xacro"/>')
    refused(include, where=f"{tmp_path / 'part.xacro'}:3:")


def test_a_fault_in_the_file_gives_its_line(tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text('<robot name="r">\n<link>\n</robot>')
    refused(str(tmp_path / "r.urdf"), where=f"{tmp_path / 'r.urdf'}:3:")


def test_a_missing_or_unreadable_file_is_named(tmp_path: Path) -> None:
    refused("no_such_robot.xacro")
    refused(str(tmp_path))
    (tmp_path / "binary.urdf").write_bytes(bytes(range(256)))
    refused(str(tmp_path / "binary.urdf"))
    (tmp_path / "empty.urdf").write_bytes(b"")
    refused(str(tmp_path / "empty.urdf"))


def test_the_environment_does_not_reach_the_file(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setenv("EVOROS_SECRET", "secret")
    name = write(tmp_path, '<link name="a$(optenv EVOROS_SECRET nothing)"/>')
    assert 'name="anothing"' in text(name)


def test_what_the_file_says_and_what_lies_beside_it_do_no_harm(tmp_path: Path, caplog: Log) -> None:
    (tmp_path / "json.py").write_text("raise SystemExit(3)")  # must not be imported
    (tmp_path / "xacro.py").write_text("raise SystemExit(3)")
    name = write(tmp_path, "${xacro.message('hello')}${xacro.warning('mind')}<link name='a'/>")
    assert 'name="a"' in text(name)
    assert "hello" in caplog.text
    assert "mind" in caplog.text


@pytest.mark.slow
def test_packages_are_found_by_name(tmp_path: Path) -> None:
    mesh = tmp_path / "parts" / "wheels" / "w.stl"
    mesh.parent.mkdir(parents=True)
    mesh.write_text("solid w\nendsolid")
    body = '<mesh filename="{}"/><link name="$(find wheels)"/>'
    for where in ("package://wheels/w.stl", "model://wheels/w.stl", f"file://{mesh}"):
        name = write(tmp_path / "robot", body.format(where))
        for root in (tmp_path / "parts", tmp_path / "parts" / "wheels"):
            expanded = text(name, (str(root),))
            assert f'filename="file://{mesh}"' in expanded
            assert f'name="{mesh.parent}"' in expanded
        refused(name)


def test_the_package_around_the_file_is_found(tmp_path: Path) -> None:
    package = tmp_path / "my_robot"
    name = write(package / "urdf", '<mesh filename="package://my_robot/m/x.stl"/>')
    assert "package://my_robot/m/x.stl" in text(name)
    (package / "package.xml").write_text("<package/>")
    (package / "m").mkdir()
    (package / "m" / "x.stl").write_text("solid")
    assert str(package / "m" / "x.stl") in text(name)


def test_a_link_out_of_the_package_is_refused(tmp_path: Path) -> None:
    secret = tmp_path / "secret.stl"
    secret.write_text("solid")
    name = write(tmp_path / "robot", '<mesh filename="x.stl"/>')
    (tmp_path / "robot" / "x.stl").symlink_to(secret)
    assert "x.stl" in refused(name)


@pytest.mark.parametrize(
    "body", ['<xacro:include filename="{}"/>', "${{xacro.load_yaml('{}')}}", "${{load_yaml('{}')}}"]
)
def test_only_declared_folders_are_included(tmp_path: Path, body: str) -> None:
    other = tmp_path / "other"
    other.mkdir()
    for inside in (other / "part.xacro", tmp_path / "robot" / "part.xacro"):
        name = write(tmp_path / "robot", body.format(inside))
        inside.write_text('<robot name="r"/>' if "include" in body else "a: 1")
        if inside.parent == other:
            assert "part.xacro must lie inside" in refused(name)
        assert text(name, (str(other),))
    inside.unlink()
    inside.symlink_to(other / "part.xacro")
    assert "part.xacro must lie inside" in refused(name)


def test_the_bundled_robots_can_be_included(tmp_path: Path) -> None:
    include = '<xacro:include filename="$(find erle_rover)/erle_rover.xacro"/>'
    assert "rear_left_wheel" in text(write(tmp_path, include))


def test_a_missing_package_folder_is_named(tmp_path: Path) -> None:
    name = write(tmp_path, "")
    with pytest.raises(InputError, match=r"packages.*nowhere"):
        description.read(name, ReadOptions(packages=(str(tmp_path / "nowhere"),)))


# Files as people write them.

WHEEL = '<link name="wheel"/>'


@pytest.mark.parametrize(
    "address",
    [
        "http://ros.org/wiki/xacro",
        "http://www.ros.org/wiki/xacro",
        "http://wiki.ros.org/xacro",
        "https://ros.org/wiki/xacro#macro",
    ],
)
@pytest.mark.parametrize("prefix", ["xacro", "x"])
def test_a_urdf_with_xacro_inside_is_expanded(tmp_path: Path, address: str, prefix: str) -> None:
    file = tmp_path / "r.urdf"
    body = f'<{prefix}:property name="n" value="4"/><link name="l${{n}}"/>'
    file.write_text(f'<robot name="r" xmlns:{prefix}="{address}">{body}</robot>')
    assert 'name="l4"' in text(str(file))


def test_placeholders_without_xacro_are_filled(tmp_path: Path, caplog: Log) -> None:
    file = tmp_path / "r.urdf"
    file.write_text('<robot name="r"><link name="${namespace}base"/></robot>')
    assert 'name="base"' in text(str(file))
    assert "namespace" in caplog.text
    assert 'name="a/base"' in text(str(file), namespace="a/")
    file.write_text('<robot name="r"><link name="${size}base"/></robot>')
    assert "add ++robot.arguments.size=" in refused(str(file))


def package(folder: Path, name: str, file: str, content: str) -> Path:
    path = folder / file
    path.parent.mkdir(parents=True, exist_ok=True)
    (folder / "package.xml").write_text(f"<package><name>{name}</name></package>")
    path.write_text(content)
    return path


MACRO = XACRO.format('<xacro:macro name="wheel">' + WHEEL + "</xacro:macro>")


@pytest.mark.parametrize(
    "where", ["beside", "repository", "workspace", "installed", "indexed", "ros1", "ros2"]
)
@pytest.mark.parametrize("find", ["find", "find-pkg-share"])
def test_packages_are_found_without_being_declared(
    tmp_path: Path, monkeypatch: Patch, where: str, find: str
) -> None:
    """By the name in package.xml: the folder may have another."""
    folders = {
        "beside": tmp_path / "src" / "bot" / "parts",
        "repository": tmp_path / "src" / "other" / "deep" / "parts",
        "workspace": tmp_path / "src" / "other" / "parts",
        "installed": tmp_path / "install" / "bot_parts" / "share" / "parts",
        "indexed": tmp_path / "install" / "share" / "bot_parts",
        "ros1": tmp_path / "ros1" / "stack" / "parts",
        "ros2": tmp_path / "ros2" / "share" / "parts",
    }
    package(folders[where], "bot_parts", "urdf/wheel.xacro", MACRO)
    if where == "indexed":
        (folders[where] / "package.xml").unlink()
        index = folders[where].parent / "ament_index" / "resource_index" / "packages"
        index.mkdir(parents=True)
        (index / "bot_parts").touch()
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path / 'nowhere'}:{tmp_path / 'ros1'}")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ros2"))
    body = f'<xacro:include filename="$({find} bot_parts)/urdf/wheel.xacro"/><xacro:wheel/>'
    inner = "all/of/these" if where == "workspace" else ""
    home = tmp_path / "src" / inner / "bot" / "bot_description"
    file = package(home, "bot_description", "urdf/bot.urdf.xacro", XACRO.format(body))
    assert 'name="wheel"' in text(str(file))


OLD = """<robot name="r" {space}>
<include filename="parts.xacro"/>
<arg name="side" default="left"/>
<property name="mass" value="5"/>
<if value="true"><link name="$(arg side)"/></if>
<unless value="true"><link name="never"/></unless>
<link name="base"><inertial><mass value="${{mass}}"/></inertial></link>
<wheel name="front"><origin xyz="0 {width} 0"/></wheel>
<gazebo reference="base"><sensor><wheel/></sensor></gazebo>
{late}</robot>"""
OLD_PARTS = """<robot><{0}macro name="wheel" params="name *place"><link name="${{name}}">
<insert_block name="place"/></link></{0}macro></robot>"""
LATE = '<property name="width" value="${mass / 10}"/>'


@pytest.mark.parametrize("prefix", ["", "xacro:"])
@pytest.mark.parametrize(("width", "late"), [("0.5", ""), ("${width}", LATE)])
@pytest.mark.parametrize(
    ("file", "space"), [("r.urdf", ""), ("r.xacro", 'xmlns:xacro="http://ros.org/wiki/xacro"')]
)
def test_xacro_of_before_2014_means_what_it_meant(
    tmp_path: Path, file: str, space: str, width: str, late: str, prefix: str
) -> None:
    """Without the prefix, and with properties that are defined after they are used."""
    parts = OLD_PARTS.format(prefix)
    if prefix:
        parts = parts.replace("<robot", '<robot xmlns:xacro="http://ros.org/wiki/xacro"')
    (tmp_path / "parts.xacro").write_text(parts)
    (tmp_path / file).write_text(OLD.format(space=space, width=width, late=late))
    root = description.read(str(tmp_path / file))[1]
    assert [link.get("name") for link in root.findall("link")] == ["left", "base", "front"]
    assert [mass.get("value") for mass in root.iter("mass")] == ["5"]
    assert [origin.get("xyz") for origin in root.iter("origin")] == ["0 0.5 0"]
    assert [child.tag for child in root] == ["link", "link", "link", "gazebo"]
    assert root.find("gazebo/sensor/wheel") is not None


SHOWN = '<link name="m"><visual><geometry><mesh filename="{}"/></geometry></visual></link>'


@pytest.mark.parametrize("address", ["package://bot/m.stl", "file://$(find bot)/m.stl"])
def test_the_name_in_package_xml_wins_over_a_folder_of_that_name(
    tmp_path: Path, address: str
) -> None:
    home = tmp_path / "bot-main"
    file = package(home, "bot", "urdf/r.xacro", XACRO.format(SHOWN.format(address)))
    (home / "package.xml").write_text("<package><!--<name>old</name>--><name>bot</name></package>")
    (home / "m.stl").touch()
    for module in ("bot", "urdf/bot"):
        (home / module).mkdir()
    assert f'filename="file://{home}/m.stl"' in text(str(file))


def test_sdf_inside_gazebo_is_not_judged_by_the_rules_of_urdf(tmp_path: Path) -> None:
    inner = (
        "<visual><geometry><mesh><uri>model://lamp/lamp.dae</uri></mesh></geometry></visual>",
        '<collision name="c"><geometry><mesh filename="gone.stl"/></geometry></collision>',
        "<plugin><mu>rough</mu><fdir1>ahead</fdir1><texture/></plugin>",
        "<link><collision/><visual/></link><joint/>",
    )
    plain = XACRO.format('<link name="base"/>')
    added = "".join(f'<gazebo reference="base">{sdf}</gazebo>' for sdf in inner)
    roots = []
    for name, content in (
        ("a.urdf", plain),
        ("b.urdf", plain.replace("</robot>", added + "</robot>")),
    ):
        (tmp_path / name).write_text(content)
        roots.append(description.read(str(tmp_path / name))[1])
    bare, full = (read_tree(root, "r") for root in roots)
    assert (bare.shapes, bare.friction_axes) == (full.shapes, full.friction_axes)
    assert bare.joints == full.joints


def test_an_ignored_package_is_left_out(tmp_path: Path, caplog: Log) -> None:
    body = (
        '<xacro:include filename="$(find arm_parts)/arm.xacro"/><xacro:arm side="left"/>'
        '<link name="base"><visual><geometry><mesh filename="package://arm_parts/a.stl"/>'
        "</geometry></visual></link>"
    )
    name = write(tmp_path, body)
    assert "ignored_packages" in refused(name)
    options = ReadOptions(ignored_packages=["arm_parts"])
    _, root = description.read(name, options)
    assert [child.tag for child in root] == ["link"]
    assert root.find("link/visual") is None
    assert "arm_parts/arm.xacro, <xacro:arm>" in caplog.text
    assert "package://arm_parts/a.stl" in caplog.text


def test_variables_are_those_of_the_key(tmp_path: Path) -> None:
    name = write(tmp_path, '<link name="$(env SIDE)_$(optenv SIZE small)"/>')
    assert "environment" in refused(name)
    options = ReadOptions(environment={"SIDE": "left"})
    assert description.read(name, options)[1][0].get("name") == "left_small"


def test_a_file_of_macros_names_the_file_to_use(tmp_path: Path) -> None:
    (tmp_path / "wheel.xacro").write_text(MACRO)
    write(tmp_path, '<xacro:include filename="wheel.xacro"/><xacro:wheel/>', "bot.urdf.xacro")
    assert "for example bot.urdf.xacro" in refused(str(tmp_path / "wheel.xacro"))


def test_a_faulty_expression_gives_its_line(tmp_path: Path) -> None:
    name = write(tmp_path, '\n<link name="a"/>\n<link name="${radius * 2}"/>')
    refused(name, where=f"{name}:3:")
    name = write(tmp_path, "\n\n\n<xacro:nothing/>")
    refused(name, where=f"{name}:4:")


def test_a_yaml_file_may_hold_numbers(tmp_path: Path) -> None:
    (tmp_path / "sizes.yaml").write_text("wheel: {radius: 0.05}")
    body = "<xacro:property name='s' value=\"${xacro.load_yaml('sizes.yaml')}\"/>"
    name = write(tmp_path, body + "<link name=\"r${s['wheel']['radius']}\"/>")
    assert 'name="r0.05"' in text(name)
    name = write(tmp_path, body + "<link name=\"r${s['wheel']['width']}\"/>")
    assert "width" in refused(name)


def test_an_absent_texture_refuses_no_robot(tmp_path: Path) -> None:
    body = '<material name="m"><texture filename="package://gone/a.jpg"/></material>'
    assert "package://gone/a.jpg" in text(write(tmp_path, body))


def test_a_missing_mesh_of_a_part_keeps_its_name(tmp_path: Path) -> None:
    part = '<{0}><geometry><mesh filename="package://gone/m.stl"/></geometry></{0}>'
    name = write(tmp_path, f'<link name="a">{part.format("visual")}</link>')
    assert "package://gone/m.stl" in text(name)


@pytest.mark.parametrize(
    "solid",
    [
        '<box size="1 1 1e308"/>',
        '<sphere radius="1e308"/>',
        '<cylinder radius="1" length="1e10"/>',
        '<capsule radius="1e308" length="1"/>',
        '<ellipsoid radii="1 1 1e308"/>',
    ],
)
def test_a_length_whose_square_may_overflow_is_named_with_file_and_line(solid: str) -> None:
    text = f"<link>\n<collision><geometry>\n{solid}</geometry></collision></link>"
    link = parse(text.encode(), "r.urdf")
    with pytest.raises(InputError, match=r"r\.urdf:3: .* must have lengths of at most 1e\+09 m"):
        SolidsReader("error").read(link, link[0])


@pytest.mark.parametrize("origin", ['xyz="0 0 1e308"', 'rpy="0 1e999 0"'])
def test_a_pose_that_is_none_is_named_with_file_and_line(origin: str) -> None:
    element = parse(f"<link>\n<origin {origin}/></link>".encode(), "r.urdf")
    with pytest.raises(InputError, match=r"r\.urdf:2: <origin> .*;") as error:
        read_origin(element)
    assert "\n" not in str(error.value)


def test_a_property_without_braces_is_read_as_proposed(tmp_path: Path) -> None:
    body = '<xacro:property name="up_m" value="0.5"/><link name="a"><inertial>{}</inertial></link>'
    written = body.format('<origin xyz="{}"/>')
    root = description.read(write(tmp_path, written.format("up_m")))[1]
    with pytest.raises(InputError, match=r"or, for a xacro property, \$\{up_m\}$") as error:
        read_origin(root[0][0])
    typed = str(error.value).rpartition(" ")[2]
    root = description.read(write(tmp_path, written.format(f"0 0 {typed}")))[1]
    assert read_origin(root[0][0]).position == (0.0, 0.0, 0.5)


def test_a_default_namespace_has_no_meaning(tmp_path: Path) -> None:
    """ROS and Gazebo read tags as they are written."""
    text = '<robot xmlns="http://www.ros.org" name="r" xmlns:x="y"><link name="a"/><x:b/></robot>'
    (tmp_path / "r.urdf").write_text(text)
    root = description.read(str(tmp_path / "r.urdf"))[1]
    assert [element.tag for element in root.iter()] == ["robot", "link", "{y}b"]
    assert read_tree(root, "r.urdf").root == "a"
