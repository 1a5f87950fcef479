"""A robot in pictures looks as its meshes do, and a fan of a scan as its ranges."""

import logging
import math
from pathlib import Path

import numpy as np
import pytest
from meshed_robot import BLACK, GLASS, PAINT, RED, TYRE_M, WHEEL_M, write_meshed_robot

from evoros.formats.mesh_files import read_faces
from evoros.geometry.shapes import MeshFile, Pose, Shape
from evoros.plugins.recordings.video.blending import blend
from evoros.plugins.recordings.video.camera import Camera, to_matrix
from evoros.plugins.recordings.video.scene import UNPAINTED, Scene, ShownRobot
from evoros.plugins.recordings.video.surfaces import Surface


@pytest.fixture(scope="module")
def urdf(tmp_path_factory: pytest.TempPathFactory) -> str:
    file = write_meshed_robot(tmp_path_factory.mktemp("robot"))
    return address(file)


def address(file: Path) -> str:
    """The description with the addresses of its meshes, as evoros writes it."""
    return file.read_text().replace('mesh filename="', f'mesh filename="file://{file.parent}/')


def list_colours(surface: Surface) -> set[tuple[float, ...]]:
    return {tuple(colour) for colour in surface.colours.round(2).tolist()}


def test_meshes_are_scaled_and_placed(urdf: str) -> None:
    """The tyre's mesh is in millimetres, and turned to stand."""
    surfaces = ShownRobot(urdf).surfaces
    wheel = surfaces["left"].corners[:, :3]
    reach = np.abs(wheel).max(axis=0)
    assert reach == pytest.approx([WHEEL_M, 0.4 * TYRE_M, WHEEL_M], abs=5e-4)
    body = surfaces["base_link"].corners[:, 2]
    assert (body.min(), body.max()) == pytest.approx((-0.03, 0.09 + 3.0 * 2.0 * 0.03), abs=1e-6)


def test_a_mesh_has_its_own_colours_or_its_materials(urdf: str) -> None:
    surfaces = ShownRobot(urdf).surfaces
    assert list_colours(surfaces["base_link"]) == {RED, GLASS, PAINT}
    assert list_colours(surfaces["left"]) == {BLACK}
    assert list_colours(surfaces["caster_wheel"]) == {UNPAINTED}


def test_a_fine_mesh_becomes_coarse_and_stays_in_place(tmp_path: Path) -> None:
    file = write_meshed_robot(tmp_path, fine=800)
    fine = ShownRobot(address(file), most_faces=10**6).surfaces["left"]
    coarse = ShownRobot(address(file), most_faces=4000).surfaces["left"]
    assert len(fine.normals) > 10_000
    assert 300 < len(coarse.normals) <= 1000  # of four meshes
    low, high = (np.ptp(s.corners[:, :3], axis=0) for s in (coarse, fine))
    assert low == pytest.approx(high, abs=0.05 * 2 * WHEEL_M)


@pytest.mark.parametrize("content", ["", "no mesh"])
def test_a_mesh_that_cannot_be_read_is_told_and_the_collision_shape_is_shown(
    content: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = write_meshed_robot(tmp_path)
    wheel = tmp_path / "wheel.stl"
    wheel.unlink()
    if content:
        wheel.write_text(content)
    with caplog.at_level(logging.WARNING, "evoros"):
        robot = ShownRobot(address(file))
    size = np.ptp(robot.surfaces["left"].corners[:, :3], axis=0)
    assert size == pytest.approx([2 * WHEEL_M, TYRE_M, 2 * WHEEL_M], abs=1e-3)
    assert list_colours(robot.surfaces["left"]) == {BLACK}


def test_faces_of_a_mesh_are_seen_from_both_sides_and_in_the_same_shade() -> None:
    """Meshes of others have faces that are turned inside out."""
    triangle = np.array([[[0.0, -1, 1], [0, 1, 1], [0, 0, 2]]])
    turned = triangle[:, ::-1]
    camera = Camera(np.array([4.0, 0, 1]), np.zeros(3), np.array([0, 0, 1.0]), 60.0, (64, 48))
    frame = to_matrix(Pose.from_rpy((0.0, 0.0, 0.0), 0.0, 0.0, 0.3))
    shades = []
    for corners in (triangle, turned):
        surface = Surface.from_triangles(corners, np.ones((1, 3)), True).face(camera.eye, frame)
        shades.append(surface.shade(frame[:3, :3], camera.light))
        pixels = surface.corners @ (camera.pixels @ frame).T
        assert np.linalg.det(pixels) < 0.0  # a front
    assert shades[0] == pytest.approx(shades[1])


def test_sensors_on_a_mesh_are_seen(urdf: str) -> None:
    box = '<visual><geometry><box size="0.04 0.04 0.04"/></geometry></visual>'
    joint = (
        '<joint name="s" type="fixed"><parent link="base_link"/><child link="sonar_0"/>'
        '<origin xyz="-0.05 0 0.11"/></joint></robot>'
    )
    sensor = f'<link name="sonar_0">{box}</link>{joint}'
    scene = Scene([urdf.replace("</robot>", sensor)], [])
    scene.robots[0].paint("sonar_0", (0.0, 1.0, 0.0))
    camera = Camera(np.array([-0.05, 0.0, 1.0]), np.zeros(3), np.array([0, 1.0, 0]), 60.0, (96, 64))
    column, row, depth = camera.pixels @ [-0.05, 0.0, 0.13, 1.0]
    red, green, blue = scene.render(camera).colours[int(row / depth), int(column / depth)]
    assert green > 150
    assert red == blue == 0


def test_a_box_is_drawn_as_before() -> None:
    surface = Surface.from_shapes([Shape("box", (1.0, 1.0, 1.0))], [RED])
    assert surface.face(np.array([5.0, 0, 0]), np.eye(4)) is surface


def test_the_colours_of_a_mesh_do_not_change_its_faces(tmp_path: Path) -> None:
    write_meshed_robot(tmp_path)
    for name in ("body.obj", "wheel.stl", "mast.dae"):
        plain, painted = (read_faces(MeshFile(tmp_path / name), painted=p) for p in (False, True))
        expected, result = (
            np.sort(faces.triangles.reshape(-1, 9), axis=0) for faces in (plain, painted)
        )
        np.testing.assert_array_equal(result, expected)


@pytest.mark.parametrize("ranges", [[1.0, 2.0, 3.0, 4.0], [2.5]])
def test_a_fan_of_a_scan_ends_at_the_range_of_each_sector(ranges: list[float]) -> None:
    """Seen from above, 10 pixels a metre."""
    picture, depth = np.zeros((100, 100, 3), np.float32), np.full((100, 100), 2.0, np.float32)
    plane = np.array([[0.1, 0.0, -5.0], [0.0, 0.1, -5.0], [0.0, 0.0, 1.0]])
    shape = np.array([math.pi, 4.0, 10.0, 0.0, 0.0, 1.0])
    blend(picture, depth, np.array([0, 100] * 2), plane, shape, np.array(ranges), np.ones(3))
    for angle, reach in zip(
        np.radians([-135, -45, 45, 135]), np.broadcast_to(ranges, 4), strict=True
    ):
        for distance, is_seen in ((reach - 0.3, True), (reach + 0.3, False)):
            column, row = (int(50 + 10 * distance * f(angle)) for f in (np.cos, np.sin))
            assert (picture[row, column, 0] > 0.0) == is_seen
