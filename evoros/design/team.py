"""The search space of robots that evolve together, each with its own design."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.design.space import DesignSpace
from evoros.design.views import view_slots
from evoros.optimizer.protocol import Block, View


@dataclass(frozen=True)
class TeamSpace:
    """The spaces of all designs of a team, by the robot's name, side by side in one genome.

    The genes of a robot that has a name, and its columns in tables, have the name as prefix. All
    methods that take a genome raise an InputError if it is not a vector of the closed unit cube.
    """

    spaces: Mapping[str, DesignSpace]

    @cached_property
    def _starts(self) -> Mapping[str, int]:
        """The index of each robot's first gene."""
        sizes = [space.size for space in self.spaces.values()]
        return dict(zip(self.spaces, accumulate(sizes, initial=0), strict=False))

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks of all robots."""
        return tuple(
            replace(block.move(self._starts[name].__add__), name=_prefix(name) + block.name)
            for name, space in self.spaces.items()
            for block in space.blocks
        )

    @property
    def size(self) -> int:
        """The number of genes."""
        return sum(space.size for space in self.spaces.values())

    @cached_property
    def levels(self) -> Mapping[int, int]:
        """The number of values of each gene that has a few, by its index."""
        return {
            self._starts[name] + gene: count
            for name, space in self.spaces.items()
            for gene, count in space.levels.items()
        }

    @property
    def middle(self) -> Array:
        """The genome in the middle of the spaces."""
        return np.concatenate([space.middle for space in self.spaces.values()])

    @property
    def slots(self) -> tuple[Block, ...]:
        """The genes of each placed sensor of the first robot with a design."""
        return self._first.slots

    @property
    def number(self) -> tuple[int, int]:
        """The minimum and the maximum number of sensors that it mounts, without twins."""
        return self._first.design.min_number, self._first.design.max_number

    @property
    def number_gene(self) -> int | None:
        """The gene of this number, if it evolves."""
        varies = self.number[0] < self.number[1]
        return self._first.blocks[len(self.slots)].genes[0] if varies else None

    def view(self, genome: Array, distance_m: float) -> tuple[list[View], View]:
        """Return what each slot sees at a distance, and what fixed sensors see.

        Raises:
            InputError: several robots have a design of their own.
        """
        if len(self.spaces) > 1:
            raise InputError(
                f"optimizer: must have one robot whose sensors it covers bearings with, not "
                f"{len(self.spaces)} with designs of their own; choose another optimizer"
            )
        return view_slots(self._first, genome, distance_m)

    @property
    def _first(self) -> DesignSpace:
        return next(iter(self.spaces.values()))

    def decode(self, genome: Array) -> Design:
        """Return the designs at ``genome`` (size,), values from 0 to 1."""
        return Design.join(
            {name: self.spaces[name].decode(part) for name, part in self._split(genome)}
        )

    def same(self, first: Array, second: Array) -> bool:
        """Return whether two genomes decode to equal designs."""
        return self.decode(first) == self.decode(second)

    def to_row(self, genome: Array) -> dict[str, float | str]:
        """Return the decoded values for a table, by column."""
        return {
            _prefix(name) + column: value
            for name, part in self._split(genome)
            for column, value in self.spaces[name].to_row(part).items()
        }

    def find_configured(self, name: str) -> Design | None:
        """Return the design of a robot that its configuration alone determines, if any."""
        space = self.spaces[name]
        return None if space.size else space.decode(np.empty(0))

    def complete(self, design: Design) -> Design:
        """Add the configured design of each robot that has one of its own and lacks it.

        Raises:
            InputError: such a design leaves something to evolve, so that the configuration does
                not determine it.
        """
        parts = dict(design.parts)
        for name in self.spaces:
            configured = parts.get(name) or self.find_configured(name)
            if configured is None:
                raise InputError(
                    f"agents.{name}.design: must leave nothing to evolve (number 0, no genes) for "
                    f"a design that has none for this robot; set agents.{name}.design.number=0, or "
                    f"give a file with rows of the agent {name}"
                )
            parts[name] = configured
        return Design.join(parts)

    def _split(self, genome: Array) -> Iterator[tuple[str, Array]]:
        """Yield each robot's part of a genome; the last part has any surplus values."""
        parts = np.split(np.asarray(genome, dtype=np.float64), list(self._starts.values())[1:])
        return zip(self.spaces, parts, strict=True)


def _prefix(name: str) -> str:
    """Return the prefix of the genes and columns of a robot."""
    return f"{name}." if name else ""
