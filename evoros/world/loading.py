"""Reads a world from an SDF file."""

import hashlib
import logging
from pathlib import Path

from evoros.base.resources import find_file
from evoros.formats.sdf.reader import read_sdf
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.course import Course
from evoros.world.model import World


def load_world(sdf: str, course: Course) -> World:
    """The world of an SDF file; a level ground is added if the file has none.

    ``sdf`` is a path, or relative to the bundled ``worlds``. The world's name, in messages, is the
    file's; tables name it by its key in the configuration.

    Raises:
        InputError: no such file, an element that cannot be used, a waypoint in an obstacle.
    """
    path = find_file(sdf, "worlds")
    content = path.read_bytes()
    bodies = read_sdf(content, sdf)
    if not any(body.is_ground for body in bodies):
        logging.getLogger(__name__).warning("%s: no plane: level ground is added", sdf)
        bodies = (Body("ground", Pose(), (Shape("plane", (0.0, 0.0, 1.0)),)), *bodies)
    return World(Path(sdf).stem, bodies, course, sdf, hashlib.sha256(content).hexdigest())
