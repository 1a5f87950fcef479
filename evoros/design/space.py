"""The design space, in which every point of the unit cube decodes to an allowed design."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import Annotated

import numpy as np

from evoros.base import checks
from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.design.genes import Gene, check_gene_names, group_genes
from evoros.design.protocol import ANGLES, POSITION, BoundRegion, RegionDescription, check_link
from evoros.optimizer.protocol import Aspect, Block
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount, Sensor


@dataclass(frozen=True)
@checks.checked
class FixedSensor:
    """A sensor that is always on the robot, such as a built-in lidar."""

    sensor: Annotated[str, checks.TEXT]  # name of the sensor type, a key of ``sensors``
    link: Annotated[str | None, checks.TEXT] = None  # None: link of the robot's default mount
    x_m: Annotated[float, checks.NUMBER] = 0.0  # x, y and z are in the frame of ``link``
    y_m: Annotated[float, checks.NUMBER] = 0.0
    z_m: Annotated[float, checks.NUMBER] = 0.0
    yaw_deg: Annotated[float, checks.NUMBER] = 0.0  # positive to the left
    pitch_deg: Annotated[float, checks.NUMBER] = 0.0  # positive nose-up

    def bind(self, robot: Robot, key: str) -> Mount:
        """Return the mount on ``robot``; ``key`` is the configuration key, for messages."""
        link = self.link or robot.mount_link
        check_link(link, robot, False, key)
        place = (float(self.x_m), float(self.y_m), float(self.z_m))
        return Mount(self.sensor, link, *place, float(self.yaw_deg), float(self.pitch_deg))


SLOT_NUMBER = checks.Rule(
    "a non-negative integer, or [low, high] with two such numbers",
    lambda v: (
        checks.INTERVAL.holds(v) and all(end >= 0 and end.is_integer() for end in checks.bounds(v))
    ),
)
GENES, FIXED = checks.mapping_of(Gene, "genes"), checks.mapping_of(FixedSensor, "fixed sensors")


@dataclass(frozen=True)
@checks.checked
class SensorDesign:
    """A design space not yet bound to a robot: sensor types, regions and other evolved values.

    The number of placed sensors evolves as well if ``number`` is [low, high]. If ``mirrored``, each
    placed sensor has a twin across the robot's x axis. Types of ``fixed`` sensors are not placed.
    If ``exclusive``, each region carries one sensor; further sensors that choose it are dropped.
    """

    sensors: Annotated[Mapping[str, Sensor], checks.mapping_of(Sensor, "sensors")]
    regions: Annotated[
        Mapping[str, RegionDescription], checks.mapping_of(RegionDescription, "regions")
    ]
    number: Annotated[int | Sequence[int], SLOT_NUMBER]
    mirrored: Annotated[bool, checks.FLAG]
    genes: Annotated[Mapping[str, Gene], GENES] = field(default_factory=dict)
    fixed: Annotated[Mapping[str, FixedSensor], FIXED] = field(default_factory=dict)
    exclusive: Annotated[bool, checks.FLAG] = False

    def __post_init__(self) -> None:
        self._check_names()
        known = " or ".join(self.sensors) or "a key of sensors, which is empty"
        for name, fixed in self.fixed.items():
            if fixed.sensor not in self.sensors:
                raise checks.invalid(self, f"fixed.{name}.sensor", fixed.sensor, f"must be {known}")
        keys = [gene.key for gene in self.genes.values()]
        for key in keys:
            if keys.count(key) > 1:
                raise checks.invalid(
                    self, "genes", key, "must contain each key only once", "remove one of the genes"
                )

    def _check_names(self) -> None:
        for part, choices in (("sensors", self.placed_types), ("regions", self.regions)):
            for name in getattr(self, part):
                if not checks.TEXT.holds(name):
                    raise checks.invalid(self, part, name, f"each name must be {checks.TEXT.text}")
            if self.max_number > 0 and not choices:
                fix = "add at least one, or set number to 0"
                raise checks.invalid(
                    self, part, {}, "must have at least one entry if sensors are placed", fix
                )
        check_gene_names(self, self.genes)

    @property
    def placed_types(self) -> list[str]:
        """The sensor types placed in regions; types of fixed sensors are not among them."""
        used = {fixed.sensor for fixed in self.fixed.values()}
        return [name for name in self.sensors if name not in used]

    @property
    def min_number(self) -> int:
        """The minimum number of placed sensors, without twins."""
        return int(checks.bounds(self.number)[0])

    @property
    def max_number(self) -> int:
        """The maximum number of placed sensors, without twins."""
        return int(checks.bounds(self.number)[1])

    def bind(self, robot: Robot, declared: Mapping[str, Gene] | None = None) -> "DesignSpace":
        """Return the search space on ``robot``; ``declared`` holds the genes of other parts."""
        declared = declared or {}
        self._check_declared(declared)
        sensors = tuple(self.sensors[name] for name in self.placed_types)
        regions = {
            name: region.bind(robot, self.mirrored, f"design.regions.{name}", sensors)
            for name, region in self.regions.items()
        }
        fixed = tuple(part.bind(robot, f"design.fixed.{name}") for name, part in self.fixed.items())
        return DesignSpace(self, robot, regions, fixed, {**self.genes, **declared})

    def _check_declared(self, declared: Mapping[str, Gene]) -> None:
        check_gene_names(self, declared)
        keys = {gene.key: name for name, gene in declared.items()}
        for name, gene in self.genes.items():
            other = name if name in declared else keys.get(gene.key)
            if other is not None:
                rule = f"must differ in name and key from the controller's gene {other}"
                raise checks.invalid(self, "genes", name, rule, "remove or rename the gene")


@dataclass(frozen=True)
class DesignSpace:
    """A design space bound to a robot; rejects genomes outside the closed unit cube."""

    design: SensorDesign
    robot: Robot
    regions: Mapping[str, BoundRegion]
    fixed: tuple[Mount, ...] = ()  # mounted in every design
    genes: Mapping[str, Gene] = field(default_factory=dict)  # genes of design and other parts

    @property
    def blocks(self) -> tuple[Block, ...]:
        """One block per placed sensor, one for their number if it evolves, one per gene group."""
        return self._blocks_and_index[0]

    @property
    def _index(self) -> Mapping[str, int]:
        """The index of each gene, by name."""
        return self._blocks_and_index[1]

    @cached_property
    def _blocks_and_index(self) -> tuple[tuple[Block, ...], dict[str, int]]:
        index: dict[str, int] = {}

        def add_genes(*names: str) -> tuple[int, ...]:
            return tuple(index.setdefault(name, len(index)) for name in names)

        def add_sensor(slot: str) -> Block:
            kind = add_genes(f"{slot}_type") if len(self.design.placed_types) > 1 else ()
            region = add_genes(f"{slot}_region") if len(self.regions) > 1 else ()
            position = add_genes(*(f"{slot}_{name}" for name in POSITION if self._varies(name)))
            angle = add_genes(*(f"{slot}_{name}" for name in ANGLES if self._varies(name)))
            place = Aspect("place", position, region)
            aspects = (Aspect("type", (), kind), place, Aspect("angle", angle))
            return Block(slot, tuple(a for a in aspects if a.continuous or a.categorical))

        blocks = [add_sensor(slot) for slot in self._slots]
        if self.design.min_number < self.design.max_number:
            blocks.append(Block("number", (Aspect("number", add_genes("number")),)))
        for title, names in group_genes(self.genes).items():
            blocks.append(Block(title, tuple(Aspect(name, add_genes(name)) for name in names)))
        return tuple(block for block in blocks if block.genes), index

    def _varies(self, name: str) -> bool:
        """Return True if a coordinate or angle, such as ``yaw_deg``, varies in any region."""
        ranges = (region.ranges.get(name, (0.0, 0.0)) for region in self.regions.values())
        return any(low < high for low, high in ranges)

    @property
    def size(self) -> int:
        """The number of genes."""
        return len(self._index)

    @cached_property
    def levels(self) -> Mapping[int, int]:
        """The number of levels of each discrete gene, by gene index."""
        counts = {"number": self.design.max_number - self.design.min_number + 1}
        counts |= {f"{slot}_type": len(self.design.placed_types) for slot in self._slots}
        counts |= {f"{slot}_region": len(self.regions) for slot in self._slots}
        for name, gene in self.genes.items():
            if gene.whole:
                counts[name] = int(gene.high - gene.low) + 1
        return {self._index[name]: count for name, count in counts.items() if name in self._index}

    @property
    def middle(self) -> Array:
        """The genome at the centre of all ranges, with sensors spread over exclusive regions."""
        genome, index = np.full(self.size, 0.5), self._index
        for i, slot in enumerate(self._slots if self.design.exclusive else ()):
            if f"{slot}_region" in index:
                genome[index[f"{slot}_region"]] = (i + 0.5) / len(self._slots)
        return genome

    @property
    def slots(self) -> tuple[Block, ...]:
        """The blocks of placed sensors."""
        return tuple(block for block in self.blocks if block.name in self._slots)

    @property
    def _slots(self) -> list[str]:
        return [f"sensor{i}" for i in range(self.design.max_number)]

    def decode(self, genome: Array) -> Design:
        """Decode ``genome`` (size,), with values from 0 to 1, into a design.

        If the number of sensors evolves, the first slots are mounted. Sensors in exclusive regions
        are in the order of the regions; other sensors are followed by their mirrored twins. Mounts
        are sorted by type in the order of ``design.sensors``, fixed sensors before placed ones.
        """
        genes = self._genes(genome)
        placed = (self._with_twin(mount) for mount, _ in self._place(genes))
        mounts = [*self.fixed, *chain.from_iterable(placed)]
        types = list(self.design.sensors)
        mounts.sort(key=lambda mount: types.index(mount.sensor))
        evolved = {gene.key: gene.value(genes.get(name, 0.0)) for name, gene in self.genes.items()}
        return Design(tuple(mounts), evolved)

    def mount_slots(self, genome: Array) -> list[tuple[tuple[Mount, ...], str]]:
        """Return the sensor of each slot, mounted or not, with twin, and the name of its region."""
        genes = self._genes(genome)
        placed = (self._mount(genes, slot) for slot in self._slots)
        return [(self._with_twin(mount), region) for mount, region in placed]

    def _with_twin(self, mount: Mount) -> tuple[Mount, ...]:
        if not self.design.mirrored:
            return (mount,)
        # not -y, which could be written as -0.0
        return mount, replace(mount, y_m=0.0 - mount.y_m, yaw_deg=0.0 - mount.yaw_deg)

    def to_row(self, genome: Array) -> dict[str, float | str]:
        """Return decoded values by column; ``sensorN`` is the Nth placed sensor, "" if absent."""
        genes = self._genes(genome)
        placed = self._place(genes)
        row: dict[str, float | str] = {}
        for i, slot in enumerate(self._slots):
            values: dict[str, float | str] = {}
            if i < len(placed):
                mount, region = placed[i]
                values = {"type": mount.sensor, "region": region, **vars(mount)}
            for name in self._slot_columns:
                absent = "" if name in ("type", "region") else math.nan
                row[f"{slot}_{name}"] = values.get(name, absent)
        if self.design.min_number < self.design.max_number:
            row["number"] = len(placed)
        for name, gene in self.genes.items():
            row[name] = gene.value(genes.get(name, 0.0))
        return row

    @cached_property
    def _slot_columns(self) -> list[str]:
        kind = ["type"] if len(self.design.placed_types) > 1 else []
        extra = [name for name in ("z_m", "pitch_deg") if self._varies(name)]
        return [*kind, "region", "x_m", "y_m", "yaw_deg", *extra]

    def _genes(self, genome: Array) -> dict[str, float]:
        vector = np.asarray(genome, dtype=np.float64)
        # NaN fails the comparisons as well
        if vector.shape != (self.size,) or not ((vector >= 0) & (vector <= 1)).all():
            raise InputError(
                f"genome: must be {self.size} numbers from 0 to 1, not {vector.tolist()}; "
                "clip the genomes that the optimizer proposes"
            )
        return dict(zip(self._index, vector.tolist(), strict=True))

    def _place(self, genes: dict[str, float]) -> list[tuple[Mount, str]]:
        """Return (sensor, region name) for each placed sensor, without twins."""
        low, high = self.design.min_number, self.design.max_number
        count = low + checks.pick_index(genes.get("number", 0.0), high - low + 1)
        placed = [self._mount(genes, slot) for slot in self._slots[:count]]
        if self.design.exclusive:
            first = {region: mount for mount, region in reversed(placed)}
            return [(first[region], region) for region in self.regions if region in first]
        return placed

    def _mount(self, genes: dict[str, float], slot: str) -> tuple[Mount, str]:
        types, names = self.design.placed_types, list(self.regions)
        kind = types[checks.pick_index(genes.get(f"{slot}_type", 0.0), len(types))]
        name = names[checks.pick_index(genes.get(f"{slot}_region", 0.0), len(names))]
        region = self.regions[name]
        values = {
            value: checks.scale(genes.get(f"{slot}_{value}", 0.0), *ends)
            for value, ends in region.ranges.items()
        }
        (x, y, z), yaw, pitch = region.place(values)
        return Mount(kind, region.link, x, y, z, yaw, pitch), name
