"""A champion as a package: what the robot gets is where and what the design is."""

import ast
import io
import json
import math
import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import yaml
import yourdfpy
from helpers import everything
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from lxml import etree
from needs import ROS2_PYTHON
from robot_cases import independent, rover, some_mounts

from evoros.analysis.command import evoros_analyze, write_folder
from evoros.analysis.tables.records import Record
from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.bridge.process import start_process
from evoros.controller.briefing_text import describe_drive
from evoros.drive.automatic import AutomaticDescription
from evoros.plugins.ardupilot.controller import ArduPilot
from evoros.plugins.deploy.champion import Champion, MountedSensor, list_clashes, read_champion
from evoros.plugins.deploy.parameters import INSTANCES, write_ros_file
from evoros.plugins.deploy.ros_package import PackageOptions, simplify, write_package
from evoros.plugins.deploy.tests.deploy_cases import champion_of
from evoros.robot.loading import load_robot
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar
from evoros.storage.figure_context import Beam
from evoros.terminal.console import DONE, INPUT

OPTIONS = PackageOptions("a_champion", "A B <a.b@example.org>", "MIT", None)
CATKIN = "from catkin_pkg.package import parse_package_string as p; import sys; p(sys.stdin.read())"


@pytest.fixture(scope="module")
def package(record: Record, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package of the run's champion, as the command writes it."""
    out = tmp_path_factory.mktemp("src")
    assert evoros_analyze(["deploy", str(record.path), "--output", str(out)]) == DONE
    (folder,) = out.iterdir()
    return folder


# What is written ----------------------------------------------------------------------------


def depends(package: Path) -> set[str]:
    root = etree.parse(package / "package.xml").getroot()
    return {str(element.text) for element in root.findall("exec_depend")}


@pytest.mark.slow
def test_ros_knows_the_package(package: Path) -> None:
    root = etree.parse(package / "package.xml").getroot()
    assert (root.tag, root.get("format")) == ("package", "3")
    for required in ("name", "version", "description", "maintainer", "license"):
        assert [bool(str(e.text).strip()) for e in root.findall(required)] == [True]
    assert root.findtext("name") == package.name
    assert re.fullmatch(r"\d+\.\d+\.\d+", str(root.findtext("version")))
    assert "@" in str(root.find("maintainer").get("email"))  # type: ignore[union-attr]
    assert root.findtext("export/build_type") == root.findtext("buildtool_depend") == "ament_cmake"
    made = (package / "CMakeLists.txt").read_text()
    assert f"project({package.name} " in made
    installed = re.search(r"install\(DIRECTORY (.*)\n", made)
    assert installed is not None
    assert set(installed[1].split()) == {f.name for f in package.iterdir() if f.is_dir()}


@pytest.mark.slow
@pytest.mark.ros(1)
def test_catkin_reads_the_package(package: Path) -> None:
    text = (package / "package.xml").read_text()
    subprocess.run(["/usr/bin/python3", "-c", CATKIN], input=text, text=True, check=True)


def test_the_launch_file_compiles_and_refers_to_what_there_is(package: Path) -> None:
    (launch,) = (package / "launch").iterdir()
    assert launch.name.endswith(".launch.py")
    tree = ast.parse(launch.read_text())
    compile(tree, launch.name, "exec")
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    shares = [
        c.args[0] for c in calls if getattr(c.func, "id", "") == "get_package_share_directory"
    ]
    assert [ast.literal_eval(share) for share in shares] == [package.name]
    paths = [ast.unparse(n) for n in ast.walk(tree) if isinstance(n, ast.BinOp)]
    whole = max(paths, key=len)
    assert (package / "/".join(re.findall(r"'([^']+)'", whole))).is_file()
    modules = {n.module.split(".")[0] for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}  # type: ignore[union-attr]
    started = {ast.literal_eval(k.value) for c in calls for k in c.keywords if k.arg == "package"}
    assert modules - {"pathlib"} | started | {"ros2launch"} == depends(package)


def test_every_yaml_is_a_parameter_file(package: Path, record: Record) -> None:
    files = sorted((package / "config").glob("*.yaml"))
    trees = {file.name: yaml.safe_load(file.read_text()) for file in files}
    assert all(
        list(tree) == ["/**"] and list(tree["/**"]) == ["ros__parameters"]
        for tree in trees.values()
    )
    controller = trees["controller.yaml"]["/**"]["ros__parameters"]["controller"]
    evolved = float(record.run.genes.value.iloc[0])
    assert (
        controller["avoidance"]["range_m"]
        == evolved
        != record.values["controller.avoidance.range_m"]
    )
    sensors = trees["robot.yaml"]["/**"]["ros__parameters"]["evoros"]
    assert sensors["sensors"] == [f"sonar_{sensor}" for sensor in range(len(record.run.champion))]
    for name in sensors["sensors"]:
        limits = {"range_min_m", "range_max_m", "field_of_view_rad"}
        assert set(sensors[name]) == {"type", "pose", "period_s"} | limits  # as in missions
        assert sensors[name]["field_of_view_rad"] == math.radians(30.0)
    assert sensors["drive"] == describe_drive(rover().drive)


READ = """
import json, os, sys, rclpy
from rclpy.node import Node
rclpy.init(args=["x", "--ros-args", "--params-file", "robot.yaml", "--params-file", "odd.yaml"])
node = Node("any", automatically_declare_parameters_from_overrides=True)
values = {name: each.value for name, each in node.get_parameters_by_prefix("").items()}
os.write(int(sys.argv[1]), json.dumps(values, default=list).encode())
"""


@pytest.mark.ros(2)
def test_a_node_gets_the_parameters(package: Path) -> None:
    """Some values could be misread as other YAML types; the node has its own network."""
    odd = {"a": {"text": "on", "number": "1.5", "tiny": 1e-12, "mixed": [1.0, 2.0], "flag": True}}
    robot = (package / "config" / "robot.yaml").read_text()
    files = {"robot.yaml": robot, "odd.yaml": write_ros_file(odd, ["a.none"], ["odd"])}
    reading, writing = os.pipe()
    command = [str(ROS2_PYTHON), "-c", READ, str(writing)]
    with open(reading) as answer, start_process(command, pass_fds=[writing], files=files):
        os.close(writing)
        got = json.loads(answer.read())
    assert {name: got[f"a.{name}"] for name in odd["a"]} == odd["a"]
    sonar = yaml.safe_load(robot)["/**"]["ros__parameters"]["evoros"]["sonar_0"]
    assert all(got[f"evoros.sonar_0.{name}"] == value for name, value in sonar.items())


# Where the sensors are ----------------------------------------------------------------------


def mounts_on(links: list[str]) -> st.SearchStrategy[list[Mount]]:
    length, angle = st.floats(-0.5, 0.5), st.floats(-180.0, 180.0)
    kinds, pitch = st.sampled_from(["sonar", "lidar"]), st.floats(-89.0, 89.0)
    mount = st.builds(Mount, kinds, st.sampled_from(links), length, length, length, angle, pitch)
    return st.lists(mount, max_size=12)


def independent_centre(urdf: Any) -> Array:
    """The centre of mass by another reader, in the frame of the root."""
    moment, total = np.zeros(3), 0.0
    for name, link in urdf.link_map.items():
        if link.inertial is not None and link.inertial.mass:
            origin = np.eye(4) if link.inertial.origin is None else link.inertial.origin
            pose = urdf.get_transform(name) @ origin
            moment, total = moment + link.inertial.mass * pose[:3, 3], total + link.inertial.mass
    centre: Array = moment / total
    return centre


@pytest.mark.slow
@settings(
    max_examples=25,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    phases=[Phase.generate],
)
@given(data=st.data())
def test_positions_are_those_of_the_design_wherever_they_are_written(
    data: st.DataObject, record: Record, tmp_path: Path
) -> None:
    """In the description (as yourdfpy reads it), in the parameters, and in ArduPilot's frame."""
    robot = rover(data.draw(st.sampled_from(["erle_rover", "two_wheeler"])))
    champion = champion_of(
        record, robot, data.draw(mounts_on(sorted(robot.sensor_links))), tmp_path
    )
    files, _ = write_package(champion, OPTIONS, {})
    (description,) = (path for path in files if path.startswith("urdf/"))
    urdf = independent(files[description].decode())
    root = np.array(robot.sensor_links[urdf.base_link][:3])  # in the robot's frame
    mounts = champion_mounts(champion)
    poses = robot.with_sensors(mounts, {m.sensor: Sonar() for m in mounts}).sensor_poses
    parameters = yaml.safe_load(files["config/robot.yaml"])["/**"]["ros__parameters"]
    given = dict(
        line.split()
        for line in files["config/ardupilot_4.7.parm"].decode().splitlines()
        if line[0] != "#"
    )
    assert len(given) == 6 * min(len(champion.sensors), len(INSTANCES))
    for index, (sensor, pose) in enumerate(zip(champion.sensors, poses, strict=True)):
        frame = urdf.get_transform(sensor.link)
        x, y, z, yaw, pitch = pose
        beam = [math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)]
        np.testing.assert_allclose(frame[:3, 3] + root, (x, y, z), atol=1e-9)
        np.testing.assert_allclose(frame[:3, 0], beam, atol=1e-9)
        *place, told_yaw, told_pitch = parameters["evoros"][sensor.link]["pose"]
        turned = math.remainder(told_yaw - yaw, 2.0 * math.pi)
        np.testing.assert_allclose([*place, turned, told_pitch], (x, y, z, 0.0, pitch), atol=1e-9)
        if index >= len(INSTANCES):
            continue
        start = f"RNGFND{INSTANCES[index]}_"
        forward, left, up = frame[:3, 3] - independent_centre(urdf)
        body = [float(given[f"{start}POS_{axis}"]) for axis in "XYZ"]
        np.testing.assert_allclose(body, (forward, -left, -up), atol=6e-5)
        off = math.degrees(yaw) + 45.0 * int(given[f"{start}ORIENT"])  # clockwise from above
        assert abs((off + 180.0) % 360.0 - 180.0) <= 22.5 + 1e-6


def test_sensors_that_see_the_robot_are_reported(record: Record, tmp_path: Path) -> None:
    """The cage begins 0.1 m behind the first sonar; the second one looks ahead."""
    mounts = [Mount("sonar", "base_link", 0.09, 0.0, 0.166, yaw, 12.5) for yaw in (180.0, 0.0)]
    _, notes = write_package(champion_of(record, rover(), mounts, tmp_path), OPTIONS, {})
    (line,) = (note for note in notes if "blocks" in note)
    assert re.search(
        r"blocks \d+ % of the cone of sonar_0, which sees base_link 0\.1\d* m away", line
    )


def champion_mounts(champion: Champion) -> list[Mount]:
    table = champion.record.run.champion
    rows = (
        table[table.sensor.notna()][["type", "link", "x_m", "y_m", "z_m", "yaw_deg", "pitch_deg"]]
        .to_numpy()
        .tolist()
    )
    return [Mount(*row) for row in rows]


def test_ranges_have_the_units_of_the_version(package: Path) -> None:
    """AP_RangeFinder_Params.cpp: metres since 4.7, whole centimetres before."""
    new, old = ((package / "config" / f"ardupilot_{v}.parm").read_text() for v in ("4.7", "4.6"))
    assert "RNGFND1_MIN 0.060\nRNGFND1_MAX 4.500\n" in new
    assert "_CM" not in new
    assert "RNGFND1_MIN_CM 6\nRNGFND1_MAX_CM 450\n" in old
    positions = [re.findall(r"\S+_(?:POS_.|ORIENT) .*", text) for text in (new, old)]
    assert positions[0] == positions[1]


def test_positions_may_be_relative_to_the_autopilot(record: Record) -> None:
    options = replace(OPTIONS, imu_m=(0.1, -0.02, 0.05))
    text = write_package(read_champion(record), options, {})[0][
        "config/ardupilot_4.7.parm"
    ].decode()
    first = record.run.champion.iloc[0]
    assert f"RNGFND1_POS_X {first.x_m - 0.1:.4f}\nRNGFND1_POS_Y {-first.y_m - 0.02:.4f}\n" in text
    assert f"RNGFND1_POS_Z {0.05 - first.z_m:.4f}\n" in text


def written(champion: Champion, values: dict[str, Any], genes: str = "") -> dict[str, str]:
    """Write the package of a champion whose configuration has these values; return its texts."""
    path = champion.record.path / "champion" / "genes.csv"
    path.write_text("design,gene,key,value\n" + genes)
    changed = replace(champion.record, values=values, run=replace(champion.record.run))
    files, _ = write_package(read_champion(changed), OPTIONS, {})
    return {name: content.decode() for name, content in files.items()}


def test_nodes_get_the_parameters_of_the_missions(record: Record, tmp_path: Path) -> None:
    champion = champion_of(record, rover(), some_mounts(2), tmp_path)
    values = {
        "controller._target_": "evoros.plugins.ros.ros_controller.Ros2",
        "controller.environment.TOKEN": "secret",
        "controller.nodes": ["ros2 run mine avoid", ["python3", "limit.py"]],
        "controller.parameters.avoid.range_m": 2.0,
        "controller.parameters.rays": 5,
        "controller.topics.range": "/scan/{sensor}",
    }
    genes = "3,near,controller.parameters.avoid.range_m,1.25\n3,rays,controller.parameters.rays,7\n"
    genes += "3,fast,robot.drive.max_speed_mps,0.5\n3,lock,robot.drive.steering_limit_rad,0.6\n"
    texts = written(champion, values, genes)
    tree = yaml.safe_load(texts["config/controller.yaml"])["/**"]["ros__parameters"]
    assert tree == {"avoid": {"range_m": 1.25}, "rays": 7}
    sensors = yaml.safe_load(texts["config/robot.yaml"])["/**"]["ros__parameters"]["evoros"]
    assert sensors["sonar_1"]["topic"] == "/scan/sonar_1"
    assert sensors["drive"]["max_speed_mps"] == 0.5
    assert "steering_limit_rad" not in sensors["drive"]
    assert "parameter type: evoros.drive.steering_limit_rad\n" in texts["config/robot.yaml"]
    for line in ("`ros2 run mine avoid`", "`python3 limit.py`", "range: `/scan/{sensor}`"):
        assert f"- {line}\n" in texts["README.md"]
    assert not [name for name, text in texts.items() if "secret" in text]


def test_only_evolved_parameters_of_ardupilot_take_effect(record: Record, tmp_path: Path) -> None:
    champion = champion_of(record, rover(), [], tmp_path)
    values = {
        "controller._target_": f"{ArduPilot.__module__}.{ArduPilot.__qualname__}",
        "controller.avoidance.range_m": 2.0,
        "controller.environment.TOKEN": "secret",
        "controller.parameters.FS_ACTION": 0,
        "controller.parameters.WP_SPEED": 0.3,
    }
    texts = written(champion, values, "3,speed,controller.parameters.WP_SPEED,0.25\n")
    for version in ("4.7", "4.6"):
        lines = texts[f"config/ardupilot_{version}.parm"].splitlines()
        assert [line for line in lines if line[0] != "#"] == ["WP_SPEED 0.25"]
        assert "# in the simulation: FS_ACTION 0" in lines
    tree = yaml.safe_load(texts["config/controller.yaml"])["/**"]["ros__parameters"]
    assert tree == {"controller": {"avoidance": {"range_m": 2.0}}}
    assert not [name for name, text in texts.items() if "secret" in text]


def body(x: float, yaw: float, pitch: float = 0.0, y: float = 0.0) -> MountedSensor:
    """A sensor whose body is 2 cm long, 4 cm wide and 2 cm high."""
    size, beam = (0.02, 0.04, 0.02), Beam(30.0, 0.06, 4.5, 0.1)
    return MountedSensor(f"at_{x}", "sonar", (x, y, 0.1), yaw, pitch, beam, size)


@pytest.mark.parametrize(
    ("other", "depth_mm"),
    [
        (body(0.015, 0.0), 5.0),
        (body(0.021, 0.0), None),
        (body(0.025, 90.0), 5.0),  # across: it is 4 cm long
        (body(0.031, 90.0), None),
        (body(0.022, 0.0, pitch=45.0), 10.0 + 10.0 * math.sqrt(2.0) - 22.0),
        (body(0.03, 45.0, y=0.03), None),  # only along an axis of the other
        (body(0.0, 0.0, y=0.039), 1.0),
    ],
)
def test_bodies_that_overlap_are_told(other: MountedSensor, depth_mm: float | None) -> None:
    for pair in ((body(0.0, 0.0), other), (other, body(0.0, 0.0))):
        line = next(iter(list_clashes(pair)), None)
        assert (line is None) == (depth_mm is None)
        if line is not None:
            assert line.endswith(f"overlap; move one of the two by {depth_mm:.1f} mm or more")
            assert all(sensor.link in line for sensor in pair)


# Names, meshes, folders ---------------------------------------------------------------------


@given(st.text())
def test_any_robot_gives_a_name_that_ros_takes(robot: str) -> None:
    assert replace(OPTIONS, name=f"{simplify(robot)}_champion").name.endswith("_champion")


@pytest.mark.parametrize("name", ["Rover", "2wd", "a__b", "a-b", "_a", "a_", "a", ""])
def test_a_name_that_ros_refuses_is_one_line(
    name: str, record: Record, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert (
        evoros_analyze(["deploy", str(record.path), f"--name={name}", f"--output={out}"]) == INPUT
    )
    err = capsys.readouterr().err
    assert re.fullmatch(r".*--name.*\n", err)
    assert not out.exists()


@pytest.mark.parametrize(
    ("given", "named"),
    [
        (["--maintainer", "nobody"], "--maintainer"),
        (["--imu", "0", "nan", "0"], "--imu"),
        (["--license", " "], "--license"),
        (["--run", "other"], "--run"),
    ],
)
def test_bad_options_are_one_line(
    given: list[str], named: str, record: Record, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        evoros_analyze(["deploy", str(record.path), *given, f"--output={tmp_path / 'o'}"]) == INPUT
    )
    assert re.fullmatch(f".*{named}.*\n", capsys.readouterr().err)


def test_an_unknown_path_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert evoros_analyze(["deploy", str(tmp_path / "none")]) == INPUT
    assert capsys.readouterr().err.count("\n") == 1


def test_meshes_travel_and_other_files_do_not(record: Record, tmp_path: Path) -> None:
    """Two meshes with one name are both copied; packages are logged and become dependencies."""
    champion = champion_of(record, rover(), [], tmp_path)
    for folder in ("a", "b c"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "body.stl").write_bytes(folder.encode())
    (tmp_path / "secret.txt").write_text("secret")
    (tmp_path / "a" / "skin.dae").write_text("<init_from>skin.png</init_from>")
    named = [
        f"file://{tmp_path}/a/body.stl",
        f"file://{tmp_path}/b c/body.stl",
        f"file://{tmp_path}/a/skin.dae",
        f"file://{tmp_path}/a/body.stl",
        f"file://{tmp_path}/secret.txt",
        "package://their_robot/meshes/arm.stl",
    ]
    for name in named:
        etree.SubElement(champion.robot, "mesh", filename=name)
    files, notes = write_package(champion, OPTIONS, {})
    root = etree.fromstring(files["urdf/erle_rover.urdf"])
    result = [str(mesh.get("filename")) for mesh in root.iter("mesh")]
    part = [
        f"package://a_champion/meshes/{n}"
        for n in ("body.stl", "body_2.stl", "skin.dae", "body.stl")
    ]
    assert result == [*part, *named[4:]]
    assert (files["meshes/body.stl"], files["meshes/body_2.stl"]) == (b"a", b"b c")
    assert b"secret" not in b"".join(
        content for path, content in files.items() if "urdf" not in path and path != "README.md"
    )
    assert [
        any(word in note for note in notes) for word in ("skin.png", "secret.txt", "arm.stl")
    ] == [True] * 3
    assert b"<exec_depend>their_robot</exec_depend>" in files["package.xml"]
    assert b" meshes " in files["CMakeLists.txt"]
    assert all(note in files["README.md"].decode() for note in notes)


ROVER_OF_MESHES = """
<robot name="hull">
  <link name="base_link">
    <collision>
      <origin xyz="0 0 0.12"/>
      <geometry><mesh filename="body.stl" scale="0.001 0.001 0.001"/></geometry>
    </collision>
    <inertial>
      <mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="mast">
    <visual><geometry><mesh filename="mast.dae"/></geometry></visual>
    <collision><geometry><mesh filename="mast.dae"/></geometry></collision>
  </link>
  <joint name="mast_joint" type="fixed">
    <parent link="base_link"/><child link="mast"/><origin xyz="0.05 0 0.25"/>
  </joint>
  {wheels}
</robot>"""
WHEEL = """
  <link name="{0}_wheel"><collision><origin rpy="1.5707963 0 0"/><geometry>
    <cylinder radius="0.05" length="0.03"/></geometry></collision>
  </link>
  <joint name="{0}_wheel_joint" type="continuous">
    <parent link="base_link"/><child link="{0}_wheel"/>
    <origin xyz="0 {1} 0.05"/><axis xyz="0 1 0"/><limit effort="1" velocity="8"/>
  </joint>"""


def test_a_robot_of_meshes_becomes_a_package_that_loads(record: Record, tmp_path: Path) -> None:
    """Anywhere, by another reader, without the files that the description was read from."""
    theirs, package = tmp_path / "theirs", tmp_path / OPTIONS.name
    theirs.mkdir()
    trimesh.creation.box((300.0, 180.0, 120.0)).export(theirs / "body.stl")
    trimesh.creation.box((0.04, 0.04, 0.2)).export(theirs / "mast.dae")
    wheels = WHEEL.format("left", 0.12) + WHEEL.format("right", -0.12)
    (theirs / "hull.urdf").write_text(ROVER_OF_MESHES.format(wheels=wheels))
    robot = load_robot(str(theirs / "hull.urdf"), AutomaticDescription())
    mounts = [Mount("sonar", "base_link", 0.1, 0.02, 0.12, 10.0, 5.0)]
    champion = champion_of(record, robot, mounts, tmp_path)
    files, _ = write_package(champion, OPTIONS, {})
    shutil.rmtree(theirs)
    for name, contents in files.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_bytes(contents)

    def locate(fname: str) -> str:
        return fname.replace(f"package://{package.name}", str(package))

    text = files["urdf/hull.urdf"]
    urdf = yourdfpy.URDF.load(
        io.BytesIO(text),
        filename_handler=locate,
        build_collision_scene_graph=True,
        load_collision_meshes=True,
    )
    sizes = {tuple(np.round(g.extents, 6)) for g in urdf.collision_scene.geometry.values()}
    assert {(0.3, 0.18, 0.12), (0.04, 0.04, 0.2)} <= sizes
    (sensor,) = champion.sensors
    root = np.array(robot.sensor_links["base_link"][:3])
    place = urdf.get_transform(sensor.link, "base_link")[:3, 3] + root
    np.testing.assert_allclose(place, sensor.position_m, atol=1e-9)
    assert champion.centre_m is not None
    np.testing.assert_allclose(champion.centre_m, independent_centre(urdf) + root, atol=1e-6)


def test_only_its_own_unchanged_output_is_replaced(tmp_path: Path) -> None:
    target, files = tmp_path / "src" / "a", {"one.txt": b"1", "folder/two.txt": b"2"}
    (tmp_path / "src" / "a").mkdir(parents=True)
    for _ in range(2):  # into an empty folder, and over its own output
        write_folder(target, "a command", files)
    first = everything(target)
    assert {**first, "evoros.json": b""} == {**files, "evoros.json": b""}
    for name, text in (
        ("one.txt", "mine"),
        ("mine.txt", "mine"),
        ("folder/two.txt", None),
        ("evoros.json", "mine"),
        ("evoros.json", first["evoros.json"].decode().replace("a command", "another")),
    ):
        path = target / name
        path.unlink(missing_ok=True)
        if text is not None:
            path.write_text(text)
        before = everything(tmp_path)
        with pytest.raises(InputError, match=f"{name}.*--output"):
            write_folder(target, "a command", files)
        assert everything(tmp_path) == before
        path.unlink(missing_ok=True)
        if name in first:
            path.write_bytes(first[name])
    write_folder(target, "a command", {"three.txt": b"3"})
    assert sorted(everything(tmp_path)) == ["src/a/evoros.json", "src/a/three.txt"]  # no draft


def test_what_cannot_be_written_leaves_the_folder_as_it_was(tmp_path: Path) -> None:
    write_folder(tmp_path / "a", "a command", {"one.txt": b"1"})
    before = everything(tmp_path)
    with pytest.raises(OSError, match="one"):  # a file where a folder is needed
        write_folder(tmp_path / "a", "a command", {"one": b"1", "one/two": b"2"})
    assert everything(tmp_path) == before


@pytest.mark.slow
def test_the_same_champion_gives_the_same_bytes(
    package: Path, record: Record, tmp_path: Path
) -> None:
    assert evoros_analyze(["deploy", str(record.path), f"--output={tmp_path}"]) == DONE
    assert everything(tmp_path / package.name) == everything(package)
