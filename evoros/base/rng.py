"""Random draws by name: a generator from the key of a mission and the name of a part.

A part's stream depends on nothing but these two, so adding a part never shifts another's draws
and one row of a table can be replayed alone.
"""

import hashlib

import numpy as np
from numpy.random import Generator, SeedSequence


def generator(key: str, part: str) -> Generator:
    """The generator of ``part`` under ``key`` (PCG64, seeded by SHA-256 of both)."""
    digest = hashlib.sha256(f"{key}\n{part}".encode()).digest()
    words = np.frombuffer(digest, dtype="<u4").tolist()
    return np.random.Generator(np.random.PCG64(SeedSequence(words)))
