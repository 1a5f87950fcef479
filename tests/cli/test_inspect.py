"""evoros inspect: from somebody else's robot and world to files that evoros runs."""

import itertools
import math
import shlex
from pathlib import Path

import numpy as np
import pytest
import trimesh
from documents import example_files, write
from fixture_types import Capture, Patch
from helpers import alone
from proposal_sites import is_of

from evoros.cli.inspect import inspect
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.filter.bias import Bias
from evoros.filter.gaussian_noise import GaussianNoise
from evoros.filter.mask import Mask
from evoros.preflight.routes import check_routes
from evoros.robot.self_sight import measure_clear_ranges
from evoros.sensor.bumper import Bumper
from evoros.sensor.imu import Imu
from evoros.sensor.lidar import Lidar
from evoros.sensor.protocol import sees
from evoros.terminal.console import DONE, INPUT
from evoros.world.floors import points_between

FILES = example_files()
SCOUT, DEPOT = "theirs/scout.urdf.xacro", "theirs/depot.world"
PNG = b"\x89PNG"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: Patch) -> Path:
    """A current folder with the example files of docs/your_robot.md."""
    write(FILES, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def undrawn(monkeypatch: Patch) -> None:
    """Draw no pictures, which takes a third of the time."""
    for name in ("inspection.draw_robot_picture", "worlds.draw_world_picture"):
        monkeypatch.setattr(f"evoros.analysis.drawing.{name}", lambda *_: PNG)


@pytest.mark.slow
def test_a_robot_and_a_world_become_files_that_compose_and_build(
    folder: Path, capsys: Capture
) -> None:
    words = ["robot", SCOUT, "world", DEPOT, "robot.arguments.laser=false"]
    assert inspect(words) == DONE
    output = capsys.readouterr().out
    for path in ("mine/robot/scout.yaml", "mine/world/depot.yaml"):
        assert path in output
        assert (folder / path).with_suffix(".png").read_bytes().startswith(PNG)
    config = compose(
        ["robot=scout", "world=depot", "design=around", "simulator=planar"], config_dir="mine"
    )
    experiment = config.build()
    assert experiment.robot.name == "scout"
    assert "laser_link" not in experiment.robot.sensor_links
    (world,) = experiment.world.values()
    assert {body.name for body in world.obstacles} >= {"rack_1", "rack_2", "barrel"}


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_a_working_folder_may_be_moved(folder: Path, monkeypatch: Patch) -> None:
    words = [
        "robot",
        SCOUT,
        "world",
        DEPOT,
        "robot.packages=[theirs]",
        "world.model_paths=[theirs]",
    ]
    assert inspect(words) == DONE
    moved = folder.with_name("moved")
    folder.rename(moved)
    monkeypatch.chdir(moved)
    choices = ["robot=scout", "world=depot", "design=around", "simulator=planar"]
    experiment = compose(choices, config_dir="mine").build()
    (world,) = experiment.world.values()
    assert experiment.robot.name == "scout"
    assert "barrel" in {body.name for body in world.obstacles}
    for path in ("robot/scout.yaml", "world/depot.yaml"):
        assert str(folder) not in (moved / "mine" / path).read_text()


@pytest.mark.usefixtures("undrawn")
def test_an_absolute_path_stays(folder: Path) -> None:
    assert inspect(["robot", str(folder / SCOUT)]) == DONE
    assert f"description: {folder / SCOUT}" in (folder / "mine/robot/scout.yaml").read_text()


@pytest.mark.usefixtures("undrawn")
def test_the_table_tells_what_was_found_and_assumed(folder: Path, capsys: Capture) -> None:
    assert inspect(["robot", SCOUT]) == DONE
    rows = dict(
        line.strip().partition("  ")[::2]
        for line in capsys.readouterr().out.splitlines()
        if line.startswith("  ")
    )
    assert "left_wheel_joint" in rows["drive"]
    assert "caster_wheel" in rows["drive"]
    assert rows["mass"].strip() == "4.7 kg"
    assert rows["joints"].strip() == "3 fixed, 2 continuous"  # base, caster, laser; two wheels


@pytest.mark.usefixtures("undrawn")
def test_a_drive_is_named_as_in_a_run(folder: Path) -> None:
    drive = [
        "drive@robot.drive=differential",
        "robot.drive.wheel_joints=[left_wheel_joint,right_wheel_joint]",
        "robot.drive.caster_links=[caster_wheel]",
        "robot.drive.wheelbase_m=0.123",
        "robot.drive.steering_limit_rad=0.8",
        "robot.drive.max_speed_mps=0.4",
    ]
    assert inspect(["robot", SCOUT, *drive]) == DONE
    choices = ["robot=scout", "design=around"]
    inspected = compose(choices, config_dir="mine").build().robot.drive
    named = compose(["robot=own", f"robot.description={SCOUT}", "design=around", *drive]).build()
    assert inspected == named.robot.drive
    assert inspected.wheelbase_m == 0.123


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_an_own_lidar_does_not_see_the_robot(folder: Path, capsys: Capture) -> None:
    """A mast stands in its way, as on a forklift, and laser filters mask what meets it."""
    laser = """<gazebo reference="laser_link"><sensor type="ray" name="scan"><ray><scan><horizontal>
    <samples>90</samples><min_angle>-1.57</min_angle><max_angle>1.57</max_angle></horizontal></scan>
    <range><min>0.1</min><max>6</max></range></ray></sensor></gazebo><link name="mast"><collision>
    <origin xyz="0.2 0.05 0"/><geometry><box size="0.02 0.04 0.3"/></geometry></collision></link>
    <joint name="mast_joint" type="fixed"><parent link="laser_link"/><child link="mast"/></joint>
    </robot>"""
    scout = folder / SCOUT
    scout.write_text(scout.read_text().replace("</robot>", laser))
    assert inspect(["robot", SCOUT]) == DONE
    assert "of its 90 beams see the robot itself" in capsys.readouterr().out
    experiment = compose(["robot=scout", "design=scout_sensors"], config_dir="mine").build()
    (mount,) = experiment.space.decode(np.zeros(experiment.space.size)).mounts
    robot = experiment.robot.with_sensors([mount], experiment.design.sensors)
    filters = robot.mounted_sensors()[0].filters.values()
    (mask,) = (part for part in filters if isinstance(part, Mask))
    masked = [any(a <= beam <= b for a, b in mask.beams) for beam in range(mask.scan)]
    assert (measure_clear_ranges(robot) < 6.0).tolist() == masked


SENSORS = """
  <gazebo reference="laser_link">
    <sensor type="sonar" name="laser_1">
      <pose>0.02 0 0.01 0 -0.1 0.5</pose>
      <update_rate>30</update_rate>
      <sonar><min>0.1</min><max>3</max><radius>0.6</radius></sonar>
    </sensor>
    <sensor type="sonar" name="laser_2">
      <update_rate>30</update_rate>
      <sonar><min>0.1</min><max>3</max><radius>0.6</radius></sonar>
    </sensor>
    <sensor type="camera" name="eye"/>
  </gazebo>
</robot>"""


@pytest.mark.slow
def test_the_sensors_of_a_description_become_a_design(folder: Path, capsys: Capture) -> None:
    scout = folder / SCOUT
    scout.write_text(scout.read_text().replace("</robot>", SENSORS))
    assert inspect(["robot", SCOUT]) == DONE
    output = capsys.readouterr().out
    assert "design=scout_sensors" in output
    assert "'camera'" in output  # left out, and told
    assert "laser_1: measures every 0.1 s, not every 0.033" in output
    experiment = compose(["robot=scout", "design=scout_sensors"], config_dir="mine").build()
    space = experiment.space
    first, second = space.decode(np.zeros(space.size)).mounts  # none is placed beside them
    assert first.sensor == second.sensor  # equal sensors share a type
    assert (second.link, second.x_m, second.yaw_deg) == ("laser_link", 0.0, 0.0)
    assert (first.x_m, first.z_m) == (0.02, 0.01)
    angles = [math.radians(first.pitch_deg), math.radians(first.yaw_deg)]
    assert angles == pytest.approx([0.1, 0.5], abs=1e-5)  # a negative rotation raises the nose
    sonar = experiment.design.sensors[first.sensor]
    assert sees(sonar)
    assert (sonar.period_s, sonar.range_min_m, sonar.range_max_m) == (0.1, 0.1, 3.0)
    assert len(space.decode(np.ones(space.size)).mounts) == 4


FELT = """
  <gazebo reference="laser_link">
    <sensor type="gpu_lidar" name="scan">
      <update_rate>5</update_rate>
      <lidar>
        <scan><horizontal>
          <samples>90</samples><min_angle>-1.5</min_angle><max_angle>1.5</max_angle>
        </horizontal></scan>
        <range><min>0.2</min><max>6</max></range>
        <noise><type>gaussian</type><stddev>0.03</stddev></noise>
      </lidar>
    </sensor>
    <sensor type="imu" name="inertial">
      <pose>0 0 0.02 0 0 0</pose><update_rate>10</update_rate>
      <imu><angular_velocity>
        <z><noise type="gaussian"><stddev>0.004</stddev><bias_mean>0.001</bias_mean></noise></z>
      </angular_velocity></imu>
    </sensor>
    <sensor type="contact" name="front_switch"/>
  </gazebo>
</robot>"""


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_a_lidar_an_imu_and_a_contact_sensor_are_taken_over(folder: Path, capsys: Capture) -> None:
    scout = folder / SCOUT
    scout.write_text(scout.read_text().replace("</robot>", FELT))
    assert inspect(["robot", SCOUT]) == DONE
    output = capsys.readouterr().out
    assert "left out" not in output
    assert "front_switch: senses contact in a strip 0.4 m wide" in output
    chosen = ["robot=scout", "design=scout_sensors", "simulator=planar"]
    experiment = compose(chosen, config_dir="mine").build()
    space = experiment.space
    mounts = space.decode(np.zeros(space.size)).mounts
    types = [experiment.design.sensors[mount.sensor] for mount in mounts]
    lidar, imu, bumper = types
    assert isinstance(lidar, Lidar)
    assert (lidar.beams, lidar.range_min_m, lidar.range_max_m) == (90, 0.2, 6.0)
    assert lidar.fov_deg == pytest.approx(math.degrees(3.0), abs=1e-5)
    assert lidar.period_s == 0.2
    assert isinstance(imu, Imu)
    assert imu.period_s == 0.1
    assert (
        "inertial: has settings in the noise of <angular_velocity> that evoros cannot represent: "
        "bias_mean" in output
    )
    noise, bias = imu.filters["rate_noise"], imu.filters["rate_bias"]
    assert noise == GaussianNoise(0.004, of="rate")
    assert bias == Bias(0.0, 0.001, of="rate")
    assert imu.filters["acceleration_noise"] == GaussianNoise(0.02, of="acceleration")
    assert lidar.filters == {"noise": GaussianNoise(0.03)}
    assert mounts[1].z_m == 0.02
    assert isinstance(bumper, Bumper)
    assert {mount.link for mount in mounts} == {"laser_link"}


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_a_file_is_kept_and_named(folder: Path, capsys: Capture) -> None:
    assert inspect(["world", DEPOT]) == DONE
    before = (folder / "mine" / "world" / "depot.yaml").read_bytes()
    assert inspect(["world", DEPOT]) == INPUT
    assert "depot.yaml" in capsys.readouterr().err
    assert (folder / "mine" / "world" / "depot.yaml").read_bytes() == before


@pytest.mark.usefixtures("undrawn")
def test_a_part_that_cannot_be_used_leaves_no_file(folder: Path, capsys: Capture) -> None:
    (folder / "broken.urdf").write_text("<robot name='broken'><link name='a'/></robot>")
    assert inspect(["robot", "broken.urdf"]) == INPUT
    error = capsys.readouterr().err
    assert "broken.urdf" in error
    assert error.count("\n") == 1
    assert not (folder / "mine" / "robot" / "broken.yaml").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_a_key_changes_how_a_file_is_read_or_is_refused(folder: Path, capsys: Capture) -> None:
    """Also for a file whose name a bundled part has, which would win over the user's."""
    maze = folder / "maze.world"
    maze.write_text((folder / DEPOT).read_text())
    paths = f"model_paths=[{folder / 'theirs' / 'models'}]"
    for key, named in (("nonsense=3", "nonsense"), ("vehicles=fly", "world.my_maze.vehicles")):
        assert inspect(["world", str(maze), paths, key]) == INPUT
        assert named in capsys.readouterr().err
    assert inspect(["world", str(maze), paths]) == DONE
    out = capsys.readouterr().out
    assert "6 fixed, 1 movable" in out  # of the depot, not of the maze
    assert "my_maze.yaml (evoros has a world maze)" in out
    assert (folder / "mine" / "world" / "my_maze.yaml").is_file()
    assert inspect(["world", DEPOT, "--name", "maze"]) == INPUT
    assert "bundled" in capsys.readouterr().err


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["robot", "nothing.urdf"], "nothing.urdf"),
        (["robot"], "robot"),
        ([SCOUT], SCOUT),
        (["robot", SCOUT, "world", DEPOT, "laser=1"], "laser"),
        (["robot", SCOUT, "--to", "here"], "--to"),
        (["arguments.laser=true"], "robot FILE"),
    ],
)
def test_wrong_words_are_named_in_one_line(
    folder: Path, words: list[str], named: str, capsys: Capture
) -> None:
    assert inspect(words) == INPUT
    error = capsys.readouterr().err
    assert named in error
    assert error.count("\n") == 1
    assert not (folder / "mine").exists()


def world_of(folder: Path, content: str) -> str:
    """Write a world and return its file."""
    file = folder / "site.world"
    file.write_text(f"<sdf version='1.6'><world name='site'>{content}</world></sdf>")
    return str(file)


def model(name: str, pose: str, geometry: str) -> str:
    collision = f"<collision name='c'><geometry>{geometry}</geometry></collision>"
    link = f"<link name='l'>{collision}</link>"
    return f"<model name='{name}'><static>1</static><pose>{pose}</pose>{link}</model>"


def box(name: str, x: float, y: float, size: str, z: float = 0.0) -> str:
    return model(name, f"{x} {y} {z} 0 0 0", f"<box><size>{size}</size></box>")


def plane(normal: str = "0 0 1") -> str:
    return model("floor", "0 0 0 0 0 0", f"<plane><normal>{normal}</normal></plane>")


def use(output: str) -> Experiment:
    """Build the experiment of the command that is suggested, whose courses must be in order."""
    command, option, folder, *words = shlex.split(output.split("to use")[1])
    assert (command, option) == ("evoros", "--config-dir")
    experiment = compose(words, config_dir=folder).build()
    assert list(check_routes(alone(experiment))) == []
    return experiment


ORIGIN = {
    "a box": box("box", 0, 0, "1 1 1", 0.5),
    "a low table": box("table", 0, 0, "1.2 1.2 0.1", 0.7),
    "a slab": box("slab", 0, 0, "2 2 0.2", 0.1),
    "a roof": box("roof", 0, 0, "9 9 0.1", 0.25) + box("wall", 3, 3, "1 1 1", 0.5),
}


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("content", ORIGIN.values(), ids=ORIGIN)
def test_the_suggested_course_is_one_that_a_run_takes(
    folder: Path, content: str, capsys: Capture
) -> None:
    assert inspect(["world", world_of(folder, plane() + content)]) == DONE
    (world,) = use(capsys.readouterr().out).world.values()
    assert len(world.course.waypoints) >= 1


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_a_body_that_may_fall_is_not_over_the_course(folder: Path, capsys: Capture) -> None:
    falls = box("falls", 0, 0, "2 2 1", 5.0).replace("<static>1</static>", "")
    assert inspect(["world", world_of(folder, plane() + falls)]) == DONE
    (world,) = use(capsys.readouterr().out).world.values()
    stops = np.array([world.course.home[:2], *world.course.waypoints])
    assert (np.abs(stops).max(axis=1) > 1.0).all()


@pytest.mark.slow
def test_uneven_ground_is_inspected_in_an_engine_that_takes_it(
    folder: Path, capsys: Capture
) -> None:
    site = world_of(folder, plane("0.05 0 1") + box("box", 0, 0, "1 1 1", 0.5))
    assert inspect(["world", site]) == DONE
    output = capsys.readouterr().out
    assert "simulator=physics" in output.splitlines()[-1]
    use(output)
    assert "simulator=physics" in (folder / "mine/world/site.yaml").read_text().splitlines()[0]
    assert inspect(["world", site, "--name", "flat", "simulator=planar"]) == INPUT
    error = capsys.readouterr().err
    assert is_of(error, "evoros/simulator/planar.py simulator=planar")
    assert inspect(["world", site, "--name", "bullet", "simulator=pybullet"]) == DONE
    assert "simulator=pybullet" in capsys.readouterr().out.splitlines()[-1]


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_the_controller_suits_the_free_space(folder: Path, capsys: Capture) -> None:
    sides = "".join(box(f"side{y}", 0, y, "12 0.1 1", 0.5) for y in (-0.8, 0.8))
    ends = "".join(box(f"end{x}", x, 0, "0.1 1.6 1", 0.5) for x in (-6, 6))
    assert inspect(["world", world_of(folder, plane() + sides + ends)]) == DONE
    output = capsys.readouterr().out
    assert "controller=indoor" in output.splitlines()[-1]
    use(output)
    assert inspect(["world", world_of(folder, plane()), "--name", "open"]) == DONE
    assert "controller" not in capsys.readouterr().out.splitlines()[-1]


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_a_world_without_room_says_how_to_give_a_course(folder: Path, capsys: Capture) -> None:
    site = world_of(folder, plane() + box("rock", 0, 0, "200 200 3", 1.5))
    assert inspect(["world", site]) == INPUT
    lines = capsys.readouterr().err.splitlines()
    (error,) = [line for line in lines if not line.startswith("looking for a course")]
    name = Path(site).stem
    assert f"world.{name}.course.home_x_m=X" in error
    given = [
        f"world.{name}.course.home_x_m=140",
        "course.home_y_m=1",
        "course.waypoints=[[144, 1], [144, 5]]",
    ]
    assert inspect(["world", site, *given]) == DONE
    (world,) = use(capsys.readouterr().out).world.values()
    assert world.course.home == (140.0, 1.0, 0.02, 0.0)  # the first waypoint is straight ahead
    assert world.course.waypoints == ((144.0, 1.0), (144.0, 5.0))


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_a_given_home_gets_waypoints_and_wrong_values_are_refused(
    folder: Path, capsys: Capture
) -> None:
    site = world_of(folder, plane() + box("box", 0, 0, "1 1 1", 0.5))
    home = ["course.home_x_m=-2", "course.home_y_m=2.5"]
    assert inspect(["world", site, *home]) == DONE
    (world,) = use(capsys.readouterr().out).world.values()
    assert world.course.home[:2] == (-2.0, 2.5)
    for wrong in ("course.home_x_m=left", "course.waypoints=[[1, 2, 3]]", "course=here"):
        assert inspect(["world", site, "--name", "other", wrong]) == INPUT
        error = capsys.readouterr().err
        assert "world.other.course" in error
        assert error.count("\n") == 1


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_the_table_tells_what_evoros_tells_of_meshes_and_counts_radii(
    folder: Path, capsys: Capture
) -> None:
    trimesh.creation.icosphere(4, 1.0).export(folder / "ball.stl")
    ball = model("ball", "0 0 1 0 0 0", "<mesh><uri>ball.stl</uri></mesh>")
    post = "<cylinder><radius>0.5</radius><length>1</length></cylinder>"
    post = model("post", "4 0 0.5 0 0 0", post)
    assert inspect(["world", world_of(folder, plane() + ball + post)]) == DONE
    output = capsys.readouterr().out
    assert (
        "ball.stl: its convex parts cover 0 m2 (0 %) of free area and miss " in output
    )  # its hull has fewer corners
    assert "x -1.0..4.5, y -1.0..1.0" in output


def build_house(folder: Path, *inner: str) -> str:
    """Write a world of four walls of 8 m, with more boxes in it; return its name."""
    walls = [f"0 {y} 8 0.1" for y in (-4, 4)] + [f"{x} 0 0.1 8" for x in (-4, 4)]
    boxes = [box.split() for box in (*walls, *inner)]
    solids = "".join(
        f'<collision name="c{i}"><pose>{x} {y} 0.5 0 0 0</pose><geometry><box>'
        f"<size>{a} {b} 1</size></box></geometry></collision>"
        for i, (x, y, a, b) in enumerate(boxes)
    )
    content = f'<model name="m"><static>1</static><link name="l">{solids}</link></model>'
    (folder / "house.sdf").write_text(f'<sdf version="1.6"><world name="w">{content}</world></sdf>')
    return "house.sdf"


@pytest.mark.usefixtures("undrawn")
def test_a_leg_through_a_wall_is_told_and_the_fix_works_when_typed(
    folder: Path, capsys: Capture
) -> None:
    house = build_house(folder, "0 -1 0.1 6")
    home = ["course.home_x_m=-2", "course.home_y_m=0"]
    assert inspect(["world", house, *home, "course.waypoints=[[2, 0]]", "--name", "a"]) == DONE
    output = capsys.readouterr().out
    assert "the leg from (-2, 0) to (2, 0) leads through 'm::l::c4'" in output
    assert is_of(output, "evoros/session/inspection.py world.NAME.course.waypoints")
    typed = "world.b.course.waypoints=[[-2, 2]]"
    assert inspect(["world", house, *home, typed, "--name", "b"]) == DONE
    output = capsys.readouterr().out
    assert "leads through" not in output
    assert "suggested" not in output


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_a_suggestion_says_where_it_lies_and_how_to_choose_another(
    folder: Path, capsys: Capture
) -> None:
    house = build_house(folder)
    assert inspect(["world", house, "--name", "a"]) == DONE
    output = capsys.readouterr().out
    assert "course      suggested in the largest enclosed free region" in output
    assert is_of(output, "evoros/session/inspection.py world.NAME.course.home_x_m=X")
    typed = ["world.b.course.home_x_m=2", "world.b.course.home_y_m=-1"]
    assert inspect(["world", house, *typed, "--name", "b"]) == DONE
    assert "home        (2, -1) m" in capsys.readouterr().out


@pytest.mark.usefixtures("undrawn")
@pytest.mark.slow
def test_a_course_stays_on_the_floors_of_a_house_without_walls(
    folder: Path, capsys: Capture
) -> None:
    """Its rooms lie around a yard without a floor, which is as free as they are."""
    slab = "<box><size>{} {} 0.1</size></box>"
    rooms = (("a", "-4 0", "3 11"), ("b", "4 0", "3 11"), ("c", "0 -4", "5 3"))
    floors = [
        model(name, f"{at} -0.05 0 0 0", slab.format(*size.split())) for name, at, size in rooms
    ]
    post = "<cylinder><radius>0.1</radius><length>1</length></cylinder>"
    posts = [model(f"p{x}", f"{x} 6 0.5 0 0 0", post) for x in (-6, 6)]
    assert inspect(["world", world_of(folder, "".join([*floors, *posts]))]) == DONE
    (world,) = use(capsys.readouterr().out).world.values()
    route = [world.course.home[:2], *world.course.waypoints]
    for x, y in [*route, *points_between(route)]:
        assert 2.4 < abs(x) < 5.6 or y < -2.4


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_a_course_leads_among_bodies_that_are_lifted_out_of_the_ground(
    folder: Path, capsys: Capture
) -> None:
    crates = "".join(
        f"<model name='m{i}'><pose>{x} {y} -900 0 0 0</pose><link name='l'><collision name='c'>"
        f"<geometry><box><size>1 1 1</size></box></geometry></collision></link></model>"
        for i, (x, y) in enumerate(itertools.product((20, 26), (0, 6)))
    )
    content = plane() + crates
    (folder / "mine.sdf").write_text(f"<sdf version='1.6'><world name='w'>{content}</world></sdf>")
    assert inspect(["world", "mine.sdf"]) == DONE
    output = capsys.readouterr().out
    assert "suggested among the obstacles" in output
    (world,) = use(output).world.values()
    assert (np.abs(np.array(world.course.waypoints) - (23, 3)) < 8).all()


@pytest.mark.usefixtures("undrawn")
def test_a_world_in_which_nothing_can_be_met_is_told(folder: Path, capsys: Capture) -> None:
    (folder / "empty.sdf").write_text('<sdf version="1.6"><world name="w"/></sdf>')
    assert inspect(["world", "empty.sdf"]) == DONE
    output = capsys.readouterr().out
    assert "empty.sdf: no obstacle that erle_rover, 0.19 m high, can touch; give" in output
