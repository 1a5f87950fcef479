"""Includes in SDF files: where models are found, and what an include changes in them."""

import logging
from pathlib import Path

import numpy as np
import pytest
from fixture_types import Log, Patch
from hypothesis import given
from scipy.spatial.transform import Rotation
from sdf_cases import (
    COLLISION,
    LINK,
    STATIC,
    Place,
    assert_pose,
    compose,
    load,
    places,
    unhurried,
    write,
)

from evoros.base.errors import InputError

CRATE = f"<sdf version='1.7'><model name='crate'>{STATIC}{LINK}</model></sdf>"


def include(uri: str, rest: str = "", attributes: str = "") -> str:
    return f"<include {attributes}><uri>{uri}</uri>{rest}</include>"


def config(*files: tuple[str, str]) -> str:
    listed = "".join(f"<sdf version='{version}'>{name}</sdf>" for version, name in files)
    return f"<?xml version='1.0'?><model><name>crate</name>{listed}</model>"


# ---- Where models are found.


@pytest.mark.parametrize("place", ["models", "worlds/models", "worlds", "."])
def test_a_model_is_found_around_the_world(tmp_path: Path, place: str) -> None:
    write(tmp_path / place / "crate" / "model.sdf", CRATE)
    (body,) = load(tmp_path, include("model://crate")).bodies
    assert body.name == "crate"


@pytest.mark.parametrize(
    "variable", ["GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH"]
)
def test_a_model_is_found_by_the_environment(
    tmp_path: Path, variable: str, monkeypatch: Patch
) -> None:
    write(tmp_path / "far" / "crate" / "model.sdf", CRATE)
    monkeypatch.setenv(variable, f"/nowhere:{tmp_path / 'far'}")
    assert len(load(tmp_path / "here", include("model://crate")).bodies) == 1


def test_declared_folders_come_first_and_must_exist(tmp_path: Path) -> None:
    write(tmp_path / "models" / "crate" / "model.sdf", CRATE)
    write(tmp_path / "mine" / "crate" / "model.sdf", CRATE.replace("1 2 3", "4 5 6"))
    (body,) = load(tmp_path, include("model://crate"), model_paths=[f"{tmp_path}/mine"]).bodies
    assert body.shapes[0].size == (4.0, 5.0, 6.0)
    with pytest.raises(InputError, match=r"^SdfOptions\.model_paths: .*no such folder"):
        load(tmp_path, "", model_paths=[f"{tmp_path}/yours"])


def test_ros_packages_paths_and_files_are_found(tmp_path: Path) -> None:
    package = tmp_path / "src" / "shop"
    write(package / "package.xml", "<package><name>shop_world</name></package>")
    write(package / "models" / "crate" / "model.sdf", CRATE)
    world_package = tmp_path / "src" / "robot_world"
    write(world_package / "package.xml", "<package><name>robot_world</name></package>")
    addresses = [
        "package://shop_world/models/crate",
        "file://$(find shop_world)/models/crate",
        "model://shop/models/crate",
        "model://crate",
        "../../shop/models/crate",
        "../../shop/models/crate/model.sdf",
        f"file://{package}/models/crate/model.sdf",
        f"{package}/models/crate",
    ]
    bodies = load(world_package, "".join(map(include, addresses))).bodies
    assert len(bodies) == len(addresses)


def test_the_newest_file_of_a_model_config_is_read(tmp_path: Path) -> None:
    folder = tmp_path / "models" / "crate"
    write(folder / "model.config", config(("1.4", "old.sdf"), ("1.10", "new.sdf"), ("2.0", "x")))
    write(folder / "old.sdf", "<sdf")
    write(folder / "new.sdf", CRATE)
    assert len(load(tmp_path, include("model://crate")).bodies) == 1


def test_sun_and_ground_need_no_file(tmp_path: Path) -> None:
    fuel = "https://fuel.gazebosim.org/1.0/OpenRobotics/models"
    world = load(
        tmp_path,
        include("model://sun")
        + include("model://ground_plane", "<name>floor</name><pose>0 0 -1 0 0 0</pose>")
        + include(f"{fuel}/Sun")
        + include(f"{fuel}/Ground Plane"),
    )
    assert [(body.name, body.pose.position[2]) for body in world.bodies] == [
        ("floor", -1.0),
        ("ground_plane", 0.0),
    ]


# ---- Fuel.


@pytest.mark.parametrize(
    ("address", "size"),
    [
        ("https://fuel.gazebosim.org/1.0/OpenRobotics/models/Big%20Crate", 3.0),
        ("https://fuel.ignitionrobotics.org/1.0/openrobotics/models/big crate/tip", 3.0),
        ("https://fuel.gazebosim.org/OpenRobotics/models/Big Crate/2", 2.0),
        ("https://fuel.gazebosim.org/1.0/OpenRobotics/models/Big Crate/2/files/model.sdf", 2.0),
    ],
)
def test_fuel_models_come_from_the_local_cache(
    tmp_path: Path, address: str, size: float, monkeypatch: Patch
) -> None:
    cache = tmp_path / "cache"
    monkeypatch.setenv("GZ_FUEL_CACHE_PATH", str(cache))
    for version in (1, 2, 3):
        folder = cache / "fuel.gazebosim.org" / "openrobotics" / "models" / "big crate"
        write(folder / str(version) / "model.sdf", CRATE.replace("1 2 3", f"1 2 {version}"))
    (body,) = load(tmp_path, include(address)).bodies
    assert body.shapes[0].size[2] == size


def test_a_fuel_model_that_is_not_there_tells_where_and_how(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.setenv("GZ_FUEL_CACHE_PATH", str(tmp_path / "cache"))
    monkeypatch.setenv("IGN_FUEL_CACHE_PATH", str(tmp_path / "other"))
    url = "https://fuel.gazebosim.org/1.0/Me/models/Tower"
    with pytest.raises(InputError) as caught:
        load(tmp_path, include(url))
    message = str(caught.value)
    assert message.startswith("w.sdf:3: <include>")
    assert f"{tmp_path}/cache/fuel.gazebosim.org/me/models/tower" in message
    assert f'gz fuel download -u "{url}"' in message


# ---- What an include changes.


@pytest.mark.slow
@unhurried
@given(places, places, places)
def test_name_pose_and_placement_frame_of_an_include(a: Place, b: Place, c: Place) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        grip = f"<frame name='grip' attached_to='l'>{b.text()}</frame>"
        link = f"<link name='l'>{a.text()}{COLLISION}</link>"
        model = f"<model name='m'><pose>9 9 9 0 0 0</pose>{STATIC}{link}{grip}</model>"
        write(folder / "models" / "arm" / "model.sdf", f"<sdf version='1.9'>{model}</sdf>")
        rest = f"<name>mine</name>{c.text()}<placement_frame>grip</placement_frame>"
        (placed,) = load(folder, include("model://arm", rest)).bodies
        (plain,) = load(folder, include("model://arm", f"<name>mine</name>{c.text()}")).bodies
    assert placed.name == plain.name == "mine"
    frame = (np.zeros(3), Rotation.identity())
    assert_pose(plain.pose, *compose(compose(frame, c), a))
    # The frame grip, not the model's origin, is at the pose.
    assert_pose(placed.pose, *compose(compose(frame, c), _inverse(b)))


def _inverse(place: Place) -> Place:
    rotation = place.rotation.inv()
    x, y, z = (-rotation.apply(place.position)).tolist()
    roll, pitch, yaw = rotation.as_euler("xyz").tolist()
    return Place((x, y, z), (roll, pitch, yaw), "euler")


def test_static_of_an_include_has_the_last_word(tmp_path: Path) -> None:
    write(tmp_path / "models" / "crate" / "model.sdf", CRATE)
    content = "".join(
        include("model://crate", f"<name>c{flag}</name><static>{flag}</static>") for flag in (0, 1)
    )
    masses = [body.mass for body in load(tmp_path, content).bodies]
    assert masses == [1.0, None]


def test_includes_in_models_and_merged_ones(tmp_path: Path) -> None:
    write(tmp_path / "models" / "crate" / "model.sdf", CRATE.replace(STATIC, ""))
    pose = "<pose relative_to='spot'>0 0 1 0 0 0</pose>"
    spot = "<frame name='spot'><pose>5 0 0 0 0 0</pose></frame>"
    joint = "<joint name='j' type='fixed'><parent>{}</parent><child>base</child></joint>"

    def shelf(name: str, attributes: str, parent: str) -> str:
        inner = include("model://crate", f"<name>c</name>{pose}", attributes)
        base = f"<link name='base'>{COLLISION}</link>"
        return f"<model name='{name}'>{STATIC}{spot}{inner}{base}{joint.format(parent)}</model>"

    nested, merged = (
        load(tmp_path, shelf("s", attributes, parent)).bodies
        for attributes, parent in (("", "c::l"), ("merge='true'", "l"))
    )
    assert {body.name for body in nested} == {"s::c::l::c", "s::base::c"}
    assert {body.name for body in merged} == {"s::l::c", "s::base::c"}
    for bodies in (nested, merged):
        assert sorted(b.pose.position for b in bodies) == [(0.0, 0.0, 0.0), (5.0, 0.0, 1.0)]


def test_addresses_in_an_included_file_are_relative_to_it(tmp_path: Path) -> None:
    write(tmp_path / "far" / "parts" / "crate.sdf", CRATE)
    inner = include("../parts/crate.sdf", "<pose>1 0 0 0 0 0</pose>")
    model = f"<model name='set'>{STATIC}{inner}</model>"
    write(tmp_path / "far" / "set" / "model.sdf", f"<sdf version='1.7'>{model}</sdf>")
    (body,) = load(tmp_path / "here", include("../../far/set")).bodies
    assert body.pose.position == (1.0, 0.0, 0.0)


def test_a_repair_of_an_included_file_is_told_once(tmp_path: Path, caplog: Log) -> None:
    write(tmp_path / "models" / "crate" / "model.sdf", CRATE.replace("<link", "<gz:x/><link"))
    with caplog.at_level(logging.WARNING):
        names = (f"<name>c{i}</name>" for i in range(3))
        load(tmp_path, "".join(include("model://crate", name) for name in names))
    assert sum("not well-formed" in message for message in caplog.messages) == 1


def test_models_of_one_name_are_numbered_and_told(tmp_path: Path, caplog: Log) -> None:
    write(tmp_path / "models" / "crate" / "model.sdf", CRATE)
    with caplog.at_level(logging.WARNING):
        world = load(tmp_path, include("model://crate") * 3)
    assert [body.name for body in world.bodies] == ["crate", "crate_0", "crate_1"]
    (message,) = caplog.messages
    assert "'crate_0'" in message
    assert "1 more" in message


def test_a_joint_may_have_the_name_of_a_link_as_in_old_files(tmp_path: Path, caplog: Log) -> None:
    link = "<link name='{}'><collision name='c'><geometry><sphere><radius>1</radius></sphere>"
    ends = "<parent>frame</parent><child>door</child>"
    for joint_first in (True, False):
        joint = f"<joint name='door' type='fixed'>{ends}</joint>"
        links = "".join(
            f"{link.format(name)}</geometry></collision></link>" for name in ("frame", "door")
        )
        parts = joint + links if joint_first else links + joint
        caplog.clear()
        world = load(tmp_path, f"<model name='m'>{parts}</model>")
        assert [len(body.shapes) for body in world.bodies] == [2]
        assert "and is renamed to 'door_joint'" in caplog.text


# ---- What is wrong.


def test_an_error_in_an_included_file_names_that_file_and_line(tmp_path: Path) -> None:
    bad = CRATE.replace("<link", "\n\n<link").replace("1 2 3", "1 2")
    file = write(tmp_path / "models" / "crate" / "model.sdf", bad)
    write(tmp_path / "models" / "bad" / "model.sdf", "<sdf version='1.7'>\n<state/></sdf>")
    with pytest.raises(InputError, match=r"bad/model\.sdf:1: <sdf> must contain a <model>"):
        load(tmp_path, include("model://bad"))
    with pytest.raises(InputError, match="must have 3 numbers") as caught:
        load(tmp_path, include("model://crate", "<name>c</name>"))
    assert str(caught.value).startswith(f"{file}:3: <size>")
    # The pose is that of the world's file.
    write(file, CRATE)
    with pytest.raises(InputError, match=r"^w\.sdf:3: <pose>"):
        load(tmp_path, include("model://crate", "<pose>0 0</pose>"))


def test_an_include_of_itself_is_an_error_with_its_way(tmp_path: Path) -> None:
    for name, other in (("a", "b"), ("b", "a")):
        model = f"<model name='m'>{include(f'model://{other}')}</model>"
        write(tmp_path / "models" / name / "model.sdf", f"<sdf version='1.7'>{model}</sdf>")
    with pytest.raises(InputError, match=r"includes itself: .*a/model.sdf -> .*b/model.sdf -> "):
        load(tmp_path, include("model://a"))


@pytest.mark.parametrize(
    ("uri", "says"),
    [
        ("model://tower", "add the folder that holds tower to GZ_SIM_RESOURCE_PATH"),
        ("tower.sdf", "correct the path"),
        ("https://example.org/tower.sdf", "download https"),
        ("model://empty", "nor a model.config"),
    ],
)
def test_a_missing_model_is_an_error_with_a_fix_unless_left_out(
    tmp_path: Path, uri: str, says: str, caplog: Log
) -> None:
    (tmp_path / "models" / "empty").mkdir(parents=True)
    with pytest.raises(InputError, match=says) as caught:
        load(tmp_path, include(uri))
    assert str(caught.value).startswith("w.sdf:3: <include>")
    with caplog.at_level(logging.WARNING):
        assert load(tmp_path, include(uri), missing="leave_out").bodies == ()
    assert "left out" in caplog.text


def test_robots_and_further_models_of_a_file_are_left_out_and_told(
    tmp_path: Path, caplog: Log
) -> None:
    write(tmp_path / "robot.urdf", "<robot name='r'/>")
    two = CRATE.replace("</sdf>", f"<model name='other'>{STATIC}{LINK}</model></sdf>")
    write(tmp_path / "two.sdf", two)
    with caplog.at_level(logging.WARNING):
        world = load(tmp_path, include("../robot.urdf") + include("../two.sdf"))
    assert [body.name for body in world.bodies] == ["crate"]
    assert any("URDF" in message for message in caplog.messages)
    assert any("'other'" in message for message in caplog.messages)


def test_an_included_actor_is_an_actor_of_the_world(tmp_path: Path, caplog: Log) -> None:
    pose = "<pose>1 2 0 0 0 0</pose>"
    write(tmp_path / "walker.sdf", f"<sdf version='1.7'><actor name='a'>{pose}</actor></sdf>")
    with caplog.at_level(logging.WARNING, "evoros.sdf"):
        world = load(tmp_path, include("../walker.sdf"))
    (actor,) = world.actors
    assert (actor.name, actor.points) == ("a", ((1.0, 2.0, 0.0),))
    assert world.bodies == ()
    (message,) = caplog.messages
    assert "walker.sdf" in message


def test_the_hash_covers_included_files(tmp_path: Path) -> None:
    file = write(tmp_path / "models" / "crate" / "model.sdf", CRATE)
    before = load(tmp_path, include("model://crate")).sha256
    assert load(tmp_path, include("model://crate")).sha256 == before
    write(file, CRATE + "\n")
    assert load(tmp_path, include("model://crate")).sha256 != before
