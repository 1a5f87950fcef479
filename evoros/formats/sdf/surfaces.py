"""The files beside a written SDF file: polyhedra as one OBJ file, each height field as an image."""

import struct
import zlib
from collections.abc import Iterable

import numpy as np

from evoros.geometry.polyhedron import convex_polyhedron
from evoros.geometry.shapes import Shape

_WHITE = 65535  # of 16 bits
_GREY_16 = (16, 0, 0, 0, 0)  # depth, colour type, compression, filter, interlacing of a PNG


def name_part(number: int) -> str:
    """Return the name of a polyhedron in the OBJ file, by its number from 1."""
    return f"part_{number}"


def format_obj(shapes: Iterable[Shape]) -> str:
    """Return an OBJ file with an object for each polyhedron, in its own frame."""
    lines = ["# convex parts, in metres"]
    first = 1
    for number, shape in enumerate(shapes, start=1):
        solid = convex_polyhedron(shape.corners)
        lines.append(f"o {name_part(number)}")
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in solid.corners.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (solid.triangles + first).tolist()]
        first += len(solid.corners)
    return "\n".join(lines) + "\n"


def height_range(shape: Shape) -> tuple[float, float]:
    """Return the lowest and the highest height [m] of a height field."""
    heights = np.array(shape.heights)
    return float(heights.min()), float(heights.max())


def encode_heights(shape: Shape) -> bytes:
    """Return the heights of a field as a grey PNG image of 16 bits, black to white, north up.

    Heights are rounded to a 65535th of their range.
    """
    low, high = height_range(shape)
    levels = (np.array(shape.heights) - low) * (_WHITE / (high - low) if high > low else 0.0)
    rows = np.rint(levels[::-1]).astype(">u2")
    lines = b"".join(b"\0" + row.tobytes() for row in rows)  # 0: this row has no filter
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
