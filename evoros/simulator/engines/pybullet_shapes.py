"""Shapes in PyBullet, and the files that it needs for some of them.

The engine takes the corners of a polyhedron directly if it is the only shape of its body. It takes
the polyhedra of other bodies and of robots from files only, which it reads at once.
"""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from evoros.geometry.polyhedron import convex_polyhedron
from evoros.geometry.shapes import Body, Pose, Shape, Vector

Frame = tuple[tuple[float, ...], tuple[float, ...]]  # position [m], quaternion (x, y, z, w)


def split_body(body: Body) -> Iterator[tuple[Pose, tuple[Shape, ...]]]:
    """Yield the bodies that the engine gets for one body: pose in the world, and shapes.

    Each polyhedron of a fixed body becomes a body of its own, which needs no file. So does a height
    field, which the engine takes alone only, and centres between its lowest and highest point.
    """
    kinds = {shape.kind for shape in body.shapes}
    if body.mass is not None or not kinds & {"convex", "heightfield"}:
        yield body.pose, body.shapes
        return
    for shape in body.shapes:
        pose = body.pose @ shape.pose
        if shape.kind == "heightfield":
            heights = np.array(shape.heights)
            pose = pose @ Pose((0.0, 0.0, float(heights.min() + heights.max()) / 2))
        yield pose, (replace(shape, pose=Pose()),)


def create_shape(bullet: Any, shapes: Sequence[Shape]) -> int:
    """Create one collision shape, compound if a body has several; returns its number."""
    if len(shapes) == 1 and shapes[0].kind in ("plane", "convex", "heightfield"):
        return _create_single(bullet, shapes[0])
    with tempfile.TemporaryDirectory() as folder:
        arguments = [_shape_arguments(bullet, shape) for shape in shapes]
        if any(shape.kind == "convex" for shape in shapes):
            files = _write_polyhedra(Path(folder), shapes)
            arguments = [
                {**values, "fileNames": file, "meshScales": [1, 1, 1]}
                for values, file in zip(arguments, files, strict=True)
            ]
        columns = {key: [shape[key] for shape in arguments] for key in arguments[0]}
        return int(bullet.createCollisionShapeArray(**columns))


def _create_single(bullet: Any, shape: Shape) -> int:
    if shape.kind == "plane":
        shape_id = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=shape.size)
    elif shape.kind == "convex":
        shape_id = bullet.createCollisionShape(
            bullet.GEOM_MESH,
            vertices=convex_polyhedron(shape.corners).corners.tolist(),
            collisionFramePosition=shape.pose.position,
            collisionFrameOrientation=shape.pose.quaternion,
        )
    else:
        heights = np.array(shape.heights)
        rows, columns = heights.shape
        shape_id = bullet.createCollisionShape(
            bullet.GEOM_HEIGHTFIELD,
            meshScale=[shape.size[0] / (columns - 1), shape.size[1] / (rows - 1), 1.0],
            heightfieldData=heights.ravel().tolist(),
            numHeightfieldRows=columns,  # of a column-major grid
            numHeightfieldColumns=rows,
        )
    return int(shape_id)


def _shape_arguments(bullet: Any, shape: Shape) -> dict[str, Any]:
    size = shape.size
    kinds = {
        "box": bullet.GEOM_BOX,
        "cylinder": bullet.GEOM_CYLINDER,
        "sphere": bullet.GEOM_SPHERE,
        "plane": bullet.GEOM_PLANE,
        "convex": bullet.GEOM_MESH,
    }
    return {
        "shapeTypes": kinds[shape.kind],
        "halfExtents": [edge / 2 for edge in size] if shape.kind == "box" else [0, 0, 0],
        "radii": size[0] if shape.kind in ("sphere", "cylinder") else 0.0,
        "lengths": size[1] if shape.kind == "cylinder" else 0.0,
        "planeNormals": size if shape.kind == "plane" else [0, 0, 1],
        "collisionFramePositions": shape.pose.position,
        "collisionFrameOrientations": shape.pose.quaternion,
    }


def _write_polyhedra(folder: Path, shapes: Sequence[Shape]) -> list[str]:
    """Write a file for each polyhedron; returns their paths, and "" for any other shape."""
    paths = []
    for index, shape in enumerate(shapes):
        path = folder / f"{index}.obj"
        if shape.kind == "convex":
            path.write_text(_format_obj(shape.corners), encoding="utf-8")
        paths.append(str(path) if shape.kind == "convex" else "")
    return paths


def _format_obj(corners: tuple[Vector, ...]) -> str:
    """Return the hull of corners as an OBJ file."""
    solid = convex_polyhedron(corners)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in solid.corners.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (solid.triangles + 1).tolist()]
    return "\n".join(lines) + "\n"


def load_urdf(bullet: Any, urdf: str, frame: Frame, flags: int) -> int:
    """Load a robot at a frame; returns its number. PyBullet reads URDF from files only."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(_format_urdf(urdf, Path(folder)), encoding="utf-8")
        return int(bullet.loadURDF(str(path), *frame, flags=flags))


def _format_urdf(urdf: str, folder: Path) -> str:
    """Return a robot as the engine reads it.

    Elements ``<convex corners="x y z ...">`` become files in a folder. Every element starts a line,
    because the engine cuts lines of more than 8,191 characters.
    """
    root = etree.fromstring(urdf.encode())
    for index, element in enumerate(root.iter("convex")):
        numbers = iter([float(word) for word in str(element.get("corners")).split()])
        path = folder / f"{index}.obj"
        path.write_text(
            _format_obj(tuple(zip(numbers, numbers, numbers, strict=True))), encoding="utf-8"
        )
        element.tag = "mesh"
        del element.attrib["corners"]
        element.set("filename", str(path))
    etree.indent(root, space="")
    return etree.tostring(root, encoding="unicode")
