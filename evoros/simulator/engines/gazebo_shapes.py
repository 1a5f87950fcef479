"""Links and collision shapes as the server of Gazebo's physics reads them."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.geometry.polyhedron import convex_polyhedron
from evoros.geometry.shapes import Pose, Shape
from evoros.simulator.engines.mujoco_bodies import scalar_first

# Groups of shapes, of which each is met by some others; the server knows them by their names.
GROUND, OBSTACLE, SOLID, ROLLING, WALKER = "ground", "obstacle", "solid", "rolling", "walker"
"""Solid shapes meet obstacles, walkers and the ground, shapes that are rolling the ground alone."""

_GEOMETRY = {
    "box": "<box><size>{} {} {}</size></box>",
    "cylinder": "<cylinder><radius>{}</radius><length>{}</length></cylinder>",
    "sphere": "<sphere><radius>{}</radius></sphere>",
    "plane": "<plane><normal>{} {} {}</normal><size>100 100</size></plane>",
}
_COLLISION = (
    '<collision name="{name}">{pose}<geometry>{geometry}</geometry><surface><friction><ode>'
    "<mu>{mu}</mu><mu2>{mu}</mu2></ode></friction></surface></collision>"
)
_INERTIAL = (
    "<inertial>{pose}<mass>{mass}</mass><inertia><ixx>{}</ixx><iyy>{}</iyy><izz>{}</izz>"
    "<ixy>{}</ixy><ixz>{}</ixz><iyz>{}</iyz></inertia></inertial>"
)


class Solid(NamedTuple):
    """A collision shape of a link."""

    group: str
    shape: Shape
    pose: Pose  # in the link
    friction: float


class Inertial(NamedTuple):
    """The inertia of a link."""

    mass: float  # [kg]
    pose: Pose  # of the centre of mass
    moments: Sequence[float]  # xx, yy, zz, xy, xz, yz [kg m2]


def format_link(
    model: str, link: str, pose: Pose, inertial: Inertial | None, solids: Sequence[Solid]
) -> tuple[str, list[str]]:
    """Return a link as SDF, and its meshes, which the server attaches.

    SDF names files of meshes, and the library builds none from there.
    """
    parts, meshes = [] if inertial is None else [_format_inertial(inertial)], []
    for index, solid in enumerate(solids):
        name = f"{solid.group}{index}"
        if solid.shape.kind in _GEOMETRY:
            parts.append(_format_collision(name, solid))
        else:
            meshes.append(_format_mesh(f"{model} {link} {name}", solid))
    return f'<link name="{link}">{format_pose(pose)}{"".join(parts)}</link>', meshes


def format_numbers(numbers: Iterable[float]) -> str:
    """Return numbers as text, exactly."""
    return " ".join(repr(float(number)) for number in numbers)


def format_pose(pose: Pose) -> str:
    """Return a pose as SDF."""
    numbers = format_numbers((*pose.position, *pose.quaternion))
    return f'<pose rotation_format="quat_xyzw">{numbers}</pose>'


def _format_inertial(inertial: Inertial) -> str:
    moments = format_numbers(inertial.moments).split()
    mass, pose = format_numbers([inertial.mass]), format_pose(inertial.pose)
    return _INERTIAL.format(*moments, mass=mass, pose=pose)


def _format_collision(name: str, solid: Solid) -> str:
    return _COLLISION.format(
        name=name,
        pose=format_pose(solid.pose),
        geometry=_GEOMETRY[solid.shape.kind].format(*format_numbers(solid.shape.size).split()),
        mu=format_numbers([solid.friction]),
    )


def _format_mesh(place: str, solid: Solid) -> str:
    """Return the line of a mesh: its place, its pose, its vertices and triangles."""
    if solid.shape.kind == "heightfield":
        vertices, triangles = _triangulate(solid.shape)
    else:
        vertices, triangles, *_ = convex_polyhedron(solid.shape.corners)
    pose = format_numbers([*solid.pose.position, *scalar_first(solid.pose)])
    counts = f"{len(vertices)} {len(triangles)}"
    points = format_numbers(vertices.ravel().tolist())
    corners = " ".join(map(str, triangles.ravel().tolist()))
    return f"{place} {pose} {counts} {points} {corners}"


def _triangulate(field: Shape) -> tuple[Array, NDArray[np.intp]]:
    """Return the vertices (n, 3) [m] and the triangles (m, 3) of a height field."""
    heights = np.array(field.heights)
    rows, columns = heights.shape
    x, y = (0.5 * length for length in field.size)
    xs, ys = np.meshgrid(np.linspace(-x, x, columns), np.linspace(-y, y, rows))
    vertices = np.stack([xs, ys, heights], axis=-1).reshape(-1, 3)
    first = np.add.outer(columns * np.arange(rows - 1), np.arange(columns - 1)).ravel()
    right, above = first + 1, first + columns
    lower = np.stack([first, right, above], axis=1)
    upper = np.stack([right, above + 1, above], axis=1)
    return vertices, np.concatenate([lower, upper])
