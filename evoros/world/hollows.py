"""Finds the insides of hollow solids, such as a dam drawn as a shell, where no robot drives."""

import math
from collections.abc import Sequence
from itertools import compress

import numpy as np
import scipy

from evoros.base.arrays import Array
from evoros.geometry.footprint import Footprint, distances, project_bodies, project_shape
from evoros.geometry.free_space import CELL_M, FreeSpace, label_regions
from evoros.geometry.shapes import Body

_MOST_CELLS = 400  # maximum number of cells per side of the search grid
_SAMPLES = 200  # maximum number of places at which a roof is looked for
_ROOFED = 0.95  # minimum fraction of these places that lie below a roof


def fill_hollow(bodies: Sequence[Body], point: Array, height_m: float) -> list[Footprint]:
    """Return rectangles that fill the hollow around a point (2,) [m]; empty outside hollows.

    A single fixed body encloses and roofs a hollow, which contains nothing else up to a height [m].
    A room, in contrast, has a door or furniture, or several bodies enclose it.
    """
    for body in bodies:
        low, high = body.boxes[:, 0].min(axis=0), body.boxes[:, 1].max(axis=0)
        inside = (low[:2] < point).all() and (point < high[:2]).all()
        inside = inside and bool(np.isfinite([low, high]).all())  # a plane encloses nothing
        if inside and high[2] > height_m and body.mass is None and len(body.shapes) > 1:
            space = _find_enclosure(body, low[:2], high[:2], point, height_m)
            places = space.centres()
            others = (other for other in bodies if other is not body)
            if len(places) and _is_roofed(body, places, height_m):
                around = project_bodies(others, height_m, places)
                if not any((distances(area, places) == 0.0).any() for area in around):
                    return _list_rows(space)
    return []


def _find_enclosure(
    body: Body, low: Array, high: Array, point: Array, height_m: float
) -> FreeSpace:
    """Return the free region around a point; empty if the region is open or contains an object."""
    cell = max(CELL_M, float((high - low).max()) / _MOST_CELLS)
    areas = project_bodies([body], height_m)
    space = FreeSpace.within(low - 2 * cell, high + 2 * cell, areas, cell, cell_m=cell)
    labels, places = label_regions(space.free), np.argwhere(space.free)
    offsets = places - np.floor((point - space.low) / cell)[::-1]  # rows, columns
    row, column = places[(offsets**2).sum(axis=1).argmin()]  # coarse cells block more than walls
    region = space.free & (labels == labels[row, column])
    whole = scipy.ndimage.binary_fill_holes(region)
    is_closed = not (region[0, 0] or (whole & ~region).any())
    space.free[:] = region & is_closed
    return space


def _is_roofed(body: Body, places: Array, height_m: float) -> bool:
    places = places[:: 1 + len(places) // _SAMPLES]
    (x0, y0), (x1, y1) = places.min(axis=0), places.max(axis=0)
    above = body.reach((x0, y0, height_m), (x1, y1, math.inf))
    covered = np.zeros(len(places), dtype=np.bool_)
    for shape, pose in compress(body.placed, above):
        covered |= distances(project_shape(shape, pose, height_m), places) == 0.0
    return bool(covered.mean() >= _ROOFED)


def _list_rows(space: FreeSpace) -> list[Footprint]:
    """Cover each row of free cells with rectangles, which end at the neighbouring cells."""
    rectangles = []
    for row, strip in enumerate(space.free):
        ends = np.flatnonzero(np.diff(np.r_[False, strip, False].astype(int)))
        for first, last in ends.reshape(-1, 2).tolist():
            corners = [(first, row), (last, row), (last, row + 1), (first, row + 1)]
            rectangles.append(Footprint(space.low + space.cell_m * np.array(corners, dtype=float)))
    return rectangles
