"""A robot among bodies in PyBullet, only to be looked at: nothing is simulated."""

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
from evoros.simulator.engines.pybullet_bodies import create_shape, load_urdf
from evoros.simulator.pybullet import import_pybullet

Colour = tuple[float, float, float]  # red, green, blue, from 0 to 1

NOTHING = -1
"""Owner of the pixels on which nothing is."""
LIGHT = {"lightAmbientCoeff": 0.62, "lightDiffuseCoeff": 0.45, "lightSpecularCoeff": 0.0}


class Picture(NamedTuple):
    """What a camera sees, pixel by pixel, from the top left."""

    colours: NDArray[np.uint8]  # (h, w, 4) uint8: red, green, blue, and 255; white where nothing is
    depth: NDArray[
        np.float32
    ]  # (h, w) float32, of the depth buffer: 0 at the near plane, 1 at the far one
    owner: NDArray[np.int32]  # (h, w) int32: number of the body, NOTHING


class Scene:
    """One PyBullet client with a robot, which can be moved, and bodies around it."""

    def __init__(
        self, bullet: Any, client: int, urdf: str, bodies: Sequence[tuple[Body, Colour]]
    ) -> None:
        self._bullet, self._client = bullet, client
        for body, colour in bodies:
            shape = create_shape(bullet, client, body.shapes)
            place = (body.pose.position, body.pose.quaternion)
            number = bullet.createMultiBody(0.0, shape, -1, *place, physicsClientId=client)
            bullet.changeVisualShape(number, -1, rgbaColor=(*colour, 1), physicsClientId=client)
        origin = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        flags = bullet.URDF_USE_INERTIA_FROM_FILE
        self.robot = load_urdf(bullet, client, without_meshes(urdf), origin, flags)
        joints = [
            bullet.getJointInfo(self.robot, joint, physicsClientId=client)
            for joint in range(bullet.getNumJoints(self.robot, physicsClientId=client))
        ]
        self._joints = {info[1].decode(): info[0] for info in joints}
        self._links = {info[12].decode(): info[0] for info in joints}
        self._center = bullet.getDynamicsInfo(self.robot, -1, physicsClientId=client)[3:5]

    def move(
        self,
        position: Sequence[float],
        quaternion: Sequence[float],
        joints: Mapping[str, float],
    ) -> None:
        """The frame of the robot's root link [m], and its joints [rad] by name."""
        bullet, client = self._bullet, self._client
        # PyBullet places a body by its centre of mass.
        place = bullet.multiplyTransforms(position, quaternion, *self._center)
        bullet.resetBasePositionAndOrientation(self.robot, *place, client)
        for name, angle in joints.items():
            bullet.resetJointState(self.robot, self._joints[name], angle, 0, client)

    def paint(self, link: str, colour: Colour) -> None:
        """A link of the robot in another colour."""
        self._bullet.changeVisualShape(
            self.robot, self._links[link], rgbaColor=(*colour, 1), physicsClientId=self._client
        )

    def look(
        self, view: Array, projection: Array, size: tuple[int, int], light: Sequence[float]
    ) -> Picture:
        """What a camera sees, with matrices (4, 4) as OpenGL has them and ``size`` wide and high.

        ``light`` (3) points to where the light comes from.
        """
        bullet = self._bullet
        *_, colours, depth, owner = bullet.getCameraImage(
            *size,
            view.T.ravel().tolist(),
            projection.T.ravel().tolist(),
            lightDirection=light,
            shadow=0,  # they would take as long again
            renderer=bullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
            **LIGHT,
        )
        shape = (size[1], size[0])  # where PyBullet was built without numpy, it gives tuples
        return Picture(
            np.reshape(np.asarray(colours, dtype=np.uint8), (*shape, 4)),
            np.reshape(np.asarray(depth, dtype=np.float32), shape),
            np.reshape(np.asarray(owner, dtype=np.int32), shape),
        )


@contextmanager
def open_scene(urdf: str, bodies: Sequence[tuple[Body, Colour]]) -> Iterator[Scene]:
    """A scene with the robot at the origin; no display is needed.

    Raises:
        InputError: PyBullet is not installed, or ``urdf`` is no XML.
        SimulationError: PyBullet refuses the robot or a body.
    """
    bullet = import_pybullet()
    client: int = bullet.connect(bullet.DIRECT)
    try:
        yield Scene(bullet, client, urdf, bodies)
    except bullet.error as error:
        raise SimulationError(f"PyBullet cannot show the robot and its world: {error}") from error
    finally:
        bullet.disconnect(client)


def without_meshes(urdf: str) -> str:
    """The description without the looks of links that show meshes.

    PyBullet then shows their collision shapes, and opens no files: those of meshes may not be
    there.
    """
    root = parse(urdf.encode(), "robot.urdf")
    for link in root.findall("link"):
        looks = link.findall("visual")
        if any(look.find("geometry/mesh") is not None for look in looks):
            for look in looks:
                link.remove(look)
    return etree.tostring(root, encoding="unicode")
