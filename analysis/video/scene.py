"""Robots among bodies, as a camera sees them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from evoros.base.arrays import Array
from evoros.formats.strict_xml import parse
from evoros.formats.urdf.tree import read_tree
from evoros.geometry.shapes import Body, Shape

from .camera import Camera, to_matrix
from .looks import MOST_FACES, make_surfaces
from .rasterizer import Picture, rasterize
from .surfaces import Colour, Surface

WALKER = (0.85, 0.45, 0.15)  # colour of walkers


class ShownRobot:
    """A robot in a scene, which can be moved and painted."""

    def __init__(self, urdf: str, most_faces: int = MOST_FACES) -> None:
        element = parse(urdf.encode(), "robot.urdf")
        self.tree = read_tree(element, "robot.urdf")
        self.surfaces = dict(make_surfaces(element, self.tree, most_faces))
        self._above = {joint.child: joint for joint in self.tree.joints.values()}
        self.frames = {link: to_matrix(pose) for link, pose in self.tree.poses.items()}

    def move(self, frame: Array, joints: Mapping[str, float]) -> None:
        """Move the root link to a frame (4, 4) and turn the named joints to angles [rad]."""
        from scipy.spatial.transform import Rotation  # takes long to import

        self.frames[self.tree.root] = frame
        for link in self.tree.poses:  # from the root down
            if link != self.tree.root:
                joint = self._above[link]
                turned = to_matrix(joint.origin)
                angle = joints.get(joint.name, 0.0)
                turned[:3, :3] @= Rotation.from_rotvec(angle * joint.axis).as_matrix()
                self.frames[link] = self.frames[joint.parent] @ turned

    def paint(self, link: str, colour: Colour) -> None:
        """Change the colour of a link."""
        surface = self.surfaces[link]
        painted = np.broadcast_to(colour, surface.colours.shape)
        self.surfaces[link] = replace(surface, colours=painted)

    def place_surfaces(self) -> Iterator[tuple[Array, Surface]]:
        """Yield the frame (4, 4) and the surface of each link."""
        for link, surface in self.surfaces.items():
            yield self.frames[link], surface


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
        for frame, placed_surface in placed:
            surface = placed_surface.face(camera.eye, frame)
            corners.append(surface.corners @ (camera.pixels @ frame).T)
            shades.append(surface.shade(frame[:3, :3], camera.light))
        colours = np.round(255 * np.concatenate(shades)).clip(0, 255).astype(np.uint8)
        return rasterize(np.concatenate(corners).reshape(-1, 3, 3), colours, camera.size)
