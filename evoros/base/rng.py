"""Random generators seeded by a mission's key and a part's name, so that parts are independent."""

import hashlib
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any

import numpy as np
from numpy.random import SeedSequence

from evoros.base import elementary

Size = int | tuple[int, ...] | None


class Generator(np.random.Generator):
    """numpy's generator, with normal and exponential deviates that are equal on all machines.

    This also holds for ``random``, ``uniform``, ``integers``, ``choice``, ``permutation``,
    ``permuted``, ``shuffle`` and ``bytes``, which use only arithmetic. Other distributions use the
    C library, whose last digits depend on the processor.
    """

    def __reduce__(self) -> Any:
        return Generator, (self.bit_generator,)

    def standard_normal(self, size: Size = None) -> Any:  # type: ignore[override]
        """Draw normal deviates with mean 0 and standard deviation 1."""
        from evoros.base.ziggurat import draw_normal  # slow: imports numba

        return self._fill(draw_normal, size)

    def standard_exponential(self, size: Size = None) -> Any:  # type: ignore[override]
        """Draw exponential deviates with mean 1."""
        from evoros.base.ziggurat import draw_exponential

        return self._fill(draw_exponential, size)

    def normal(self, loc: Any = 0.0, scale: Any = 1.0, size: Size = None) -> Any:  # type: ignore[override]
        """Draw normal deviates with mean ``loc`` and standard deviation ``scale``."""
        return loc + scale * self.standard_normal(_common_size(size, loc, scale))

    def exponential(self, scale: Any = 1.0, size: Size = None) -> Any:  # type: ignore[override]
        """Draw exponential deviates with mean ``scale``."""
        return scale * self.standard_exponential(_common_size(size, scale))

    def lognormal(self, mean: Any = 0.0, sigma: Any = 1.0, size: Size = None) -> Any:  # type: ignore[override]
        """Draw deviates with a normally distributed logarithm."""
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
    """Return ``size`` or, if None, the broadcast shape of the parameters."""
    if size is not None:
        return size
    return np.broadcast_shapes(*map(np.shape, parameters)) or None


def generator(key: str, part: str) -> Generator:
    """Return the generator of ``part`` under ``key`` (PCG64, seeded by SHA-256 of both)."""
    digest = hashlib.sha256(f"{key}\n{part}".encode()).digest()
    words = np.frombuffer(digest, dtype="<u4").tolist()
    return Generator(np.random.PCG64(SeedSequence(words)))


def deal(key: str, cards: int) -> Iterator[int]:
    """Yield numbers below ``cards`` from shuffled decks, one after another (lazy Fisher-Yates)."""
    for deck in count():
        rng = generator(f"{key}/{deck}", "deck")
        moved: dict[int, int] = {}  # cards that have left their initial position, by position
        for top in range(cards):
            place = top + int(rng.random() * (cards - top))
            yield moved.get(place, place)
            moved[place] = moved.pop(top, top)
