"""Where the genes of a design space are in its genome."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from evoros.design.genes import Gene, group_genes
from evoros.design.protocol import ANGLES, POSITION, BoundRegion
from evoros.optimizer.protocol import Aspect, Block


@dataclass(frozen=True)
class Layout:
    """The genes of placed sensors, of their number and of other values, one after another.

    What does not vary has no gene.
    """

    slots: tuple[str, ...]  # names of the placed sensors
    types: int  # number of types among which each of them chooses
    regions: Mapping[str, BoundRegion]
    numbers: int  # number of values of their number
    genes: Mapping[str, Gene]

    @property
    def blocks(self) -> tuple[Block, ...]:
        """One for each placed sensor, for their count if it evolves, and for each gene group."""
        return self._blocks_and_index[0]

    @property
    def index(self) -> Mapping[str, int]:
        """The index of each gene by its name."""
        return self._blocks_and_index[1]

    @cached_property
    def _blocks_and_index(self) -> tuple[tuple[Block, ...], dict[str, int]]:
        index: dict[str, int] = {}

        def add_genes(*names: str) -> tuple[int, ...]:
            return tuple(index.setdefault(name, len(index)) for name in names)

        def add_sensor(slot: str) -> Block:
            kind = add_genes(f"{slot}_type") if self.types > 1 else ()
            region = add_genes(f"{slot}_region") if len(self.regions) > 1 else ()
            position = add_genes(*(f"{slot}_{name}" for name in POSITION if self.varies(name)))
            angle = add_genes(*(f"{slot}_{name}" for name in ANGLES if self.varies(name)))
            place = Aspect("place", position, region)
            aspects = (Aspect("type", (), kind), place, Aspect("angle", angle))
            return Block(slot, tuple(a for a in aspects if a.continuous or a.categorical))

        blocks = [add_sensor(slot) for slot in self.slots]
        if self.numbers > 1:
            blocks.append(Block("number", (Aspect("number", add_genes("number")),)))
        for title, names in group_genes(self.genes).items():
            blocks.append(Block(title, tuple(Aspect(name, add_genes(name)) for name in names)))
        return tuple(block for block in blocks if block.genes), index

    @cached_property
    def levels(self) -> Mapping[int, int]:
        """The number of values of each gene that has a few, by its index."""
        counts = {"number": self.numbers}
        counts |= {f"{slot}_type": self.types for slot in self.slots}
        counts |= {f"{slot}_region": len(self.regions) for slot in self.slots}
        for name, gene in self.genes.items():
            if gene.whole:
                counts[name] = int(gene.high - gene.low) + 1
        return {self.index[name]: count for name, count in counts.items() if name in self.index}

    def varies(self, name: str) -> bool:
        """Whether a value of a place, such as ``yaw_deg``, differs within a region."""
        ranges = (region.ranges.get(name, (0.0, 0.0)) for region in self.regions.values())
        return any(low < high for low, high in ranges)
