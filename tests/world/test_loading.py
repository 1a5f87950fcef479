"""Worlds as others wrote them, loaded from files: xacro, several worlds, gravity, floors."""

import logging
from pathlib import Path

import numpy as np
import pytest
from fixture_types import Log
from sdf_cases import LINK, STATIC, write
from world_cases import square

from evoros.base.errors import InputError
from evoros.geometry.footprint import bottom_height, top_height
from evoros.world.loading import load_world

WALL = f"<model name='wall'>{STATIC}<pose>2 2 0 0 0 0</pose>{LINK}</model>"
PLANE = (
    "<model name='ground'><static>1</static><link name='l'><collision name='c'><geometry><plane/>"
    "</geometry></collision></link></model>"
)
XACRO = f"""<?xml version="1.0"?>
<sdf version="1.6" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="height" default="2"/>
<xacro:property name="walls" value="3"/>
<xacro:macro name="wall" params="i">
  <model name="wall_${{i}}">{STATIC}<pose>${{2 + i}} 2 0 0 0 0</pose><link name="l">
  <collision name="c"><geometry><box><size>0.1 1 $(arg height)</size></box></geometry></collision>
  </link></model>
</xacro:macro>
<world name="w">{PLANE}<xacro:wall i="0"/><xacro:wall i="1"/></world></sdf>"""


def test_a_world_of_xacro_is_expanded_with_its_arguments(tmp_path: Path) -> None:
    for name in ("rooms.world.xacro", "rooms.world"):  # by its suffix, or by what it declares
        file = write(tmp_path / name, XACRO)
        world = load_world(str(file), square(), arguments={"height": 3.5})
        assert world.name == "rooms"
        assert [body.name for body in world.obstacles] == ["wall_0", "wall_1"]
        assert world.obstacles[1].shapes[0].size == (0.1, 1.0, 3.5)
        assert world.obstacles[1].pose.position == (3.0, 2.0, 0.0)
    with pytest.raises(InputError, match="the arguments are height"):
        load_world(str(file), square(), arguments={"width": 3.5})


def test_arguments_of_a_plain_world_are_an_error(tmp_path: Path) -> None:
    file = write(tmp_path / "w.sdf", f"<sdf version='1.6'>{WALL}</sdf>")
    with pytest.raises(InputError, match="cannot be used"):
        load_world(str(file), square(), arguments={"height": 1})


def test_xacro_in_an_included_file_asks_to_be_expanded(tmp_path: Path) -> None:
    model = f"<model name='m'>{LINK}<xacro:wall i='0'/></model>"
    write(tmp_path / "m" / "model.sdf", f"<sdf version='1.6'>{model}</sdf>")
    include = "<include><uri>model://m</uri></include>"
    file = write(tmp_path / "w.sdf", f"<sdf version='1.6'><world name='w'>{include}</world></sdf>")
    with pytest.raises(InputError, match=r"m/model\.sdf:1: .*expand the file with xacro"):
        load_world(str(file), square())


def test_one_of_several_worlds_is_chosen_by_name(tmp_path: Path) -> None:
    worlds = "".join(
        f"<world name='{name}'>{PLANE}{WALL.replace('wall', name)}</world>" for name in "ab"
    )
    file = write(tmp_path / "w.sdf", f"<sdf version='1.6'>{worlds}</sdf>")
    world = load_world(str(file), square(), world_name="b")
    assert [body.name for body in world.obstacles] == ["b"]
    with pytest.raises(
        InputError, match=r"type world\.NAME\.world_name=WORLD, where WORLD is one of: 'a', 'b'"
    ):
        load_world(str(file), square())
    with pytest.raises(
        InputError, match=r"no world 'c'; type world.NAME.world_name=WORLD, where .*: 'a', 'b'"
    ):
        load_world(str(file), square(), world_name="c")


@pytest.mark.parametrize(
    "text",
    [
        f"<gazebo version='1.3'><world name='w'>{PLANE}{WALL}</world></gazebo>",
        f"<!-- by hand -->\n<?xml version='1.0'?>\n<sdf version='1.5'>{PLANE}{WALL}</sdf>",
        f"<sdf version='1.12'><world name='w'><!-- a -- b --><gz:x/>{PLANE}{WALL}</world></sdf>",
        f"<sdf version='1.2'><world name='w'>{PLANE}{WALL}</world><model name='other'/></sdf>",
    ],
)
def test_files_are_read_as_gazebo_reads_them(tmp_path: Path, text: str) -> None:
    world = load_world(str(write(tmp_path / "w.world", text)), square())
    assert [body.name for body in world.obstacles] == ["wall"]


def test_a_world_has_its_own_gravity(tmp_path: Path) -> None:
    for place in ("{}", "<physics type='ode'>{}</physics>"):
        gravity = place.format("<gravity>0 0 -1.62</gravity>")
        text = f"<sdf version='1.6'><world name='moon'>{gravity}{PLANE}{WALL}</world></sdf>"
        assert load_world(str(write(tmp_path / "m.sdf", text)), square()).gravity_mps2 == 1.62
    assert load_world("maze.sdf", square()).gravity_mps2 == 9.81


def test_an_indoor_world_on_a_slab_is_driven_on(tmp_path: Path, caplog: Log) -> None:
    def box(name: str, pose: str, size: str) -> str:
        return (
            f"<model name='{name}'><static>1</static><pose>{pose} 0 0 0</pose><link name='l'>"
            f"<collision name='c'><geometry><box><size>{size}</size></box></geometry></collision>"
            "</link></model>"
        )

    models = (
        box("slab", "0 0 0.1", "14 14 0.2")
        + box("wall", "0 7 1.2", "14 0.2 2")
        + box("mat", "3 3 0.205", "1 1 0.01")
    )
    text = f"<sdf version='1.6'><world name='w'>{models}</world></sdf>"
    with caplog.at_level(logging.WARNING):
        world = load_world(str(write(tmp_path / "house.sdf", text)), square())
    assert {body.name: body.floor for body in world.bodies} == {
        "slab": True,
        "wall": False,
        "mat": True,
    }
    assert world.is_level
    assert world.obstacles[0].pose.position == pytest.approx((0.0, 7.0, 1.0))
    assert "moved the world by -0.2 m" in caplog.text


def test_meshes_are_turned_as_their_up_axis_says_if_asked(tmp_path: Path) -> None:
    import trimesh

    mast = trimesh.creation.box((0.2, 3.0, 0.4))
    corners = " ".join(f"{x:g}" for x in np.ravel(mast.vertices))
    faces = " ".join(str(i) for i in np.ravel(mast.faces))
    write(
        tmp_path / "mast.dae",
        "<COLLADA version='1.4.1'><asset><up_axis>Y_UP</up_axis></asset><library_geometries>"
        f"<geometry id='g'><mesh><source id='s'><float_array id='f' count='24'>{corners}"
        "</float_array><technique_common><accessor source='#f' count='8' stride='3'/>"
        "</technique_common></source><vertices id='v'><input semantic='POSITION' source='#s'/>"
        "</vertices><triangles count='12'><input semantic='VERTEX' source='#v' offset='0'/>"
        f"<p>{faces}</p></triangles></mesh></geometry></library_geometries></COLLADA>",
    )
    model = (
        "<model name='mast'><static>1</static><pose>3 3 2 0 0 0</pose><link name='l'>"
        "<collision name='c'><geometry><mesh><uri>mast.dae</uri></mesh></geometry></collision>"
        "</link></model>"
    )
    text = f"<sdf version='1.6'><world name='w'>{PLANE}{model}</world></sdf>"
    path = str(write(tmp_path / "w.sdf", text))
    for key, height in (("ignore", 0.4), ("apply", 3.0)):
        (body,) = load_world(path, square(), mesh_up_axis=key).obstacles
        ends = [end(body.shapes[0], body.pose) for end in (bottom_height, top_height)]
        assert ends == pytest.approx([2 - height / 2, 2 + height / 2])


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("missing", "ignore"),
        ("vehicles", "drive"),
        ("mesh_up_axis", "y"),
        ("model_paths", ["/nowhere"]),
    ],
)
def test_a_wrong_choice_is_an_error_with_the_choices(key: str, value: object) -> None:
    with pytest.raises(InputError, match=key):
        load_world("maze.sdf", square(), **{key: value})  # type: ignore[arg-type]
