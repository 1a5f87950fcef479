"""Reads a world from an SDF file."""

import hashlib
from pathlib import Path

from evoros.base.resources import find_file
from evoros.formats.sdf.reader import read_sdf
from evoros.world.course import Course
from evoros.world.floors import settle
from evoros.world.model import World


def load_world(sdf: str, course: Course) -> World:
    """Load the world of an SDF file, and add level ground if the file has none.

    ``sdf`` is a path, which may be relative to the bundled folder ``worlds``. In messages the world
    has the name of its file; tables name it by its key in the configuration.

    Raises:
        InputError: the file is missing or has an unsupported element, or a waypoint lies in an
            obstacle.
    """
    path = find_file(sdf, "worlds")
    content = path.read_bytes()
    bodies = read_sdf(content, sdf)
    bodies = settle(bodies, course, sdf)
    return World(Path(sdf).stem, bodies, course, sdf, hashlib.sha256(content).hexdigest())
