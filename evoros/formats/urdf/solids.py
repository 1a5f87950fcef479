"""Converts the solids of a URDF to boxes, cylinders, spheres and convex polyhedra."""

import logging
import math
from pathlib import Path

import numpy as np
from lxml.etree import _Element as Element

from evoros.base import elementary
from evoros.base.arrays import principal_axes, product
from evoros.base.errors import InputError
from evoros.compilation.elementary_arrays import cos_all, sin_all
from evoros.formats.notes import Notes
from evoros.formats.strict_xml import element_error, parse_number, quote, require_child
from evoros.formats.urdf.accessories import names_sensor
from evoros.formats.urdf.elements import build_collision
from evoros.formats.urdf.parts import (
    read_lengths,
    read_origin,
    read_shape,
    read_tensor,
    read_value,
    read_values,
)
from evoros.geometry.shapes import MeshFile, Pose, Shape, Vector
from evoros.terminal.activity import announce

_LOG = logging.getLogger(__name__)

_PRIMITIVES = ("box", "cylinder", "sphere", "convex")
_SOLIDS = (*_PRIMITIVES, "mesh", "capsule", "ellipsoid")
_MAX_PARTS = 64  # maximum number of convex parts of a mesh, above which its hull is used
_MAX_CORNERS = (
    256  # maximum number of corners of a convex part, above which only extreme corners are kept
)
_ELLIPSOID_RINGS = 9
_LARGEST_M = 20.0  # maximum plausible size [m] of a robot's mesh
_KINDS = _EMPTY, _STRANGE, _BOXES, _ROUND, _ABSENT = (
    "shapes without a size are left out of the links",
    "invalid elements of <geometry> are left out:",
    "missing meshes are replaced with boxes:",
    "missing meshes of links that turn are replaced with cylinders:",
    "missing meshes are left out:",
)
"""Kinds of notes on solids; each note ends with the names concerned."""


class SolidsReader:
    """Reads the solids of a description, and records the assumptions made."""

    def __init__(self, missing: str) -> None:
        self.missing = missing
        self.empty: dict[str, InputError] = {}
        """Errors for shapes of size 0, by link, in case a link requires the shape."""
        self.mesh_notes = Notes(_LOG)
        self._turning: set[str] = set()
        self._divided = 0
        self._hulls = 0
        self._names: dict[str, list[str]] = {kind: [] for kind in _KINDS}

    @property
    def lacks_meshes(self) -> bool:
        """True if any mesh is missing."""
        return any(self._names[kind] for kind in (_BOXES, _ROUND, _ABSENT))

    def rewrite_collisions(self, robot: Element) -> None:
        """Replace collisions that engines do not support; links that turn endlessly get hulls."""
        self._turning = find_turning(robot)
        for link in robot.findall("link"):
            for collision in link.findall("collision"):
                self._keep_solid(link, collision)
                solids = collision.findall("geometry/*")
                known = len(solids) == 1 and solids[0].tag in _PRIMITIVES
                if not known or _is_empty(solids[0]):
                    shapes = self.read(link, collision, link.get("name") in self._turning)
                    link.remove(collision)
                    link.extend([build_collision(shape) for shape in shapes])

    def _keep_solid(self, link: Element, part: Element) -> None:
        """Remove misplaced elements, such as origins, from a geometry that contains a solid."""
        geometry = part.find("geometry")
        if geometry is None or not any(child.tag in _SOLIDS for child in geometry):
            return
        for child in [child for child in geometry if child.tag not in _SOLIDS]:
            geometry.remove(child)
            self._names[_STRANGE].append(f"<{child.tag!s}> of {link.get('name')}")

    def read(self, link: Element, part: Element, hull: bool = True) -> tuple[Shape, ...]:
        """Read the solids of a ``<collision>`` or ``<visual>`` in the link's frame."""
        geometry = part.find("geometry")
        if geometry is None or not len(geometry):
            self._names[_EMPTY].append(str(link.get("name")))
            return ()
        solid, pose = geometry[0], read_origin(part)
        if solid.tag == "mesh":
            return self._read_mesh(link, solid, pose, hull)
        if solid.tag == "capsule":
            (radius,), (length,) = read_lengths(solid, "radius"), read_lengths(solid, "length")
            ends = (Pose((0.0, 0.0, side * length / 2)) for side in (1, -1))
            balls = [Shape("sphere", (radius,), pose @ end) for end in ends]
            return (Shape("cylinder", (radius, length), pose), *balls)
        if solid.tag == "ellipsoid":
            radii = read_lengths(solid, "radii" if solid.get("radii") else "radius", 3)
            return (Shape("convex", (), pose, corners=_ellipsoid(radii)),)
        if _is_empty(solid):
            stated = " ".join(f"{name} {value}" for name, value in solid.items())
            problem = f"must have lengths above 0 m, not {quote(stated)}"
            error = element_error(solid, problem, "write the lengths in metres")
            self.empty[str(link.get("name"))] = error
            self._names[_EMPTY].append(str(link.get("name")))
            return ()
        return (read_shape(part),)

    def finish(self) -> list[str]:
        """Return one line per kind of assumption."""
        counts = {"convex parts": self._divided, "convex hulls": self._hulls}
        shapes = [f"collision meshes replaced with {what}: {n}" for what, n in counts.items() if n]
        named = {kind: ", ".join(dict.fromkeys(names)) for kind, names in self._names.items()}
        return [*shapes, *(f"{kind} {names}" for kind, names in named.items() if names)]

    def _read_mesh(
        self, link: Element, solid: Element, pose: Pose, hull: bool
    ) -> tuple[Shape, ...]:
        name = str(solid.get("filename")).removeprefix("file://")
        if not Path(name).is_file():
            return self._replace_absent(link, solid, name)
        x, y, z = read_values(solid, "scale", 3, "1 1 1")
        if not x * y * z:
            problem = f"must have a nonzero scale per axis, not {quote(solid.get('scale', ''))}"
            raise element_error(solid, problem, "write the scale of each axis, 1 1 1 for metres")
        parts = self._read_file(Path(name), (x, y, z), hull)
        return tuple(Shape("convex", (), pose @ part.pose, corners=part.corners) for part in parts)

    def _replace_absent(self, link: Element, solid: Element, name: str) -> tuple[Shape, ...]:
        if self.missing == "error" and not names_sensor(link):
            fix = (
                "add the folder of the mesh's package to robot.packages, or set "
                "robot.missing=leave_out"
            )
            raise element_error(solid, f"names the mesh {name}, which does not exist", fix)
        turns = link.get("name") in self._turning
        shape = _match_inertia(link, turns) if self.missing == "box" else None
        kind = _ABSENT if shape is None else _ROUND if turns else _BOXES
        size = f" (radius {shape.size[0]:.3g} m)" if shape is not None and turns else ""
        self._names[kind].append(f"{name}{size}")
        return () if shape is None else (shape,)

    def _read_file(self, path: Path, scale: Vector, hull: bool) -> tuple[Shape, ...]:
        """Read a mesh as its hull, or as a number of convex parts that suits an engine."""
        from evoros.formats.mesh import (  # slow: imports scipy
            TOLD_M,
            find_hull_gap,
            hull_of,
            read_hull,
            read_mesh,
        )

        file = MeshFile(path, scale)
        if hull:
            return (simplify(read_hull(file)),)
        with announce(f"dividing {path.name} into convex parts"):
            mesh = read_mesh(file)
        size = np.ptp([corner for shape in mesh.shapes for corner in shape.corners], axis=0)
        if size.max() > _LARGEST_M:
            words = " x ".join(f"{length:.4g}" for length in size.tolist())
            remark = (
                f"the mesh measures {words} m and may be in millimetres; set the scale of the mesh"
            )
            self.mesh_notes.add_file(path, remark)
        if len(mesh.shapes) <= _MAX_PARTS:
            self._divided += 1
            remarks, shapes = mesh.notes, mesh.shapes
        else:
            self._hulls += 1
            count, gap = len(mesh.shapes), find_hull_gap(file)
            off = (
                f", which is up to {1e3 * gap:.0f} mm from the mesh's surface"
                if gap > TOLD_M
                else ""
            )
            why = f"has {count} convex parts, more than {_MAX_PARTS}"
            remarks = (
                f"the mesh {why}, so it is replaced with its convex hull{off}",
                *mesh.remarks,
            )
            shapes = (hull_of(mesh.shapes),)
        for remark in remarks:
            self.mesh_notes.add_file(path, remark)
        return tuple(map(simplify, shapes))


def simplify(shape: Shape) -> Shape:
    """Reduce a shape with too many corners to the farthest ones in evenly spread directions."""
    if len(shape.corners) <= _MAX_CORNERS:
        return shape
    corners = np.array(shape.corners)
    turn = np.arange(_MAX_CORNERS) + 0.5
    height, angle = 1.0 - 2.0 * turn / _MAX_CORNERS, turn * math.pi * (1.0 + math.sqrt(5.0))
    ring = np.sqrt(1.0 - height * height)
    directions = np.stack([ring * cos_all(angle), ring * sin_all(angle), height], axis=1)
    kept = sorted(set((product(corners, directions.T)).argmax(axis=0).tolist()))
    return Shape("convex", (), shape.pose, corners=tuple(shape.corners[i] for i in kept))


def _is_empty(solid: Element) -> bool:
    """Return True if a length of a solid is 0, which some authors use to disable collisions."""
    words = " ".join(solid.get(name, "") for name in ("size", "radius", "length")).split()
    return any(parse_number(word) == 0.0 for word in words)


def _ellipsoid(radii: list[float]) -> tuple[Vector, ...]:
    a, b, c = radii
    corners = [(0.0, 0.0, c), (0.0, 0.0, -c)]
    for ring in range(1, _ELLIPSOID_RINGS):
        polar = math.pi * ring / _ELLIPSOID_RINGS
        for step in range(2 * _ELLIPSOID_RINGS):
            turn = math.pi * step / _ELLIPSOID_RINGS
            x = elementary.sin(polar) * elementary.cos(turn)
            y = elementary.sin(polar) * elementary.sin(turn)
            corners.append((a * x, b * y, c * elementary.cos(polar)))
    return tuple(corners)


def find_turning(robot: Element) -> set[str]:
    """Return the links that turn endlessly about their joints, as wheels do."""
    return {str(child.get("link")) for child in robot.iterfind("joint[@type='continuous']/child")}


def _match_inertia(link: Element, turns: bool) -> Shape | None:
    """Return the box (or wheel, if the link ``turns``) with the stated inertia of a link."""
    inertial = link.find("inertial")
    if inertial is None:
        return None
    mass = read_value(require_child(inertial, "mass"), "value")
    moments, axes = principal_axes(read_tensor(require_child(inertial, "inertia")))
    if mass <= 0.0 or moments[0] <= 0.0:
        return None
    squares = 6.0 / mass * (moments.sum() - 2.0 * moments)
    size = tuple(np.sqrt(np.clip(squares, 1e-6, 1.0)).tolist())
    centre = read_origin(inertial)
    if not turns:
        return Shape("box", size, centre @ Pose.from_matrix((0.0, 0.0, 0.0), axes))
    spin = int(np.argmin([abs(moments[i - 2] - moments[i - 1]) for i in range(3)]))
    radius = math.sqrt(min(2.0 * float(moments[spin]) / mass, 1.0))
    turned = Pose.from_matrix((0.0, 0.0, 0.0), axes[:, [spin - 2, spin - 1, spin]])
    return Shape("cylinder", (radius, size[spin]), centre @ turned)


def read_visual_solids(robot: Element, missing: str) -> dict[str, tuple[Shape, ...]]:
    """Read the visual solids of each link in its frame; meshes become convex parts."""
    reader = SolidsReader(missing)
    return {
        str(link.get("name")): tuple(
            shape
            for visual in link.findall("visual")
            for shape in reader.read(link, visual, hull=False)
        )
        for link in robot.findall("link")
    }
