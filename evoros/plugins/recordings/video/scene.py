"""Robots and bodies as seen by a camera."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain, islice, repeat
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lxml.etree import _Element as Element
from numba import types
from numpy.typing import ArrayLike, NDArray

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.compilation.rules import compile_rule
from evoros.formats.mesh_files import read_faces
from evoros.formats.strict_xml import parse
from evoros.formats.urdf.parts import read_origin, read_shape, read_values
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.geometry import triangles as geometry
from evoros.geometry.shapes import Body, MeshFile, Shape, Vector
from evoros.plugins.recordings.video.camera import NEAR_M, Camera, Floats, Pixels, to_matrix
from evoros.plugins.recordings.video.surfaces import Colour, Surface
from evoros.terminal.log import LOGGER

_FILL = types.void(
    types.Array(types.float64, 3, "C"),
    types.Array(types.int64, 2, "C"),
    types.Array(types.uint8, 2, "C"),
    types.Array(types.float32, 2, "C"),
    types.Array(types.uint8, 3, "C"),
)
UNPAINTED = (0.6, 0.6, 0.6)  # default colour
MOST_FACES, _MIN_FACES = 24_000, 400  # triangles: about the maximum of a robot, minimum of a mesh
_FINEST, _COARSER = 1 / 400, 1.25  # first cell size, relative to a mesh's extent, and its growth


class Picture(NamedTuple):
    """A camera's view."""

    colours: Pixels  # (h, w, 3), on a white background
    nearness: Floats  # (h, w) [1/m], 0 in the background

    @property
    def depth(self) -> Floats:
        """The depth (h, w) [m], infinite in the background."""
        with np.errstate(divide="ignore"):
            return np.float32(1.0) / self.nearness


def rasterize(corners: Array, colours: Pixels, size: tuple[int, int]) -> Picture:
    """Draw the front faces of triangles into a picture of ``size`` (width, height).

    ``corners`` (t, 3, 3) holds (column * depth, row * depth, depth) [m] of the corners of each
    triangle, as projected by ``Camera.pixels``; ``colours`` is (t, 3). A point in a triangle is a
    weighted mean of the corners. Divided by the depth, each weight is linear in column and row,
    even if corners are behind the camera. The divided weights add up to the nearness, 1 / depth,
    and a pixel is inside if no weight is negative.
    """
    a, b, c = corners.transpose(1, 0, 2)
    weights = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    volume = (a * weights[:, 0]).sum(axis=1)
    shown = (volume < 0.0) & (corners[:, :, 2].max(axis=1) > NEAR_M)  # front faces: negative volume
    weights = np.ascontiguousarray(weights[shown] / volume[shown, None, None])
    picture = np.full((size[1], size[0], 3), 255, np.uint8)
    nearness = np.zeros((size[1], size[0]), np.float32)
    fill, boxes = compile_rule(_fill, _FILL), _bound(corners[shown], size)
    fill(weights, boxes, np.ascontiguousarray(colours[shown]), nearness, picture)
    return Picture(picture, nearness)


def _bound(corners: Array, size: tuple[int, int]) -> NDArray[np.int64]:
    """Return the column and row ranges (t, 4) of each triangle."""
    depth = corners[:, :, 2:]
    crossing = depth.min(axis=(1, 2)) <= NEAR_M  # triangles partly behind the camera
    points = corners[:, :, :2] / np.where(crossing[:, None, None], 1.0, depth)
    low, high = points.min(axis=1), points.max(axis=1) + 1.0
    low[crossing], high[crossing] = 0.0, size
    return np.hstack([low, high]).clip(0.0, [*size, *size]).astype(np.int64)


def _fill(
    weights: Array, boxes: NDArray[np.int64], colours: Pixels, nearness: Floats, picture: Pixels
) -> None:
    """Draw triangles into the pixels where they are nearest; update ``nearness`` (h, w)."""
    for t in range(len(weights)):
        first, second, third = weights[t]
        for row in range(boxes[t, 1], boxes[t, 3]):
            y = row + 0.5
            start, end = boxes[t, 0], boxes[t, 2]
            for slope, rise, rest in weights[t]:  # skip columns outside the triangle, up to a pixel
                if abs(slope) > 1e-6 * abs(rise):  # otherwise, the edge runs along the row
                    edge = int(min(max(-(rise * y + rest) / slope, 0.0), 1e6))
                    if slope > 0.0:
                        start = max(start, edge - 1)
                    else:
                        end = min(end, edge + 2)
            for column in range(start, end):
                x = column + 0.5
                one = first[0] * x + first[1] * y + first[2]
                two = second[0] * x + second[1] * y + second[2]
                three = third[0] * x + third[1] * y + third[2]
                near = one + two + three
                if min(one, two, three) >= 0.0 and nearness[row, column] < near < 1.0 / NEAR_M:
                    nearness[row, column] = near
                    for channel in range(3):
                        picture[row, column, channel] = colours[t, channel]


WALKER = (0.85, 0.45, 0.15)  # colour of walkers


class ShownRobot:
    """A displayed robot with links that can be moved and coloured."""

    def __init__(self, urdf: str, most_faces: int = MOST_FACES) -> None:
        element = parse(urdf.encode(), "robot.urdf")
        self.tree = read_tree(element, "robot.urdf")
        self.surfaces = dict(make_surfaces(element, self.tree, most_faces))
        self._above = {joint.child: joint for joint in self.tree.joints.values()}
        self.frames = {link: to_matrix(pose) for link, pose in self.tree.poses.items()}

    def move(self, frame: Array, joints: Mapping[str, float]) -> None:
        """Move the root link to a frame (4, 4), and set the angles [rad] of the named joints."""
        from scipy.spatial.transform import Rotation  # slow to import

        self.frames[self.tree.root] = frame
        for link in self.tree.poses:  # parents come first
            if link != self.tree.root:
                joint = self._above[link]
                turned = to_matrix(joint.origin)
                angle = joints.get(joint.name, 0.0)
                turned[:3, :3] @= Rotation.from_rotvec(angle * joint.axis).as_matrix()
                self.frames[link] = self.frames[joint.parent] @ turned

    def paint(self, link: str, colour: ArrayLike) -> None:
        """Set the colour (3,) of a link."""
        surface = self.surfaces[link]
        painted = np.broadcast_to(colour, surface.colours.shape)
        self.surfaces[link] = replace(surface, colours=painted)


class Scene:
    """The robots and walkers of a video, moving among fixed bodies."""

    def __init__(
        self,
        urdfs: Sequence[str],
        bodies: Sequence[tuple[Body, Colour]],
        walkers: Sequence[Shape] = (),
    ) -> None:
        self.robots = [ShownRobot(urdf) for urdf in urdfs]
        self._walkers = [(np.eye(4), Surface.from_shapes([shape], [WALKER])) for shape in walkers]
        self._bodies = [
            (to_matrix(body.pose), Surface.from_shapes(body.shapes, [colour] * len(body.shapes)))
            for body, colour in bodies
        ]

    def move_walkers(self, places: Sequence[Array]) -> None:
        """Move the walkers to positions (2,) [m]."""
        for (frame, _), place in zip(self._walkers, places, strict=True):
            frame[:2, 3] = place

    def render(self, camera: Camera) -> Picture:
        """Render the view of a camera."""
        corners, shades = [], []
        links = (
            (robot.frames[link], surface)
            for robot in self.robots
            for link, surface in robot.surfaces.items()
        )
        for frame, placed_surface in chain(self._bodies, self._walkers, links):
            surface = placed_surface.face(camera.eye, frame)
            corners.append(surface.corners @ (camera.pixels @ frame).T)
            shades.append(surface.shade(frame[:3, :3], camera.light))
        colours = np.round(255 * np.concatenate(shades)).clip(0, 255).astype(np.uint8)
        return rasterize(np.concatenate(corners).reshape(-1, 3, 3), colours, camera.size)


def make_surfaces(
    robot: Element, tree: Urdf, most_faces: int = MOST_FACES
) -> Iterator[tuple[str, Surface]]:
    """Yield links with surfaces, coloured by mesh or <material>; collision shapes if unreadable."""
    named = {
        material.get("name"): colour
        for material in robot.iter("material")
        if (colour := _read_colour(material)) is not None
    }
    count = len(robot.findall("link/visual/geometry/mesh"))
    most = max(_MIN_FACES, most_faces // max(count, 1))
    for link in robot.findall("link"):
        name, visuals = str(link.get("name")), link.findall("visual")
        colours = [_choose_colour(visual, named) for visual in visuals]
        if link.find("visual/geometry/mesh") is None:
            yield name, _show_shapes(tree, name, colours)
            continue
        try:
            parts = [_show(*pair, most) for pair in zip(visuals, colours, strict=True)]
            triangles = np.concatenate([part.triangles for part in parts])
            painted = np.concatenate([part.colours for part in parts])
            yield name, Surface.from_triangles(triangles, painted, is_open=True)
        except InputError as error:  # an unusable mesh is no reason to reject a robot
            LOGGER.warning("%s; the collision shapes of %s are shown", error, name)
            yield name, _show_shapes(tree, name, colours)


def _show_shapes(tree: Urdf, link: str, colours: Sequence[Colour]) -> Surface:
    shapes = tree.visuals[link]
    painted = chain(colours, repeat(colours[-1] if colours else UNPAINTED))
    return Surface.from_shapes(shapes, list(islice(painted, len(shapes))))


def _show(visual: Element, colour: Colour, most: int) -> Surface:
    mesh = visual.find("geometry/mesh")
    if mesh is None:
        return Surface.from_shapes([read_shape(visual)], [colour])
    name = str(mesh.get("filename"))
    path = Path(name.removeprefix("file://"))
    if not path.is_absolute() or not path.is_file():
        raise InputError(f"{name}: file not found; restore the file")
    x, y, z = read_values(mesh, "scale", 3, "1 1 1")
    triangles, colours = _read_coarse(path, (x, y, z), most, path.stat().st_mtime_ns)
    painted = np.where(np.isnan(colours), colour, colours)
    pose = read_origin(visual)
    return Surface.from_triangles(triangles @ pose.rotation.T + pose.position, painted, True)


@lru_cache(maxsize=64)  # wheels share mesh files, and missions share robots
def _read_coarse(path: Path, scale: Vector, most: int, changed_ns: int) -> tuple[Array, Array]:
    """Read a mesh as at most ``most`` coloured triangles; ``changed_ns`` is a key of the cache."""
    faces = read_faces(MeshFile(path, scale), painted=True)
    points = faces.triangles.reshape(-1, 3)
    whole = geometry.Surface(points, np.arange(len(points)).reshape(-1, 3))
    cell = _FINEST * float(np.ptp(whole.points, axis=0).max())
    joined, kept = whole, whole.faces[:, 0] // 3
    while len(kept) > most and cell > 0.0:
        joined, kept, _ = geometry.join_near(whole, cell)
        cell *= _COARSER
    return joined.triangles, faces.colours[kept]


def _choose_colour(visual: Element, named: Mapping[str | None, Colour]) -> Colour:
    material = visual.find("material")
    if material is None:
        return UNPAINTED
    return _read_colour(material) or named.get(material.get("name"), UNPAINTED)


def _read_colour(material: Element) -> Colour | None:
    color = material.find("color")
    try:
        red, green, blue, _ = map(float, "" if color is None else str(color.get("rgba")).split())
    except ValueError:  # an invalid colour is no reason to reject a robot
        return None
    return red, green, blue
