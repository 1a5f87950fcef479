"""Height fields of SDF files, built from images as Gazebo does."""

import struct
from pathlib import Path

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.formats.missing import MissingFileError
from evoros.formats.sdf.inclusion import CHOICES, find_uri, require_file
from evoros.formats.sdf.reading import Reading
from evoros.formats.strict_xml import element_error, read_child_numbers, require_child
from evoros.geometry.shapes import Pose, Shape

_MAX_PIXELS = 2049
_MAP_TAGS = {33550, 33922, 34264, 34735}  # map scale, tie points, transformation and keys


def read_heightmap(heightmap: Element, reading: Reading) -> Shape:
    """Read a height field; ``<size>`` gives the height of white, and the first row is at +y."""
    element = find_uri(heightmap)
    if element is None:
        raise element_error(heightmap, "must have a <uri>", "name a grey-scale image")
    levels = _read_levels(require_file(element, reading), element, reading)
    size = read_child_numbers(heightmap, "size", (1.0, 1.0, 1.0))
    x, y, z = read_child_numbers(heightmap, "pos", (0.0, 0.0, 0.0))
    if min(size[:2]) <= 0 or size[2] == 0:
        given, problem = require_child(heightmap, "size"), "must be above 0 in x and y, not 0 in z"
        raise element_error(given, problem, "write three positive lengths")
    highest = float(levels.max()) or 1.0
    if size[2] < 0:  # Gazebo inverts the image
        levels = highest - levels
    heights = levels[::-1] * (abs(size[2]) / highest)
    rows = tuple(tuple(row) for row in heights.tolist())
    return Shape("heightfield", size[:2], Pose((x, y, z)), heights=rows)


def is_geotiff(content: bytes) -> bool:
    """Return True if a file is a TIFF with map coordinates, as digital elevation models are."""
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(content[:4])
    if order is None:
        return False
    try:
        (start,) = struct.unpack_from(f"{order}I", content, 4)
        (count,) = struct.unpack_from(f"{order}H", content, start)
        places = range(start + 2, start + 2 + 12 * count, 12)
        tags = {struct.unpack_from(f"{order}H", content, place)[0] for place in places}
        return bool(tags & _MAP_TAGS)
    except struct.error:
        return False


def _read_levels(file: Path, element: Element, reading: Reading) -> Array:
    from io import BytesIO

    from PIL import Image, UnidentifiedImageError

    content = reading.read(file)
    if is_geotiff(content):
        problem = f"names a GeoTIFF, {file}, which holds heights in metres, not an image"
        fix = (
            "convert the GeoTIFF to an image with gdal_translate -ot UInt16 -scale -of PNG "
            f"{file.name} {file.stem}.png, and set <size> to the extent and height range of the "
            "GeoTIFF"
        )
        raise MissingFileError(str(element_error(element, problem, f"{fix}; or {CHOICES}")))
    try:
        with Image.open(BytesIO(content)) as image:
            if max(image.size) > _MAX_PIXELS:
                problem = f"names an image of {image.size[0]} x {image.size[1]} pixels ({file})"
                raise element_error(
                    element, problem, f"reduce the image to at most {_MAX_PIXELS} pixels per side"
                )
            deep = image.mode in ("I", "F") or image.mode.startswith("I;16")
            levels = np.array(image if deep else image.convert("RGB").getchannel("R"))
    except (OSError, SyntaxError, ValueError) as error:
        unknown = isinstance(error, UnidentifiedImageError)
        reason = "has no known format" if unknown else f"cannot be read ({error})"
        problem = f"must name an image, but {file} {reason}"
        fix = f"convert the file to a grey-scale PNG; or {CHOICES}"
        raise MissingFileError(str(element_error(element, problem, fix))) from None
    if levels.ndim != 2 or min(levels.shape) < 2:
        problem = f"must name an image of at least 2 x 2 pixels ({file})"
        raise element_error(element, problem, "use a larger image")
    return levels.astype(np.float64)
