"""Helpers for searches that wrap a library: seeds, and conversion of levels to gene values."""

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.optimizer.protocol import Space


def draw_seed(rng: Generator) -> int:
    """Draw a seed for a library's random generator."""
    return int(rng.integers(2**31))


def list_categories(space: Space) -> list[int]:
    """Return the categorical genes, that is, those with unordered levels."""
    aspects = (aspect for block in space.blocks for aspect in block.aspects)
    return sorted(gene for aspect in aspects for gene in aspect.categorical)


def place_level(level: Array | int, count: Array | int) -> Array:
    """Return the gene value in the middle of one of ``count`` levels."""
    return np.asarray((np.asarray(level) + 0.5) / np.asarray(count), dtype=float)
