"""Mesh files become convex shapes in metres, with z up; each faulty file gives one clear line."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from evoros.base.errors import InputError
from evoros.formats.mesh import hull_of, read_mesh
from evoros.geometry.shapes import Shape

DAE = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="centimeter" meter="0.01"/><up_axis>{up}</up_axis></asset>
  <library_geometries>
    <geometry id="wedge-mesh" name="wedge">
      <mesh>
        <source id="positions">
          <float_array id="values" count="12">0 0 0 100 0 0 0 200 0 0 0 300</float_array>
          <technique_common><accessor source="#values" count="4" stride="3"/></technique_common>
        </source>
        <vertices id="points"><input semantic="POSITION" source="#positions"/></vertices>
        <triangles count="4" material="painted">
          <input semantic="VERTEX" source="#points" offset="0"/>
          <input semantic="NORMAL" source="#absent" offset="1"/>
          <p>0 0 2 0 1 0  0 0 1 0 3 0  0 0 3 0 2 0  1 0 2 0 3 0</p>
        </triangles>
      </mesh>
    </geometry>
  </library_geometries>
  <library_visual_scenes>
    <visual_scene id="scene">
      <node id="a" name="left">
        <translate>500 0 0</translate>
        <instance_geometry url="#wedge-mesh"/>
      </node>
      <node id="b" name="right">
        <rotate>0 0 1 90</rotate><scale>2 2 2</scale>
        <instance_geometry url="#wedge-mesh"/>
      </node>
    </visual_scene>
  </library_visual_scenes>
  <scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>
"""
TWO_BOXES = """mtllib absent.mtl
o left
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
v 1 1 1
v 0 1 1
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
o right
usemtl paint
v 3 0 0
v 5 0 0
v 3 1 0
v 3 0 1
f 9 11 10
f 9 10 12
f 9 12 11
f 10 11 12
"""


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def bounds(*shapes: Shape) -> list[list[float]]:
    corners = np.concatenate([shape.corners for shape in shapes])
    return [corners.min(axis=0).round(9).tolist(), corners.max(axis=0).round(9).tolist()]


def refused(path: Path, submesh: str = "") -> str:
    with pytest.raises(InputError) as caught:
        read_mesh(path, submesh=submesh)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert ";" in message  # the fix
    return message


@pytest.mark.parametrize("file_type", ["stl", "stl_ascii"])
def test_an_stl_is_read_in_metres_and_scaled(tmp_path: Path, file_type: str) -> None:
    path = tmp_path / "box.STL"
    trimesh.creation.box((1.0, 2.0, 4.0)).export(path, file_type=file_type)
    [shape] = read_mesh(path, (0.1, 1.0, -0.5))
    assert shape.kind == "convex"
    assert len(shape.corners) == 8
    assert bounds(shape) == [[-0.05, -1.0, -1.0], [0.05, 1.0, 1.0]]


def test_an_obj_is_read_without_its_materials(tmp_path: Path) -> None:
    path = write(tmp_path / "boxes.obj", TWO_BOXES)
    assert bounds(*read_mesh(path)) == [[0, 0, 0], [5, 1, 1]]
    assert [len(shape.corners) for shape in read_mesh(path)] == [8, 4]


def test_a_submesh_is_read_alone_and_centred(tmp_path: Path) -> None:
    path = write(tmp_path / "boxes.obj", TWO_BOXES)
    assert bounds(*read_mesh(path, submesh="right")) == [[3, 0, 0], [5, 1, 1]]
    assert bounds(*read_mesh(path, submesh="right", center=True)) == [
        [-1, -0.5, -0.5],
        [1, 0.5, 0.5],
    ]
    assert "right, left" in refused(path, "middle")


def test_a_dae_has_a_unit_and_poses(tmp_path: Path) -> None:
    path = write(tmp_path / "wedges.dae", DAE.format(up="Z_UP"))
    assert bounds(*read_mesh(path, submesh="left")) == [[5, 0, 0], [6, 2, 3]]
    assert bounds(*read_mesh(path, submesh="right")) == [[-4, 0, 0], [0, 2, 6]]
    assert bounds(*read_mesh(path, submesh="wedge")) == bounds(*read_mesh(path))


@pytest.mark.parametrize(
    ("up", "low", "high"),
    [("Y_UP", [5, -3, 0], [6, 0, 2]), ("X_UP", [-2, 5, 0], [0, 6, 3])],
)
def test_the_up_axis_of_a_dae_becomes_z(
    tmp_path: Path, up: str, low: list[float], high: list[float]
) -> None:
    path = write(tmp_path / "wedges.dae", DAE.format(up=up))
    assert bounds(*read_mesh(path, submesh="left")) == [low, high]


def test_the_hull_of_several_shapes_is_one_shape(tmp_path: Path) -> None:
    hull = hull_of(read_mesh(write(tmp_path / "boxes.obj", TWO_BOXES)))
    assert hull.kind == "convex"
    assert bounds(hull) == [[0, 0, 0], [5, 1, 1]]


def test_a_faulty_file_is_one_line_with_a_fix(tmp_path: Path) -> None:
    folder = tmp_path / "folder.stl"
    folder.mkdir()
    assert "no such file" in refused(tmp_path / "absent.stl")
    assert ".stl, .obj, .dae" in refused(write(tmp_path / "mesh.blend", "x"))
    assert "readable" in refused(folder)
    assert "face" in refused(write(tmp_path / "points.obj", "v 0 0 0\n"))
    assert "COLLADA" in refused(write(tmp_path / "cut.dae", DAE[:700]))
    assert "COLLADA" in refused(
        write(tmp_path / "lost.dae", DAE.replace('"#positions"', '"#gone"'))
    )
    assert "finite" in refused(
        write(tmp_path / "nan.obj", TWO_BOXES.replace("v 5 0 0", "v nan 0 0"))
    )
