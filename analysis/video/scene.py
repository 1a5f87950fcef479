"""Robots among bodies, as a camera sees them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, repeat

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.formats.strict_xml import parse
from evoros.formats.urdf.tree import read_tree
from evoros.geometry.shapes import Body, Shape

from .camera import Camera, to_matrix
from .rasterizer import Picture, rasterize
from .surfaces import triangulate

Colour = tuple[float, float, float]  # red, green, blue, from 0 to 1

AMBIENT, DIFFUSE = 0.62, 0.45  # light from everywhere, and from a direction
WALKER = (0.85, 0.45, 0.15)  # colour of walkers
UNPAINTED = (0.6, 0.6, 0.6)  # colour of what has none


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles that move as one."""

    corners: Array  # (3 t, 4) [m], each with a 1
    normals: Array  # (t, 3) of length 1
    colours: Array  # (t, 3) from 0 to 1

    @classmethod
    def from_shapes(cls, shapes: Sequence[Shape], colours: Sequence[Colour]) -> "Surface":
        """Create the surface of shapes in the frame of their body."""
        parts = [
            triangulate(shape) @ shape.pose.rotation.T + shape.pose.position for shape in shapes
        ]
        triangles = np.concatenate([np.empty((0, 3, 3)), *parts])
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        corners = triangles.reshape(-1, 3)
        counts = [len(part) for part in parts]
        painted = np.repeat(np.reshape(colours, (-1, 3)), counts, axis=0)
        return cls(np.hstack([corners, np.ones((len(corners), 1))]), normals, painted)

    def shade(self, rotation: Array, light: Array) -> Array:
        """Return the colours (t, 3) under a light; ``light`` (3,) of length 1 points towards it."""
        facing = np.maximum(self.normals @ (rotation.T @ light), 0.0)
        return self.colours * (AMBIENT + DIFFUSE * facing)[:, None]


class ShownRobot:
    """A robot in a scene, which can be moved and painted."""

    def __init__(self, urdf: str) -> None:
        element = parse(urdf.encode(), "robot.urdf")
        self.tree = read_tree(element, "robot.urdf")
        self._surfaces = dict(_make_surfaces(element, self.tree.visuals))
        self._above = {joint.child: joint for joint in self.tree.joints.values()}
        self._frames = {link: to_matrix(pose) for link, pose in self.tree.poses.items()}

    def move(self, frame: Array, joints: Mapping[str, float]) -> None:
        """Move the root link to a frame (4, 4) and turn the named joints to angles [rad]."""
        from scipy.spatial.transform import Rotation  # takes long to import

        self._frames[self.tree.root] = frame
        for link in self.tree.poses:  # from the root down
            if link != self.tree.root:
                joint = self._above[link]
                turned = to_matrix(joint.origin)
                angle = joints.get(joint.name, 0.0)
                turned[:3, :3] @= Rotation.from_rotvec(angle * joint.axis).as_matrix()
                self._frames[link] = self._frames[joint.parent] @ turned

    def paint(self, link: str, colour: Colour) -> None:
        """Change the colour of a link."""
        surface = self._surfaces[link]
        painted = np.broadcast_to(colour, surface.colours.shape)
        self._surfaces[link] = replace(surface, colours=painted)

    def place_surfaces(self) -> Iterator[tuple[Array, Surface]]:
        """Yield the frame (4, 4) and the surface of each link."""
        for link, surface in self._surfaces.items():
            yield self._frames[link], surface


class Scene:
    """Robots and walkers, which can be moved, and bodies around them."""

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
        """Move the walkers to places (2,) [m]."""
        for (frame, _), place in zip(self._walkers, places, strict=True):
            frame[:2, 3] = place

    def render(self, camera: Camera) -> Picture:
        """Render the view of a camera."""
        corners, shades = [], []
        robots = (robot.place_surfaces() for robot in self.robots)
        placed = chain(self._bodies, self._walkers, *robots)
        for frame, surface in placed:
            corners.append(surface.corners @ (camera.pixels @ frame).T)
            shades.append(surface.shade(frame[:3, :3], camera.light))
        colours = np.round(255 * np.concatenate(shades)).clip(0, 255).astype(np.uint8)
        return rasterize(np.concatenate(corners).reshape(-1, 3, 3), colours, camera.size)


def _make_surfaces(
    robot: Element, visuals: Mapping[str, tuple[Shape, ...]]
) -> Iterator[tuple[str, Surface]]:
    """Yield each link that shows shapes, with their surface."""
    named = {
        material.get("name"): colour
        for material in robot.iter("material")
        if (colour := _read_colour(material)) is not None
    }
    for link in robot.findall("link"):
        shapes = visuals[str(link.get("name"))]
        painted = []
        for visual in link.findall("visual"):
            material = visual.find("material")
            colour = None if material is None else _read_colour(material)
            name = None if material is None else material.get("name")
            painted.append(colour or named.get(name, UNPAINTED))
        # Collision shapes stand for the meshes of a link: there may be more of them.
        colours = chain(painted, repeat(painted[-1] if painted else UNPAINTED))
        shown = [colour for _, colour in zip(shapes, colours, strict=False)]
        yield str(link.get("name")), Surface.from_shapes(shapes, shown)


def _read_colour(material: Element) -> Colour | None:
    """Read the colour of a material; None: it has none, or one that cannot be read."""
    color = material.find("color")
    try:
        red, green, blue, _ = map(float, "" if color is None else str(color.get("rgba")).split())
    except ValueError:  # no robot is refused for its looks
        return None
    return red, green, blue
