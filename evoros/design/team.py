"""The search space of robots that evolve together, each with a design of its own."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from evoros.base.arrays import Array
from evoros.design.design import Design
from evoros.design.space import DesignSpace
from evoros.optimizer.protocol import Aspect, Block


@dataclass(frozen=True)
class TeamSpace:
    """The spaces of the first robot and of the others, side by side in one genome.

    The genes of another robot, and its columns in tables, have its name before them.
    """

    first: DesignSpace
    others: Mapping[str, DesignSpace]

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the first robot, and then those of each other one."""
        blocks = list(self.first.blocks)
        start = self.first.size
        for name, space in self.others.items():
            blocks += (_move_block(block, name, start) for block in space.blocks)
            start += space.size
        return tuple(blocks)

    @property
    def size(self) -> int:
        """The number of genes."""
        return self.first.size + sum(space.size for space in self.others.values())

    @cached_property
    def levels(self) -> Mapping[int, int]:
        """The number of values of each gene that has but a few, by its index."""
        levels = dict(self.first.levels)
        start = self.first.size
        for space in self.others.values():
            levels |= {start + gene: count for gene, count in space.levels.items()}
            start += space.size
        return levels

    def decode(self, genome: Array) -> Design:
        """Return the designs at ``genome`` (size,), values from 0 to 1.

        Raises:
            InputError: the genome is not a vector of the closed unit cube.
        """
        (_, first), *others = self._split(genome)
        designs = {name: self.others[name].decode(part) for name, part in others}
        return replace(self.first.decode(first), agents=designs)

    def same(self, first: Array, second: Array) -> bool:
        """Return whether two genomes decode to equal designs.

        Raises:
            InputError: one of them is not a vector of the closed unit cube.
        """
        return self.decode(first) == self.decode(second)

    def to_row(self, genome: Array) -> dict[str, float | str]:
        """Return the decoded values for a table, by column.

        Raises:
            InputError: the genome is not a vector of the closed unit cube.
        """
        (_, first), *others = self._split(genome)
        row = self.first.to_row(first)
        for name, part in others:
            values = self.others[name].to_row(part)
            row |= {f"{name}.{column}": value for column, value in values.items()}
        return row

    def _split(self, genome: Array) -> Iterator[tuple[str, Array]]:
        """Yield each robot's part of a genome; the last one has what is too much, if anything."""
        rest = np.asarray(genome, dtype=np.float64)
        spaces = {"": self.first, **self.others}
        for name, space in spaces.items():
            end = len(rest) if name == list(spaces)[-1] else space.size
            yield name, rest[:end]
            rest = rest[end:]


def _move_block(block: Block, name: str, start: int) -> Block:
    """Return a block whose genes come ``start`` places later."""

    def move(genes: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(gene + start for gene in genes)

    aspects = tuple(
        Aspect(each.name, move(each.continuous), move(each.categorical)) for each in block.aspects
    )
    return Block(f"{name}.{block.name}", aspects)
