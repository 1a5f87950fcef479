"""The search space of robots that evolve together, each with a separate design."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.design.space import DesignSpace
from evoros.optimizer.protocol import Block, View
from evoros.robot.seen import find_seen
from evoros.sensor.protocol import Mount, add_prices


@dataclass(frozen=True)
class TeamSpace:
    """The design spaces of a team, concatenated; columns have a robot's name as a prefix."""

    spaces: Mapping[str, DesignSpace]

    @cached_property
    def _starts(self) -> Mapping[str, int]:
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
        """The number of levels of each discrete gene, by gene index."""
        return {
            self._starts[name] + gene: count
            for name, space in self.spaces.items()
            for gene, count in space.levels.items()
        }

    @property
    def middle(self) -> Array:
        """The genome at the centre of all spaces."""
        return np.concatenate([space.middle for space in self.spaces.values()])

    @property
    def slots(self) -> tuple[Block, ...]:
        """The blocks of sensors placed on the first robot that has a design."""
        return self._first.slots

    @property
    def number(self) -> tuple[int, int]:
        """Minimum and maximum number of placed sensors of the first robot, without twins."""
        return self._first.design.min_number, self._first.design.max_number

    @property
    def number_gene(self) -> int | None:
        """The index of the gene for the number of placed sensors; None if the number is fixed."""
        varies = self.number[0] < self.number[1]
        return self._first.blocks[len(self.slots)].genes[0] if varies else None

    def view(self, genome: Array, distance_m: float) -> tuple[list[View], View]:
        """Return what each slot and the fixed sensors see at a distance [m]."""
        if len(self.spaces) > 1:
            raise InputError(
                f"optimizer: set_cover supports only one robot with a design, not "
                f"{len(self.spaces)}; choose another optimizer"
            )
        space, sensors = self._first, self._first.design.sensors

        def look(mounts: Sequence[Mount], place: str = "") -> View:
            seen = find_seen(space.robot.with_sensors(mounts, sensors), distance_m)
            return View(seen.sum(axis=0, dtype=np.int64), add_prices(mounts, sensors), place)

        views = [
            look(mounts, region if space.design.exclusive else "")
            for mounts, region in space.mount_slots(genome)
        ]
        return views, look(space.fixed)

    @property
    def _first(self) -> DesignSpace:
        return next(iter(self.spaces.values()))

    def decode(self, genome: Array) -> Design:
        """Decode ``genome`` (size,), with values from 0 to 1, into designs."""
        parts = self._split(genome)
        return Design.join({name: self.spaces[name].decode(part) for name, part in parts})

    def same(self, first: Array, second: Array) -> bool:
        """Return True if two genomes decode to equal designs."""
        return self.decode(first) == self.decode(second)

    def to_row(self, genome: Array) -> dict[str, float | str]:
        """Return the decoded values as a table row, keyed by column."""
        return {
            _prefix(name) + column: value
            for name, part in self._split(genome)
            for column, value in self.spaces[name].to_row(part).items()
        }

    def find_configured(self, name: str) -> Design | None:
        """Return the design of a robot if nothing in it evolves, otherwise None."""
        space = self.spaces[name]
        return None if space.size else space.decode(np.empty(0))

    def complete(self, design: Design) -> Design:
        """Add missing designs of robots for which nothing evolves."""
        parts = dict(design.parts)
        for name in self.spaces:
            configured = parts.get(name) or self.find_configured(name)
            if configured is None:
                raise InputError(
                    f"agents.{name}.design: must leave nothing to evolve (number 0, no genes), "
                    "because the given designs include none for this robot; set "
                    f"agents.{name}.design.number=0, or give a file with rows for the agent "
                    f"{name}"
                )
            parts[name] = configured
        return Design.join(parts)

    def _split(self, genome: Array) -> Iterator[tuple[str, Array]]:
        """Yield (robot name, part of the genome); the last part includes surplus values."""
        parts = np.split(np.asarray(genome, dtype=np.float64), list(self._starts.values())[1:])
        return zip(self.spaces, parts, strict=True)


def _prefix(name: str) -> str:
    return f"{name}." if name else ""
