"""Writes bodies as an SDF file that Gazebo and this package can read.

Lengths and angles are rounded to nine decimals, so that reading and writing leave a file unchanged.
SDF cannot contain polyhedra and height fields: polyhedra are written to an OBJ file, height fields
to images.
"""

import math
import re
import struct
import zlib
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from pathlib import Path

import numpy as np

from evoros.base import elementary, errors
from evoros.base.errors import InputError
from evoros.formats.lenient_xml import is_xacro
from evoros.formats.strict_xml import parse
from evoros.geometry.polyhedron import convex_polyhedron
from evoros.geometry.shapes import Body, Pose, Shape

_WHITE = 65535  # maximum level of 16 bits
_GREY_16 = (16, 0, 0, 0, 0)  # bit depth, colour type, compression, filter and interlacing of a PNG
_PART = "part_{}"  # name of a polyhedron in the OBJ file, counted from 1
_GRAVITY_MPS2 = 9.81  # gravity of a file without <gravity>
_FRAME = """<?xml version="1.0"?>
{comment}<sdf version="1.9">
  <world name={name}>
{gravity}{models}
  </world>
</sdf>
"""
_MODEL = """    <model name={name}>
{static}      <pose>{pose}</pose>
      <link name="link">
{content}
      </link>
    </model>"""
_INERTIAL = """        <inertial>
          <mass>{mass}</mass>
{moments}        </inertial>"""
_MOMENTS = """          <inertia>
            <ixx>{}</ixx><iyy>{}</iyy><izz>{}</izz>
            <ixy>0</ixy><ixz>0</ixz><iyz>0</iyz>
          </inertia>
"""
_SOLID = """        <collision name="collision{place}">
{pose}          <geometry>{geometry}</geometry>
          <surface>
            <friction><ode><mu>{mu}</mu><mu2>{mu}</mu2></ode></friction>
          </surface>
        </collision>
        <visual name="visual{place}">
{pose}          <geometry>{geometry}</geometry>
        </visual>"""
GEOMETRY = {
    "box": "<box><size>{} {} {}</size></box>",
    "cylinder": "<cylinder><radius>{}</radius><length>{}</length></cylinder>",
    "sphere": "<sphere><radius>{}</radius></sphere>",
    "plane": "<plane><normal>{} {} {}</normal><size>100 100</size></plane>",
}
_MESH = "<mesh><uri>{file}</uri><submesh><name>{part}</name></submesh></mesh>"
_HEIGHTMAP = (
    "<heightmap><uri>{file}</uri><size>{x} {y} {z}</size><pos>0 0 {bottom}</pos></heightmap>"
)


def write_sdf(
    name: str,
    bodies: Sequence[Body],
    comment: str = "",
    gravity_mps2: float = _GRAVITY_MPS2,
    stem: str = "",
) -> str:
    """Return an SDF file with a world that contains each body as a model.

    The file starts with ``comment``, which must not contain ``--``. It names the files that
    ``write_surfaces`` returns for the same ``stem`` (default: ``name``).
    """
    note = f"<!-- {comment} -->\n" if comment else ""
    gravity = ""
    if gravity_mps2 != _GRAVITY_MPS2:
        gravity = f"    <gravity>0 0 -{_format_exact(gravity_mps2)}</gravity>\n"
    files = _name_files(bodies, stem or name)
    models = "\n".join(_format_model(body, files) for body in bodies)
    text = _FRAME.format(comment=note, name=f'"{escape(name)}"', gravity=gravity, models=models)
    return errors.escape(text)


def write_surfaces(stem: str, bodies: Sequence[Body]) -> dict[str, bytes]:
    """Return the files named in the result of ``write_sdf``, by file name."""
    parts = list(_find("convex", bodies))
    files = {f"{stem}.obj": _format_obj(parts).encode()} if parts else {}
    fields = enumerate(_find("heightfield", bodies), start=1)
    return files | {f"{stem}_{i}.png": _encode_heights(field) for i, field in fields}


def _find(kind: str, bodies: Sequence[Body]) -> Iterator[Shape]:
    return (shape for body in bodies for shape in body.shapes if shape.kind == kind)


def _name_files(bodies: Sequence[Body], stem: str) -> dict[int, str]:
    """Return the XML that names the file of each geometry, by the ``id`` of its shape."""
    geometries = {
        id(shape): _MESH.format(file=escape(f"{stem}.obj"), part=_PART.format(i))
        for i, shape in enumerate(_find("convex", bodies), start=1)
    }
    for i, shape in enumerate(_find("heightfield", bodies), start=1):
        low, high = _height_range(shape)
        geometries[id(shape)] = _HEIGHTMAP.format(
            file=escape(f"{stem}_{i}.png"),
            x=_format_rounded(shape.size[0]),
            y=_format_rounded(shape.size[1]),
            z=_format_rounded(high - low if high > low else 1.0),  # height of white [m]; 1 if level
            bottom=_format_rounded(low),
        )
    return geometries


def _format_model(body: Body, files: dict[int, str]) -> str:
    solids = [
        _format_solid(place, shape, body.friction, files)
        for place, shape in enumerate(body.shapes, start=1)
    ]
    if body.mass is not None:
        moments = "" if body.inertia is None else _MOMENTS.format(*map(_format_exact, body.inertia))
        solids.insert(0, _INERTIAL.format(mass=_format_exact(body.mass), moments=moments))
    return _MODEL.format(
        name=f'"{escape(body.name.replace("::", "-"))}"',  # `::` separates the names in a path
        static="      <static>true</static>\n" if body.mass is None else "",
        pose=_format_pose(body.pose),
        content="\n".join(solids),
    )


def _format_solid(place: int, shape: Shape, friction: float, files: dict[int, str]) -> str:
    sizes = map(_format_rounded, shape.size)
    geometry = files.get(id(shape)) or GEOMETRY[shape.kind].format(*sizes)
    pose = "" if shape.pose == Pose() else f"          <pose>{_format_pose(shape.pose)}</pose>\n"
    return _SOLID.format(place=place, pose=pose, geometry=geometry, mu=_format_exact(friction))


def _format_pose(pose: Pose) -> str:
    return " ".join(map(_format_rounded, (*pose.position, *_compute_angles(pose))))


def _compute_angles(pose: Pose) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] of the rotation Rz(yaw) Ry(pitch) Rx(roll)."""
    m = pose.rotation.tolist()
    flat = math.hypot(m[0][0], m[1][0])
    pitch = elementary.atan2(-m[2][0], flat)
    if flat < 1e-6:  # nose straight up or down: roll and yaw have the same axis
        return 0.0, pitch, elementary.atan2(-m[0][1], m[1][1])
    return elementary.atan2(m[2][1], m[2][2]), pitch, elementary.atan2(m[1][0], m[0][0])


def _format_rounded(length: float) -> str:
    return f"{round(length, 9) + 0.0:.9f}".rstrip("0").rstrip(".")  # + 0.0 avoids -0


def _format_exact(value: float) -> str:
    return f"{value:.9g}"


def _format_obj(shapes: Iterable[Shape]) -> str:
    """Return an OBJ file with an object per polyhedron, in its own frame."""
    lines = ["# convex parts, in metres"]
    first = 1
    for count, shape in enumerate(shapes, start=1):
        solid = convex_polyhedron(shape.corners)
        lines.append(f"o {_PART.format(count)}")
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in solid.corners.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (solid.triangles + first).tolist()]
        first += len(solid.corners)
    return "\n".join(lines) + "\n"


def _height_range(shape: Shape) -> tuple[float, float]:
    heights = np.array(shape.heights)
    return float(heights.min()), float(heights.max())


def _encode_heights(shape: Shape) -> bytes:
    """Return heights as a 16-bit greyscale PNG, black to white; the first row is at maximum y."""
    low, high = _height_range(shape)
    levels = (np.array(shape.heights) - low) * (_WHITE / (high - low) if high > low else 0.0)
    rows = np.rint(levels[::-1]).astype(">u2")
    lines = b"".join(b"\0" + row.tobytes() for row in rows)  # 0: unfiltered row
    height, width = rows.shape
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, *_GREY_16)),
        (b"IDAT", zlib.compress(lines)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(map(_encode_chunk, *zip(*chunks, strict=True)))


def _encode_chunk(kind: bytes, content: bytes) -> bytes:
    check = struct.pack(">I", zlib.crc32(kind + content))
    return struct.pack(">I", len(content)) + kind + content + check


_NAME = re.compile(r"[\w-][\w.-]*")


def require_closed(path: Path) -> None:
    """Check that an SDF file has no xacro or includes, and names only files in its own folder."""
    content = path.read_bytes()
    problems = ["contains xacro, which is code"] if is_xacro(path, content) else []
    for element in () if problems else parse(content, str(path)).iter():
        text = (element.text or "").strip()
        if element.tag == "include":
            problems.append("includes another file")
        if element.tag in ("uri", "filename") and not _NAME.fullmatch(text):
            problems.append(f"names a file elsewhere, {text!r}")
    if problems:
        rule = "must be a world written by evoros"
        raise InputError(f"{path}: {rule}, but {problems[0]}; restore it from a copy")
