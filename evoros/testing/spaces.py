"""Small search spaces, and scores that depend on the genome alone."""

from dataclasses import dataclass

import numpy as np

from evoros.base.arrays import Array
from evoros.optimizer.protocol import Aspect, Block, Goals, Individual, Score, View


@dataclass(frozen=True)
class SensorSpace:
    """A space like the case study's: a region, two coordinates and an angle a sensor."""

    count: int = 3

    @property
    def size(self) -> int:
        """Four genes a sensor."""
        return 4 * self.count

    @property
    def blocks(self) -> tuple[Block, ...]:
        """A block for each sensor."""
        return tuple(
            Block(f"{i}", (Aspect("place", (i + 1, i + 2), (i,)), Aspect("angle", (i + 3,))))
            for i in range(0, self.size, 4)
        )

    @property
    def levels(self) -> dict[int, int]:
        """Five regions."""
        return dict.fromkeys(range(0, self.size, 4), 5)

    @property
    def slots(self) -> tuple[Block, ...]:
        """All blocks."""
        return self.blocks

    @property
    def number(self) -> tuple[int, int]:
        """All of them are mounted."""
        return self.count, self.count

    @property
    def number_gene(self) -> None:
        """Their number does not evolve."""

    def view(self, genome: Array, distance_m: float) -> tuple[list[View], View]:
        """Return that a sensor sees 60 deg about the heading of its angle, at any distance."""
        bearings = np.arange(360) - 179.5
        headings = 180.0 * (genome[3::4] - 0.5)
        seen = np.abs(bearings - headings[:, np.newaxis]) <= 30.0
        return [View(row.astype(np.int64), 1.0) for row in seen], View(np.zeros(360, np.int64), 0.0)

    def same(self, one: Array, other: Array) -> bool:
        """Whether all genes are equal."""
        return np.array_equal(one, other)


@dataclass(frozen=True)
class OneGene(SensorSpace):
    """A space of one gene."""

    @property
    def size(self) -> int:
        """One."""
        return 1

    @property
    def blocks(self) -> tuple[Block, ...]:
        """One block of it."""
        return (Block("value", (Aspect("value", (0,)),)),)

    @property
    def slots(self) -> tuple[Block, ...]:
        """No sensor."""
        return ()

    @property
    def levels(self) -> dict[int, int]:
        """None: it is continuous."""
        return {}


THREE_SENSORS = SensorSpace(3)
GOALS = Goals(("first", "second"), {"one": (0.0, 1.0), "two": (0.0, 1.0)})


def sphere(individual: Individual) -> float:
    """Return a fitness that is highest, 0, in the middle of the cube."""
    return -float(np.sum((individual.genome - 0.5) ** 2))


def rate(individual: Individual, fitness: float) -> Score:
    """Return a score with objectives and a descriptor that depend on the genome."""
    genome = individual.genome
    ends = (float(genome[0]), float(genome[-1])) if len(genome) else (0.0, 0.0)
    return Score(fitness, (fitness, ends[0]), ends)
