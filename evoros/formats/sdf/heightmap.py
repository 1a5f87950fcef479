"""A height field from an image, as Gazebo makes it."""

from pathlib import Path

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.formats.sdf.reading import Reading
from evoros.formats.strict_xml import element_error, find_child, read_numbers, read_text
from evoros.geometry.shapes import Pose, Shape

_MAX_PIXELS = 2049


def read_heightmap(heightmap: Element, reading: Reading) -> Shape:
    """Read a height field: its brightest pixel is at the height ``<size>`` states, black at 0.

    The first row of the image is that of the greatest y.

    Raises:
        InputError: the image is missing or cannot be read.
    """
    element = find_child(heightmap, "uri")
    if element is None:
        element = find_child(heightmap, "filename")
    if element is None:
        raise element_error(heightmap, "must have a <uri>", "name an image in grey scale")
    uri = read_text(element)
    place = reading.addresses.find(uri, reading.folder_of(element))
    if place is None:
        problem, fix = reading.addresses.explain(uri, reading.folder_of(element))
        raise element_error(element, problem, fix)
    levels = _read_levels(place, element, reading)
    size_element, position_element = find_child(heightmap, "size"), find_child(heightmap, "pos")
    size = (1.0, 1.0, 1.0) if size_element is None else read_numbers(size_element, 3)
    position = (0.0, 0.0, 0.0) if position_element is None else read_numbers(position_element, 3)
    if size_element is not None and (min(size[:2]) <= 0 or size[2] == 0):
        raise element_error(size_element, "must be greater than 0", "write three positive lengths")
    highest = float(levels.max()) or 1.0
    if size[2] < 0:  # Gazebo inverts the image
        levels = highest - levels
    heights = levels[::-1] * (abs(size[2]) / highest)
    x, y, z = position
    rows = tuple(tuple(row) for row in heights.tolist())
    return Shape("heightfield", size[:2], Pose((x, y, z)), heights=rows)


def _read_levels(file: Path, element: Element, reading: Reading) -> Array:
    """Return the levels of an image's pixels, (rows, columns)."""
    from io import BytesIO

    from PIL import Image

    try:
        with Image.open(BytesIO(reading.read(file))) as image:
            if max(image.size) > _MAX_PIXELS:
                problem = f"has {image.size[0]} x {image.size[1]} pixels ({file})"
                raise element_error(element, problem, f"reduce it to {_MAX_PIXELS} at most")
            deep = image.mode in ("I", "F") or image.mode.startswith("I;16")
            levels = np.array(image if deep else image.convert("RGB").getchannel("R"))
    except (OSError, SyntaxError, ValueError) as error:
        problem = f"must name an image, but {file} cannot be read ({error})"
        raise element_error(element, problem, "convert it to PNG in grey scale") from None
    if levels.ndim != 2 or min(levels.shape) < 2:
        problem = f"must name an image of at least 2 x 2 pixels ({file})"
        raise element_error(element, problem, "give a larger image")
    return levels.astype(np.float64)
