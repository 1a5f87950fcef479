"""Absent files: all in one message, or left out and told; odd names, and files not fetched."""

import logging
import struct
from collections.abc import Callable
from pathlib import Path

import pytest
from fixture_types import Folders, Log
from hypothesis import given, settings
from hypothesis import strategies as st
from proposal_sites import is_of, list_alternatives
from sdf_cases import STATIC, load, unhurried, write

from evoros.base.errors import InputError
from evoros.drive.automatic import AutomaticDescription
from evoros.formats.mesh_files import read_content
from evoros.formats.sdf import geometry
from evoros.formats.sdf.heightmaps import is_geotiff
from evoros.formats.sdf.reading import SdfOptions
from evoros.robot.loading import load_robot
from evoros.session.design_tables import read_rows
from evoros.world.loading import read_world

CUBE = """solid c
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 0 1
endloop
endfacet
endsolid c
"""


def shape(geometry: str, name: str = "m") -> str:
    collision = f"<collision name='c'><geometry>{geometry}</geometry></collision>"
    return f"<model name='{name}'>{STATIC}<link name='l'>{collision}</link></model>"


def mesh(uri: str, name: str = "m") -> str:
    return shape(f"<mesh><uri>{uri}</uri></mesh>", name)


def ground(uri: str) -> str:
    return shape(f"<heightmap><uri>{uri}</uri></heightmap>", "ground")


@pytest.mark.slow
@given(st.sets(st.sampled_from("abcdef"), min_size=1), st.sets(st.sampled_from("ghijkl")))
@settings(unhurried, max_examples=15)
def test_all_that_is_absent_is_named_at_once_before_a_mesh_is_read(
    tmp_path_factory: Folders, models: set[str], meshes: set[str]
) -> None:
    folder = tmp_path_factory.mktemp("world")
    write(folder / "worlds" / "sound.stl", CUBE)
    content = mesh("sound.stl", "first")
    content += "".join(f"<include><uri>model://no_{name}</uri></include>" for name in models)
    content += "".join(mesh(f"model://no_{name}/x.dae", name) for name in meshes)
    content += ground("no_hills.png")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(geometry, "read_mesh", lambda *_: pytest.fail("a mesh was read"))
        with pytest.raises(InputError) as caught:
            load(folder, content)
    message = str(caught.value)
    assert all(f"model://no_{name}" in message for name in models | meshes)
    assert "no_hills.png" in message
    assert "missing=leave_out" in message
    assert message.startswith(f"w.sdf: refers to {len(models) + len(meshes) + 1} missing items")


def test_a_line_and_a_count_stand_beside_each_name(tmp_path: Path) -> None:
    twice = mesh("model://tower/t.dae") + "\n" + mesh("model://tower/t.dae", "n")
    fuel = "https://fuel.gazebosim.org/1.0/o/models/Hut"
    text = f"{twice}\n<include><uri>{fuel}</uri></include><include><uri>{fuel}2</uri></include>"
    with pytest.raises(InputError) as caught:
        load(tmp_path, text)
    message = str(caught.value)
    assert "model://tower/t.dae (line 3, 2 times)" in message
    assert f"{fuel} (line 5)" in message
    assert "add the folder that holds tower to GZ_SIM_RESOURCE_PATH" in message
    assert f'gz fuel download -u "{fuel}" && gz fuel download -u "{fuel}2"' in message
    assert is_of(message, "evoros/formats/sdf/inclusion.py world.NAME.missing=leave_out")
    for (typed,) in list_alternatives(message.rpartition("; ")[2], {"world.NAME.": ""}):
        assert load(tmp_path, text, missing=typed.partition("=")[2]).bodies == ()


@pytest.mark.parametrize("missing", ["leave_out", "box"])
def test_absent_models_meshes_and_images_are_left_out_in_a_line_for_each_kind(
    tmp_path: Path, missing: str, caplog: Log
) -> None:
    names = [f"model://no_{letter}" for letter in "abcdef"]
    content = "".join(f"<include><uri>{name}</uri></include>" for name in names)
    content += "".join(mesh(f"{name}/x.dae", name[-1]) for name in names) + ground("hills.png")
    with caplog.at_level(logging.DEBUG):
        assert load(tmp_path, content, missing=missing).bodies == ()
    warnings = [r.getMessage() for r in caplog.records if r.levelno >= logging.WARNING]
    assert len(warnings) == 2
    others = "model://no_b, model://no_c, model://no_d and 2 others"
    assert f"5 more of this kind: {others}" in warnings[0]
    assert "6 more of this kind: 'b', 'c', 'd' and 3 others" in warnings[1]
    details = [r.getMessage() for r in caplog.records if r.levelno == logging.DEBUG]
    assert all(any(name in line for line in details) for name in names)


def test_joints_to_an_absent_model_are_left_out_and_told(tmp_path: Path, caplog: Log) -> None:
    box = "<collision name='c'><geometry><sphere><radius>1</radius></sphere></geometry></collision>"
    links = "".join(f"<link name='{name}'>{box}</link>" for name in "ab")
    joints = "".join(
        f"<joint name='{parent}{child}' type='fixed'><parent>{parent}</parent>"
        f"<child>{child}</child></joint>"
        for parent, child in (("a", "b"), ("gimbal::tilt", "a"))
    )
    include = "<include><uri>model://gimbal</uri></include>"
    content = f"<model name='m'>{links}{include}{joints}</model>"
    with caplog.at_level(logging.WARNING):
        (body,) = load(tmp_path, content, missing="leave_out").bodies
    assert len(body.shapes) == 2  # the joint between the links that are there still counts
    assert "it connects gimbal::tilt and a" in caplog.text
    with pytest.raises(InputError, match="refers to 'gimbal::tilt'"):  # nothing is absent
        load(tmp_path, content.replace(include, ""), missing="leave_out")


@pytest.mark.parametrize("uri", ["model://Crate/Meshes/box.STL", "../models/crate/meshes/BOX.stl"])
def test_letter_case_of_a_name_does_not_matter_and_is_told(
    tmp_path: Path, uri: str, caplog: Log
) -> None:
    write(tmp_path / "models" / "crate" / "meshes" / "Box.stl", CUBE)
    with caplog.at_level(logging.WARNING):
        assert len(load(tmp_path, mesh(uri)).bodies) == 1
    assert "(upper and lower case differ)" in caplog.text
    write(tmp_path / "models" / "crate" / "meshes" / "bOX.stl", CUBE)
    with pytest.raises(InputError):  # which of the two?
        load(tmp_path, mesh(uri))


def test_the_exact_name_comes_before_another_case_of_letters(tmp_path: Path) -> None:
    write(tmp_path / "worlds" / "BOX.stl", CUBE)
    write(tmp_path / "models" / "box.stl", CUBE.replace("1 0 0", "2 0 0"))
    (body,) = load(tmp_path, mesh("box.stl"), model_paths=(str(tmp_path / "models"),)).bodies
    assert max(x for x, _, _ in body.shapes[0].corners) > 1.5


def test_install_rules_say_where_a_package_has_its_files(tmp_path: Path) -> None:
    package = tmp_path / "worlds" / "src" / "depot"
    write(package / "package.xml", "<package><name>depot_world</name></package>")
    write(
        package / "CMakeLists.txt",
        "project(depot_world)\n# install(DIRECTORY no DESTINATION share/depot_world)\n"
        'install(\n  DIRECTORY data/meshes "other/"\n  DESTINATION share/${PROJECT_NAME}/things\n'
        "  PATTERN x EXCLUDE)\ninstall(FILES flat/one.stl DESTINATION share/depot_world)\n",
    )
    for place in ("data/meshes/a/box.stl", "other/two.stl", "flat/one.stl", "hidden/no.stl"):
        write(package / place, CUBE)
    folders = (str(package.parent),)
    for name in ("things/meshes/a/box.stl", "things/two.stl", "one.stl"):
        uri = f"package://depot_world/{name}"
        assert len(load(tmp_path, mesh(uri), model_paths=folders).bodies) == 1
    for name in ("things/no.stl", "meshes/a/box.stl"):
        with pytest.raises(InputError, match="depot_world"):
            load(tmp_path, mesh(f"package://depot_world/{name}"), model_paths=folders)


def test_a_mesh_of_no_size_is_left_out_as_nothing_can_touch_it(tmp_path: Path, caplog: Log) -> None:
    write(tmp_path / "worlds" / "box.stl", CUBE)
    flat = shape("<mesh><uri>box.stl</uri><scale>1 0 1</scale></mesh>")
    assert load(tmp_path, flat).bodies == ()
    assert "w.sdf:3: <mesh>" in caplog.text
    assert "is left out: a mesh with a scale of 0" in caplog.text


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_geotiff_is_told_as_such(tmp_path: Path, order: str) -> None:
    head = {"<": b"II*\0", ">": b"MM\0*"}[order] + struct.pack(f"{order}I", 8)
    tags = struct.pack(f"{order}HHHIIHHII", 2, 256, 3, 1, 9, 33550, 12, 3, 0)
    file = tmp_path / "worlds" / "dem.tif"
    file.parent.mkdir()
    file.write_bytes(head + tags)
    with pytest.raises(InputError, match=r"GeoTIFF.*gdal_translate .*dem\.tif dem\.png"):
        load(tmp_path, ground("dem.tif"))
    assert load(tmp_path, ground("dem.tif"), missing="leave_out").bodies == ()
    plain = head + tags.replace(struct.pack(f"{order}H", 33550), struct.pack(f"{order}H", 258))
    assert not is_geotiff(plain)


@given(st.binary(max_size=40))
def test_any_content_is_a_geotiff_or_not(content: bytes) -> None:
    assert is_geotiff(b"II*\0" + content) in (True, False)


def test_what_is_no_image_is_told_with_its_name(tmp_path: Path) -> None:
    write(tmp_path / "worlds" / "hills.png", "no image")
    with pytest.raises(InputError, match=r"hills\.png has no known format") as caught:
        load(tmp_path, ground("hills.png"))
    assert "BytesIO" not in str(caught.value)


POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"
CONTENT = {
    POINTER: "is only a Git LFS pointer; to download the file, type: git lfs pull",
    "\n<!DOCTYPE html>\n<html><body>404</body></html>\n": "is a web page, not the file",
}
READERS: dict[str, Callable[[Path], object]] = {
    "r.urdf": lambda file: load_robot(str(file), AutomaticDescription()),
    "r.xacro": lambda file: load_robot(str(file), AutomaticDescription()),
    "w.sdf": lambda file: read_world(str(file), SdfOptions(), {}),
    "d.csv": lambda file: list(read_rows(file, ["design"], [])),
    "m.stl": read_content,
    "m.dae": read_content,
}


@pytest.mark.parametrize("content", CONTENT, ids=["pointer", "page"])
@pytest.mark.parametrize("name", READERS)
def test_what_stands_in_place_of_a_file_is_named(name: str, content: str, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_text(content)
    with pytest.raises(InputError) as caught:
        READERS[name](file)
    assert f"{file}: {CONTENT[content]}" in str(caught.value)
