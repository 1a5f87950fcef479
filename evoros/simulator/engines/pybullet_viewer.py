"""Renders robots among bodies with PyBullet; simulates nothing."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.errors import SimulationError
from evoros.formats.strict_xml import parse
from evoros.geometry.shapes import Body
from evoros.geometry.surface import triangulate
from evoros.simulator.engines.pybullet_library import Client, import_pybullet, quiet
from evoros.simulator.engines.pybullet_shapes import create_shape, load_urdf

Colour = tuple[float, float, float]  # red, green, blue, from 0 to 1

NO_BODY = -1
"""The body number of pixels that show the background."""
LIGHT = {"lightAmbientCoeff": 0.62, "lightDiffuseCoeff": 0.45, "lightSpecularCoeff": 0.0}


class Picture(NamedTuple):
    """The view of a camera, pixel by pixel, from the top left."""

    colours: NDArray[np.uint8]  # (h, w, 4) red, green, blue, and 255; the background is white
    depth: NDArray[np.float32]  # (h, w) from 0 at the near plane to 1 at the far plane
    bodies: NDArray[np.int32]  # (h, w) number of the body, or NO_BODY


class ShownRobot:
    """A robot in a scene, which can be moved."""

    def __init__(self, bullet: Any, urdf: str) -> None:
        self._bullet = bullet
        origin = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        flags = bullet.URDF_USE_INERTIA_FROM_FILE
        with quiet():  # it reports links without mass, which are frames
            self.body = load_urdf(bullet, without_meshes(urdf), origin, flags)
        joints = [
            bullet.getJointInfo(self.body, joint) for joint in range(bullet.getNumJoints(self.body))
        ]
        self._joints = {info[1].decode(): info[0] for info in joints}
        self._links = {info[12].decode(): info[0] for info in joints}
        self._center = bullet.getDynamicsInfo(self.body, -1)[3:5]

    def move(
        self,
        position: Sequence[float],
        quaternion: Sequence[float],
        joints: Mapping[str, float],
    ) -> None:
        """Move the root link to a frame [m] and the named joints to angles [rad]."""
        bullet = self._bullet
        # PyBullet places a body by its centre of mass.
        frame = bullet.multiplyTransforms(position, quaternion, *self._center)
        bullet.resetBasePositionAndOrientation(self.body, *frame)
        for name, angle in joints.items():
            bullet.resetJointState(self.body, self._joints[name], angle, 0)

    def paint(self, link: str, colour: Colour) -> None:
        """Change the colour of a link."""
        self._bullet.changeVisualShape(self.body, self._links[link], rgbaColor=(*colour, 1))


class Scene:
    """One PyBullet client with robots, which can be moved, and bodies around them."""

    def __init__(
        self, bullet: Any, urdfs: Sequence[str], bodies: Sequence[tuple[Body, Colour]]
    ) -> None:
        self._bullet = bullet
        for body, colour in bodies:
            _add_visible(bullet, body, colour)
        self.robots = [ShownRobot(bullet, urdf) for urdf in urdfs]

    def render(
        self, view: Array, projection: Array, size: tuple[int, int], light: Sequence[float]
    ) -> Picture:
        """Render the view of a camera.

        ``view`` and ``projection`` are OpenGL's matrices (4, 4). ``size`` is width and height.
        ``light`` (3,) points towards the light.
        """
        bullet = self._bullet
        *_, colours, depth, bodies = bullet.getCameraImage(
            *size,
            view.T.ravel().tolist(),
            projection.T.ravel().tolist(),
            lightDirection=light,
            shadow=0,  # shadows would double the time
            renderer=bullet.ER_TINY_RENDERER,
            **LIGHT,
        )
        shape = (size[1], size[0])  # PyBullet gives tuples if it was built without numpy
        return Picture(
            np.reshape(np.asarray(colours, dtype=np.uint8), (*shape, 4)),
            np.reshape(np.asarray(depth, dtype=np.float32), shape),
            np.reshape(np.asarray(bodies, dtype=np.int32), shape),
        )


def _add_visible(bullet: Any, body: Body, colour: Colour) -> None:
    """Show a body; the engine draws polyhedra and height fields only as meshes without contact."""
    surfaces = [shape for shape in body.shapes if shape.kind in ("convex", "heightfield")]
    plain = [shape for shape in body.shapes if shape not in surfaces]
    frame = (body.pose.position, body.pose.quaternion)
    for shape in surfaces:
        triangles = triangulate(shape) @ shape.pose.rotation.T + shape.pose.position
        visual = _create_surface(bullet, triangles)
        body_id = bullet.createMultiBody(0.0, -1, visual, *frame)
        bullet.changeVisualShape(body_id, -1, rgbaColor=(*colour, 1))
    if plain:
        solid = create_shape(bullet, plain)
        body_id = bullet.createMultiBody(0.0, solid, -1, *frame)
        bullet.changeVisualShape(body_id, -1, rgbaColor=(*colour, 1))


def _create_surface(bullet: Any, triangles: Array) -> int:
    """Create the visual shape of triangles (t, 3, 3) [m], each with its own normal."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return int(
        bullet.createVisualShape(
            bullet.GEOM_MESH,
            vertices=triangles.reshape(-1, 3).tolist(),
            indices=list(range(3 * len(triangles))),
            normals=np.repeat(normals, 3, axis=0).tolist(),
            uvs=[[0.0, 0.0]] * (3 * len(triangles)),
        )
    )


@contextmanager
def open_scene(urdfs: Sequence[str], bodies: Sequence[tuple[Body, Colour]]) -> Iterator[Scene]:
    """Open a scene with all robots at the origin; needs no display.

    Raises:
        InputError: PyBullet is not installed, or a URDF is not XML.
        SimulationError: PyBullet refuses a robot or a body.
    """
    bullet = Client(import_pybullet())
    try:
        yield Scene(bullet, urdfs, bodies)
    except bullet.error as error:
        raise SimulationError(f"PyBullet cannot show robots and world: {error}") from error
    finally:
        bullet.disconnect()


def without_meshes(urdf: str) -> str:
    """Remove the looks of links with meshes, which may be missing: PyBullet shows contacts."""
    root = parse(urdf.encode(), "robot.urdf")
    for link in root.findall("link"):
        visuals = link.findall("visual")
        if any(visual.find("geometry/mesh") is not None for visual in visuals):
            for visual in visuals:
                link.remove(visual)
    return etree.tostring(root, encoding="unicode")
