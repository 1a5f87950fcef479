"""Shapes of SDF files: solids of every kind, meshes, height maps, and boxes in place of meshes."""

import logging
from pathlib import Path

import numpy as np
import pytest
from fixture_types import Log
from PIL import Image
from sdf_cases import STATIC, load, write

from evoros.base.errors import InputError
from evoros.geometry.footprint import bottom_height, top_height
from evoros.geometry.polyhedron import solid_volume
from evoros.geometry.shapes import Body, Pose, Shape

INERTIA = "<ixx>{}</ixx><iyy>{}</iyy><izz>{}</izz>"
BOX_STL = "solid b\n{}endsolid b\n"


def one(
    tmp_path: Path, geometry: str, link: str = "", static: str = STATIC, **options: str
) -> Body:
    (body,) = load(
        tmp_path,
        f"<model name='m'>{static}<link name='l'><collision name='c'><pose>1 2 3 0 0 0</pose>"
        f"<geometry>{geometry}</geometry></collision>{link}</link></model>",
        **options,
    ).bodies
    return body


def write_box(path: Path, size: tuple[float, float, float]) -> Path:
    """Write a box about the origin as an STL file."""
    import trimesh

    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box(size).export(path)
    return path


def extent(body: Body) -> tuple[float, float]:
    poses = [(shape, body.pose @ shape.pose) for shape in body.shapes]
    return min(bottom_height(*p) for p in poses), max(top_height(*p) for p in poses)


# ---- Solids.


def test_a_capsule_is_a_cylinder_and_two_spheres(tmp_path: Path) -> None:
    body = one(tmp_path, "<capsule><radius>0.5</radius><length>2</length></capsule>")
    assert [(s.kind, s.size, s.pose.position[2]) for s in body.shapes] == [
        ("cylinder", (0.5, 2.0), 0.0),
        ("sphere", (0.5,), -1.0),
        ("sphere", (0.5,), 1.0),
    ]
    assert extent(body) == pytest.approx((1.5, 4.5))


@pytest.mark.parametrize(
    ("geometry", "volume", "low", "high"),
    [
        ("<ellipsoid><radii>1 2 0.5</radii></ellipsoid>", 4 / 3 * np.pi, 2.5, 3.5),
        ("<cone><radius>1</radius><length>3</length></cone>", np.pi, 1.5, 4.5),
        (
            "<polyline><point>0 0</point><point>2 0</point><point>2 1</point><point>1 1</point>"
            "<point>1 2</point><point>0 2</point><height>0.5</height></polyline>",
            1.5, 3.0, 3.5,
        ),
        (
            "<polyline><point>0 0</point><point>3 0</point><point>3 3</point><point>0 3</point>"
            "<height>2</height></polyline><polyline><point>1 1</point><point>2 1</point>"
            "<point>2 2</point><point>1 2</point><height>2</height></polyline>",
            16.0, 3.0, 5.0,
        ),
    ],
)  # fmt: skip
def test_other_solids_become_convex_parts_of_the_same_volume(
    tmp_path: Path, geometry: str, volume: float, low: float, high: float
) -> None:
    body = one(tmp_path, geometry)
    assert {shape.kind for shape in body.shapes} == {"convex"}
    assert sum(map(solid_volume, body.shapes)) == pytest.approx(volume, rel=0.04)
    assert extent(body) == pytest.approx((low, high))


def test_the_inertia_of_homogeneous_solids_is_computed(tmp_path: Path) -> None:
    geometry = "<box><size>1 2 0.5</size></box>"
    auto = "<inertial auto='true'><density>{}</density></inertial>"
    body = one(tmp_path, geometry, auto.format(600), "")
    assert body.mass == pytest.approx(600.0)
    assert body.pose.position == pytest.approx((1.0, 2.0, 3.0))
    assert body.inertia is None
    assert one(tmp_path, geometry, "<inertial auto='1'/>", "").mass == pytest.approx(1000.0)


def test_a_body_of_several_frictions_has_that_of_its_lowest_shape(
    tmp_path: Path, caplog: Log
) -> None:
    def collision(name: str, height: float, mu: float) -> str:
        return (
            f"<collision name='{name}'><pose>0 0 {height} 0 0 0</pose><geometry><sphere>"
            f"<radius>0.1</radius></sphere></geometry><surface><friction><ode><mu>{mu}</mu>"
            "</ode></friction></surface></collision>"
        )

    link = f"<link name='l'>{collision('top', 2, 0.3)}{collision('foot', 1, 0.7)}</link>"
    with caplog.at_level(logging.WARNING):
        (body,) = load(tmp_path, f"<model name='m'>{link}</model>").bodies
    assert body.friction == 0.7
    assert "0.3, 0.7" in caplog.text


@pytest.mark.parametrize("held", ["<gravity>0</gravity>", "<kinematic>true</kinematic>"])
def test_a_link_without_weight_is_fixed_and_told(tmp_path: Path, held: str, caplog: Log) -> None:
    with caplog.at_level(logging.WARNING):
        body = one(tmp_path, "<sphere><radius>1</radius></sphere>", held, static="")
    assert body.mass is None
    assert "fixed in place" in caplog.text


# ---- Meshes.


@pytest.mark.parametrize(
    "uri",
    ["model://crate/meshes/box.stl", "meshes/box.stl", "file://meshes/box.stl",
     "package://crate/meshes/box.stl", "model://crate/meshes/box%20.stl"],
)  # fmt: skip
def test_a_mesh_is_found_from_the_file_that_names_it(tmp_path: Path, uri: str) -> None:
    write_box(tmp_path / "models/crate/meshes/box.stl", (1.0, 2.0, 3.0))
    write_box(tmp_path / "models/crate/meshes/box .stl", (1.0, 2.0, 3.0))
    mesh = f"<mesh><uri>{uri}</uri><scale>2 1 0.5</scale></mesh>"
    collision = f"<collision name='c'><geometry>{mesh}</geometry></collision>"
    model = f"<model name='crate'>{STATIC}<link name='l'>{collision}</link></model>"
    write(tmp_path / "models/crate/model.sdf", f"<sdf version='1.7'>{model}</sdf>")
    (body,) = load(tmp_path, "<include><uri>model://crate</uri></include>").bodies
    (shape,) = body.shapes
    assert shape.kind == "convex"
    assert solid_volume(shape) == pytest.approx(6.0)
    assert extent(body) == pytest.approx((-0.75, 0.75))


def test_the_hash_covers_meshes(tmp_path: Path) -> None:
    content = (
        f"<model name='m'>{STATIC}<link name='l'><collision name='c'><geometry><mesh>"
        "<uri>box.stl</uri></mesh></geometry></collision></link></model>"
    )
    file = write_box(tmp_path / "worlds" / "box.stl", (1.0, 1.0, 1.0))
    before = load(tmp_path, content).sha256
    write_box(file, (1.0, 1.0, 2.0))
    assert load(tmp_path, content).sha256 != before


MESH = "<mesh><uri>model://crate/missing.stl</uri></mesh>"


def test_a_missing_mesh_is_an_error_that_names_it(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"names model://crate/missing\.stl") as caught:
        one(tmp_path, MESH)
    assert str(caught.value).startswith("w.sdf:3: <uri> of collision 'c'")
    assert "missing=box" in str(caught.value)


def test_a_box_of_the_visual_stands_for_a_missing_mesh(tmp_path: Path, caplog: Log) -> None:
    cylinder = "<cylinder><radius>0.5</radius><length>3</length></cylinder>"
    visuals = (
        f"<visual name='v'><geometry>{MESH}</geometry></visual>"
        f"<visual name='w'><pose>4 5 6 0 0 0</pose><geometry>{cylinder}</geometry></visual>"
    )
    with caplog.at_level(logging.WARNING):
        body = one(tmp_path, MESH, visuals, missing="box")
    (shape,) = body.shapes
    assert (shape.kind, shape.size) == ("box", (1.0, 1.0, 3.0))
    assert (body.pose @ shape.pose).position == pytest.approx((4.0, 5.0, 6.0))
    assert "a 1 x 1 x 3 m box from the link's visual" in caplog.text


def test_the_box_of_the_inertia_stands_for_a_missing_mesh(tmp_path: Path) -> None:
    a, b, c, mass = 1.0, 2.0, 3.0, 7.0
    moments = [
        mass / 12 * (b * b + c * c),
        mass / 12 * (a * a + c * c),
        mass / 12 * (a * a + b * b),
    ]
    inertial = (
        f"<inertial><mass>{mass}</mass><pose>0 0 0.5 0 0 0</pose><inertia>"
        f"{INERTIA.format(*moments)}</inertia></inertial>"
    )
    body = one(tmp_path, MESH, inertial, missing="box")
    (shape,) = body.shapes
    assert shape.size == pytest.approx((a, b, c))
    assert (body.pose @ shape.pose).position == pytest.approx((0.0, 0.0, 0.5))


def test_a_mesh_without_any_size_is_left_out_and_told(tmp_path: Path, caplog: Log) -> None:
    two = "<collision name='d'><geometry><sphere><radius>1</radius></sphere></geometry></collision>"
    for missing in ("box", "leave_out"):
        with caplog.at_level(logging.WARNING):
            body = one(tmp_path, MESH, two, missing=missing)
        assert [shape.kind for shape in body.shapes] == ["sphere"]
        assert "is left out: the file is missing" in caplog.text
        caplog.clear()


# ---- Height maps.


@pytest.mark.parametrize(("mode", "full"), [("L", 200), ("I;16", 40_000), ("RGB", 200)])
def test_a_height_map_reaches_its_height_at_the_brightest_pixel(
    tmp_path: Path, mode: str, full: int
) -> None:
    levels = np.array([[full, 0, 0], [0, full // 2, 0], [0, 0, full // 4]])
    pixels = levels.astype(np.uint16 if mode == "I;16" else np.uint8)
    image = Image.fromarray(pixels)
    (tmp_path / "worlds").mkdir()
    (image.convert("RGB") if mode == "RGB" else image).save(tmp_path / "worlds" / "hill.png")
    body = one(
        tmp_path, "<heightmap><uri>hill.png</uri><size>20 10 5</size><pos>0 0 0.5</pos></heightmap>"
    )
    (shape,) = body.shapes
    assert body.is_ground
    assert (shape.kind, shape.size) == ("heightfield", (20.0, 10.0))
    # The image's first row is at the greatest y.
    assert shape.heights == ((0.0, 0.0, 1.25), (0.0, 2.5, 0.0), (5.0, 0.0, 0.0))
    assert shape.pose == Pose((0.0, 0.0, 0.5))


def test_what_is_no_image_is_an_error(tmp_path: Path) -> None:
    write(tmp_path / "worlds" / "hill.png", "no image")
    with pytest.raises(InputError, match=r"^w\.sdf:3: <uri>.*hill\.png.*convert the file"):
        one(tmp_path, "<heightmap><uri>hill.png</uri></heightmap>")


# ---- Scales of a state.


def test_the_scale_of_a_state_multiplies_sizes(tmp_path: Path, caplog: Log) -> None:
    link = (
        "<link name='l'><collision name='c'><geometry><box><size>1 2 3</size></box></geometry>"
        "</collision></link>"
    )
    state = "<state><model name='m'><pose>0 0 1 0 0 0</pose><scale>2 3 4</scale></model></state>"
    with caplog.at_level(logging.WARNING):
        (body,) = load(tmp_path, f"<model name='m'>{STATIC}{link}</model>{state}").bodies
    assert body.shapes == (Shape("box", (2.0, 6.0, 12.0)),)
    assert "scales" in caplog.text


def test_a_state_inserts_and_deletes_models(tmp_path: Path) -> None:
    def model(name: str) -> str:
        collision = "<collision name='c'><geometry><sphere><radius>1</radius></sphere></geometry>"
        return f"<model name='{name}'>{STATIC}<link name='l'>{collision}</collision></link></model>"

    state = (
        f"<state><insertions>{model('new')}</insertions><deletions><name>old</name></deletions>"
        "</state>"
    )
    bodies = load(tmp_path, f"{model('old')}{model('kept')}{state}").bodies
    assert [body.name for body in bodies] == ["kept", "new"]


def test_what_stands_for_a_mesh_is_told_once_in_every_world(tmp_path: Path, caplog: Log) -> None:
    import trimesh

    path = tmp_path / "worlds" / "ball.stl"
    path.parent.mkdir()
    ball, speck = trimesh.creation.icosphere(2, 1.0), trimesh.creation.box([1e-4] * 3)
    speck.apply_translation([3.0, 0.0, 0.0])
    (ball + speck).export(path)
    mesh = "<geometry><mesh><uri>ball.stl</uri></mesh></geometry>"
    balls = "".join(
        f"<model name='{name}'>{STATIC}<link name='l'><collision name='c'>{mesh}</collision></link>"
        f"</model>"
        for name in ("a", "b")
    )
    for _ in range(2):
        caplog.clear()
        load(tmp_path, balls)
        (line,) = caplog.messages
        assert line == f"{path}: left out: 1 part smaller than 1 mm"
