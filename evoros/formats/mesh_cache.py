"""The cache of meshes divided into convex parts: a file for each, in the user's cache folder.

A cache that is missing, damaged or read-only only costs time.
"""

import json
import os
import tempfile
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from evoros.geometry.shapes import Vector

VERSION = 1  # changes with the algorithm


@dataclass(frozen=True)
class Division:
    """The convex parts of a mesh."""

    parts: tuple[tuple[Vector, ...], ...]  # the corners [m] of each part
    dropped: int  # number of parts that are too small to count
    deviation_m: float  # largest distance of the mesh's surface from the parts'


def load(key: str) -> Division | None:
    """Return the parts stored under a key; None if there are none."""
    with suppress(OSError, ValueError, TypeError, KeyError, RecursionError):
        stored = json.loads(_file(key).read_text())
        parts = tuple(
            tuple((float(x), float(y), float(z)) for x, y, z in part) for part in stored["parts"]
        )
        if parts and all(len(part) >= 4 for part in parts):
            return Division(parts, int(stored["dropped"]), float(stored["deviation_m"]))
    return None


def store(key: str, division: Division) -> None:
    """Store parts under a key, all or nothing, for this and other processes."""
    file = _file(key)
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.NamedTemporaryFile("w", dir=file.parent, delete=False) as unfinished:
            json.dump(asdict(division), unfinished)
        os.replace(unfinished.name, file)


def _file(key: str) -> Path:
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(home) / "evoros" / "meshes" / f"{VERSION}-{key}.json"
