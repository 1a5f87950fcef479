"""Random draws by name: a generator from the key of a mission and the name of a part.

A part's stream depends on nothing but these two, so adding a part never shifts another's draws
and one row of a table can be replayed alone.
"""

import hashlib
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import SeedSequence

from evoros.base import elementary

Size = int | tuple[int, ...] | None


class Generator(np.random.Generator):
    """numpy's generator, whose normal and exponential deviates have the same bits everywhere.

    So have ``random``, ``uniform``, ``integers``, ``choice``, ``permutation``, ``permuted``,
    ``shuffle`` and ``bytes``, which need no more than arithmetic. Other distributions ask the C
    library, whose last digits depend on the processor.
    """

    def __reduce__(self) -> Any:
        return Generator, (self.bit_generator,)

    def standard_normal(self, size: Size = None) -> Any:  # type: ignore[override]
        """Draw deviates of mean 0 and standard deviation 1."""
        from evoros.base.ziggurat import draw_normal  # numba, which it needs, imports slowly

        return self._fill(draw_normal, size)

    def standard_exponential(self, size: Size = None) -> Any:  # type: ignore[override]
        """Draw deviates of mean 1."""
        from evoros.base.ziggurat import draw_exponential

        return self._fill(draw_exponential, size)

    def normal(self, loc: Any = 0.0, scale: Any = 1.0, size: Size = None) -> Any:  # type: ignore[override]
        """Draw normal deviates of mean ``loc`` and standard deviation ``scale``."""
        return loc + scale * self.standard_normal(_common_size(size, loc, scale))

    def exponential(self, scale: Any = 1.0, size: Size = None) -> Any:  # type: ignore[override]
        """Draw exponential deviates of mean ``scale``."""
        return scale * self.standard_exponential(_common_size(size, scale))

    def lognormal(self, mean: Any = 0.0, sigma: Any = 1.0, size: Size = None) -> Any:  # type: ignore[override]
        """Draw deviates whose logarithm is normal."""
        normal = self.normal(mean, sigma, size)
        if np.ndim(normal) == 0:
            return elementary.exp(float(normal))
        return np.reshape([elementary.exp(x) for x in normal.ravel().tolist()], normal.shape)

    def _fill(self, draw: Callable[[np.random.BitGenerator], float], size: Size) -> Any:
        bits = self.bit_generator
        if size is None:
            return draw(bits)
        shape = (size,) if isinstance(size, int | np.integer) else tuple(size)
        values = np.empty(shape)
        flat = values.reshape(-1)
        for i in range(flat.size):
            flat[i] = draw(bits)
        return values


def _common_size(size: Size, *parameters: Any) -> Size:
    """Return the size, or the shape that the parameters have together."""
    if size is not None:
        return size
    return np.broadcast_shapes(*map(np.shape, parameters)) or None


def generator(key: str, part: str) -> Generator:
    """The generator of ``part`` under ``key`` (PCG64, seeded by SHA-256 of both)."""
    digest = hashlib.sha256(f"{key}\n{part}".encode()).digest()
    words = np.frombuffer(digest, dtype="<u4").tolist()
    return Generator(np.random.PCG64(SeedSequence(words)))
