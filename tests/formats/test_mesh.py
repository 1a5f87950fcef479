"""Mesh files become convex shapes in metres, with z up; each faulty file gives one clear line."""

import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
import trimesh
from fixture_types import Capture, Patch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mesh_cases import DAE, TWO_BOXES
from PIL import Image

from evoros.base.errors import InputError
from evoros.formats import mesh, mesh_files
from evoros.formats.mesh import hull_of, read_mesh
from evoros.formats.mesh_files import read_faces
from evoros.geometry import mesh_parts
from evoros.geometry.shapes import MeshFile, Shape


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: Patch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    mesh._read.cache_clear()
    return tmp_path / "cache" / "evoros" / "meshes"


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def read(path: Path, *arguments: Any, **keys: Any) -> tuple[Shape, ...]:
    return read_mesh(MeshFile(path, *arguments, **keys)).shapes


def bounds(*shapes: Shape) -> list[list[float]]:
    corners = np.concatenate([shape.corners for shape in shapes])
    return [corners.min(axis=0).round(9).tolist(), corners.max(axis=0).round(9).tolist()]


def refused(path: Path, submesh: str = "") -> str:
    with pytest.raises(InputError) as caught:
        read(path, submesh=submesh)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert ";" in message  # the fix
    return message


@pytest.mark.parametrize("file_type", ["stl", "stl_ascii"])
def test_an_stl_is_read_in_metres_and_scaled(tmp_path: Path, file_type: str) -> None:
    path = tmp_path / "box.STL"
    trimesh.creation.box((1.0, 2.0, 4.0)).export(path, file_type=file_type)
    [shape] = read(path, (0.1, 1.0, -0.5))
    assert shape.kind == "convex"
    assert len(shape.corners) == 8
    assert bounds(shape) == [[-0.05, -1.0, -1.0], [0.05, 1.0, 1.0]]


def test_an_obj_is_read_without_its_materials(tmp_path: Path) -> None:
    path = write(tmp_path / "boxes.obj", TWO_BOXES)
    assert bounds(*read(path)) == [[0, 0, 0], [5, 1, 1]]
    assert sorted(len(shape.corners) for shape in read(path)) == [4, 8]


def test_a_submesh_is_read_alone_and_centred(tmp_path: Path) -> None:
    path = write(tmp_path / "boxes.obj", TWO_BOXES)
    assert bounds(*read(path, submesh="right")) == [[3, 0, 0], [5, 1, 1]]
    assert bounds(*read(path, submesh="right", center=True)) == [[-1, -0.5, -0.5], [1, 0.5, 0.5]]
    assert "right, left" in refused(path, "middle")


def test_a_submesh_of_an_obj_may_be_a_group(tmp_path: Path) -> None:
    path = write(tmp_path / "boxes.obj", TWO_BOXES.replace("usemtl paint", "g corner"))
    assert bounds(*read(path, submesh="corner")) == [[3, 0, 0], [5, 1, 1]]


def test_a_dae_has_a_unit_and_poses(tmp_path: Path) -> None:
    path = write(tmp_path / "wedges.dae", DAE.format(up="Z_UP"))
    assert bounds(*read(path, submesh="left")) == [[5, 0, 0], [6, 2, 3]]
    assert bounds(*read(path, submesh="right")) == [[-4, 0, 0], [0, 2, 6]]
    assert bounds(*read(path, submesh="wedge")) == bounds(*read(path))


@pytest.mark.parametrize("up", ["X_UP", "Y_UP", "Z_UP"])
def test_the_coordinates_of_a_dae_have_z_up_whatever_it_says(tmp_path: Path, up: str) -> None:
    path = write(tmp_path / "wedges.dae", DAE.format(up=up))
    mesh = read_mesh(MeshFile(path, submesh="left"))
    assert bounds(*mesh.shapes) == [[5, 0, 0], [6, 2, 3]]
    assert [f"up axis {up} is ignored" in note for note in mesh.notes] == [True] * (up != "Z_UP")


@pytest.mark.parametrize(
    ("up", "turned"),
    [
        ("X_UP", [[-2, -3, 5], [0, 0, 6]]),
        ("Y_UP", [[5, -3, 0], [6, 0, 2]]),
        ("Z_UP", [[5, 0, 0], [6, 2, 3]]),
    ],
)
def test_a_dae_is_turned_as_its_up_axis_says_if_asked(
    tmp_path: Path, up: str, turned: list[list[int]]
) -> None:
    """COLLADA: Y_UP has x to the right and -z ahead; X_UP has -y to the right and -z ahead."""
    path = write(tmp_path / "wedges.dae", DAE.format(up=up))
    assert bounds(*read(path, submesh="left", up_axis=True)) == turned


def test_a_dae_with_a_slip_in_a_name_is_read(tmp_path: Path) -> None:
    text = DAE.format(up="Z_UP").replace('name="left"', 'name="<STL & BINARY>"')
    assert bounds(*read(write(tmp_path / "wedges.dae", text), submesh="a")) == [
        [5, 0, 0],
        [6, 2, 3],
    ]


def test_the_hull_of_several_shapes_is_one_shape(tmp_path: Path) -> None:
    hull = hull_of(read(write(tmp_path / "boxes.obj", TWO_BOXES)))
    assert hull.kind == "convex"
    assert bounds(hull) == [[0, 0, 0], [5, 1, 1]]


def test_a_faulty_file_is_one_line_with_a_fix(tmp_path: Path) -> None:
    folder = tmp_path / "folder.stl"
    folder.mkdir()
    assert "no such file" in refused(tmp_path / "absent.stl")
    assert ".stl, .obj, .dae" in refused(write(tmp_path / "mesh.blend", "x"))
    assert "a folder, not a file; give the path of a file" in refused(folder)
    assert "face" in refused(write(tmp_path / "points.obj", "v 0 0 0\n"))
    assert "COLLADA" in refused(
        write(tmp_path / "lost.dae", DAE.replace('"#positions"', '"#gone"'))
    )
    for semantic in ("VERTEX", "POSITION"):
        text = DAE.replace(f'semantic="{semantic}"', 'semantic="COLOR"')
        assert f"no <input> with semantic {semantic}" in refused(
            write(tmp_path / "input.dae", text)
        )
    long = DAE.replace("#wedge-mesh", f"#{'w' * 5000}").replace('"12"', '"1"')
    assert len(refused(write(tmp_path / "long.dae", long))) < 1000
    huge = DAE.replace("<p>0 0 2", f"<p>{'9' * 40} 0 2")
    assert "COLLADA" in refused(write(tmp_path / "huge.dae", huge))
    flat = TWO_BOXES.replace(" 0\n", "\n").replace(" 1\n", "\n")
    assert "three coordinates per corner" in refused(write(tmp_path / "flat.obj", flat))
    assert "finite" in refused(
        write(tmp_path / "nan.obj", TWO_BOXES.replace("v 5 0 0", "v nan 0 0"))
    )


BOX = trimesh.creation.box((1.0, 2.0, 3.0))
CUTS = {"wedge.dae": DAE, "box.stl": "stl_ascii", "binary.stl": "stl"}


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(sorted(CUTS)), st.floats(0.3, 0.9))
def test_a_file_that_is_cut_off_is_told_so(name: str, share: float) -> None:
    kind = CUTS[name]
    whole = kind.encode() if name.endswith("dae") else as_bytes(BOX.export(file_type=kind))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(whole[: int(share * len(whole))])
        assert ": truncated (" in refused(path)
        path.write_bytes(whole)
        assert read(path)


def as_bytes(content: object) -> bytes:
    return content if isinstance(content, bytes) else str(content).encode()


@pytest.mark.parametrize("name", ["box.stl", "boxes.obj"])
def test_names_in_latin_1_do_not_matter_whatever_is_installed(
    name: str, tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.setitem(sys.modules, "charset_normalizer", None)
    text = str(BOX.export(file_type="stl_ascii")) if name == "box.stl" else TWO_BOXES
    rest = text.partition("\n")[2]
    named = f"solid Geh\xe4use\n{rest}" if name == "box.stl" else f"# Geh\xe4use\n{text}"
    (tmp_path / "plain").mkdir()
    plain = write(tmp_path / "plain" / name, text)
    (tmp_path / name).write_bytes(named.encode("latin-1"))
    assert read(tmp_path / name) == read(plain)


@pytest.mark.parametrize("kind", ["stl", "obj"])
def test_a_byte_order_mark_and_ends_of_lines_of_windows_change_nothing(
    kind: str, tmp_path: Path
) -> None:
    """The mark would hide the first vertex of an OBJ file, and shift the others."""
    text = str(BOX.export(file_type="stl_ascii" if kind == "stl" else kind))
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    (tmp_path / "plain").mkdir()
    plain = write(tmp_path / "plain" / f"box.{kind}", "\n".join(lines).strip())
    marked = tmp_path / f"box.{kind}"
    marked.write_bytes(("\ufeff" + "\r\n".join(lines).strip()).encode())
    assert read(marked) == read(plain)


def test_a_mesh_is_read_once_and_a_damaged_cache_does_not_matter(
    tmp_path: Path, cache: Path, monkeypatch: Patch
) -> None:
    path = write(tmp_path / "boxes.obj", TWO_BOXES)
    first = read(path)
    [file] = cache.iterdir()
    with monkeypatch.context() as patch:
        patch.setattr(mesh_parts, "divide_mesh", lambda triangles: pytest.fail("divided again"))
        mesh._read.cache_clear()
        assert read(path) == first
    for damage in ("", "{}", '{"parts": [[]], "dropped": 0, "deviation_m": 0}', "[[[", "\0"):
        file.write_text(damage)
        mesh._read.cache_clear()
        assert read(path) == first
    write(path, TWO_BOXES.replace("v 5 0 0", "v 6 0 0"))
    assert bounds(*read(path)) == [[0, 0, 0], [6, 1, 1]]


def test_the_faces_of_a_mesh_are_read_once_for_its_box_and_its_parts(
    tmp_path: Path, cache: Path, monkeypatch: Patch
) -> None:
    file, count = MeshFile(write(tmp_path / "boxes.obj", TWO_BOXES)), Mock(wraps=read_faces)
    monkeypatch.setattr(mesh, "read_faces", count)
    for _ in range(2):  # the second time, both come from the cache
        mesh._find_box.cache_clear()
        mesh._read.cache_clear()
        assert mesh.find_box(file).tolist() == [[0, 0, 0], [5, 1, 1]]
        assert len(read_mesh(file).shapes) == 2
    count.assert_called_once()
    assert not mesh._FACES
    assert len(list(cache.iterdir())) == 2


def test_a_huge_mesh_is_not_read(tmp_path: Path, monkeypatch: Patch) -> None:
    path = write(tmp_path / "boxes.obj", TWO_BOXES)
    monkeypatch.setattr(mesh_files, "MOST_MB", 1e-5)
    assert "more than the limit of 1e-05 MB; simplify the mesh" in refused(path)


def test_a_cache_that_cannot_be_written_does_not_matter(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(write(tmp_path / "file", "")))
    assert len(read(write(tmp_path / "boxes.obj", TWO_BOXES))) == 2


def test_what_is_left_out_is_noted_whenever_the_mesh_is_read(tmp_path: Path) -> None:
    path = write(
        tmp_path / "boxes.obj", TWO_BOXES + "v 9 9 9\nv 9 9.0001 9\nv 9 9 9.0001\nf 13 14 15\n"
    )
    for _ in range(2):
        mesh = read_mesh(MeshFile(path))
        assert len(mesh.shapes) == 2
        assert mesh.notes == ("left out: 1 part smaller than 1 mm",)


def test_how_far_the_parts_are_off_is_noted(tmp_path: Path) -> None:
    path = tmp_path / "ball.stl"
    trimesh.creation.icosphere(4, 1.0).export(path)
    [note] = read_mesh(MeshFile(path)).notes
    assert note.startswith("the mesh is replaced with its convex hull (up to ")


def test_a_negative_scale_mirrors(tmp_path: Path) -> None:
    path = write(tmp_path / "boxes.obj", TWO_BOXES)
    plain, mirrored = read(path), read(path, (-2.0, 2.0, 2.0))
    expected = {tuple((-2 * x, 2 * y, 2 * z) for x, y, z in shape.corners) for shape in plain}
    assert {frozenset(corners) for corners in expected} == {
        frozenset(shape.corners) for shape in mirrored
    }


@pytest.mark.slow
def test_a_library_s_attempts_at_a_file_are_not_told(tmp_path: Path, capfd: Capture) -> None:
    text = "solid s\n facet normal 0 0 x\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n"
    text += "   vertex 0 1 0\n  endloop\n endfacet\nendsolid s\n"
    path = write(tmp_path / "normals.stl", text)
    code = "from pathlib import Path\nfrom evoros.formats.mesh_files import MeshFile, read_faces\n"
    code += f"read_faces(MeshFile(Path({str(path)!r})))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "failed to extract" not in done.stderr


# Colours --------------------------------------------------------------------------------------

EFFECTS = """<library_effects><effect id="shiny"><profile_COMMON><technique sid="common"><phong>
<diffuse><color>{colour}</color></diffuse></phong></technique></profile_COMMON></effect>
</library_effects><library_materials><material id="skin"><instance_effect url="#shiny"/></material>
</library_materials><library_geometries>"""
BOUND = """<instance_geometry url="#wedge-mesh"><bind_material><technique_common>
<instance_material symbol="painted" target="#skin"/></technique_common></bind_material>
</instance_geometry></node><node"""


def test_a_node_of_a_dae_has_the_diffuse_colour_that_it_binds(tmp_path: Path) -> None:
    dae = DAE.format(up="Z_UP").replace("<library_geometries>", EFFECTS.format(colour="1 0.5 0 1"))
    bound = re.sub(r"<instance_geometry [^>]*/>\s*</node>\s*<node", BOUND, dae, count=1)
    assert bound != dae
    colours = read_faces(MeshFile(write(tmp_path / "wedges.dae", bound)), painted=True).colours
    assert colours[:4].tolist() == [[1.0, 0.5, 0.0]] * 4  # the left one
    assert np.isnan(colours[4:]).all()


@pytest.mark.parametrize("colour", ["", "red", "1 0", "nan 0 0 1"])
def test_a_colour_of_a_dae_that_cannot_be_read_is_none(colour: str, tmp_path: Path) -> None:
    dae = DAE.format(up="Z_UP").replace("<library_geometries>", EFFECTS.format(colour=colour))
    bound = re.sub(r"<instance_geometry [^>]*/>\s*</node>\s*<node", BOUND, dae, count=1)
    assert np.isnan(
        read_faces(MeshFile(write(tmp_path / "wedges.dae", bound)), painted=True).colours
    ).all()


def test_an_obj_has_the_colours_of_its_materials_or_of_its_corners(tmp_path: Path) -> None:
    (tmp_path / "absent.mtl").write_text("newmtl paint\nKd 0 0 1\n")
    boxes = read_faces(MeshFile(write(tmp_path / "boxes.obj", TWO_BOXES)), painted=True)
    is_right = boxes.triangles[:, :, 0].min(axis=1) > 2.0
    assert np.isnan(boxes.colours[~is_right]).all()
    assert boxes.colours[is_right].tolist() == [[0.0, 0.0, 1.0]] * 4
    corners = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nf 1 2 3\n"
    colours = read_faces(MeshFile(write(tmp_path / "corners.obj", corners)), painted=True).colours
    assert colours.tolist() == [[1.0, 0.0, 0.0]]


def test_a_texture_gives_each_face_its_mean_and_one_outside_of_the_folder_is_not_read(
    tmp_path: Path,
) -> None:
    (tmp_path / "mesh").mkdir()
    Image.new("RGB", (4, 4), (0, 255, 0)).save(tmp_path / "mesh" / "in.png")
    Image.new("RGB", (4, 4), (0, 255, 0)).save(tmp_path / "out.png")
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
    obj = f"mtllib a.mtl\n{corners}usemtl a\nf 1/1 2/2 3/3\n"
    path = write(tmp_path / "mesh" / "a.obj", obj)
    for picture, expected in (("in.png", [0.0, 1.0, 0.0]), ("../out.png", [1.0, 1.0, 1.0])):
        write(tmp_path / "mesh" / "a.mtl", f"newmtl a\nKd 1 1 1\nmap_Kd {picture}\n")
        (colour,) = read_faces(MeshFile(path), painted=True).colours.tolist()
        assert colour == expected
    (tmp_path / "mesh" / "a.mtl").unlink()
    assert np.isnan(read_faces(MeshFile(path), painted=True).colours).all()
