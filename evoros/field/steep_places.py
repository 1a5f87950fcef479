"""Places of a height field that are too steep for a suggested course."""

import numpy as np

from evoros.geometry.footprint import Footprint, convex_hull
from evoros.geometry.shapes import Pose, Shape

MAX_SLOPE = 0.25  # rise by run of the ground under a course
_MOST_CELLS = 64  # along each side, into which a finer field is gathered


def find_steep_places(field: Shape, pose: Pose) -> list[Footprint]:
    """Return rectangles that cover all cells of a height field with a steep edge."""
    heights = np.array(field.heights, dtype=np.float64)
    rows, columns = (count - 1 for count in heights.shape)
    length_x, length_y = field.size
    along_x = np.abs(np.diff(heights, axis=1)) > MAX_SLOPE * length_x / columns
    along_y = np.abs(np.diff(heights, axis=0)) > MAX_SLOPE * length_y / rows
    steep = along_x[:-1] | along_x[1:] | along_y[:, :-1] | along_y[:, 1:]
    step = -(-max(rows, columns) // _MOST_CELLS)
    places = []
    for row in range(0, rows, step):
        strip = steep[row : row + step].any(axis=0)
        ends = np.flatnonzero(np.diff(np.r_[False, strip, False].astype(int)))
        for first, last in ends.reshape(-1, 2).tolist():
            x = [length_x * (column / columns - 0.5) for column in (first, last)]
            y = [length_y * (edge / rows - 0.5) for edge in (row, min(row + step, rows))]
            corners = [pose.transform((a, b, 0.0))[:2] for a in x for b in y]
            places.append(Footprint(convex_hull(np.array(corners))))
    return places
