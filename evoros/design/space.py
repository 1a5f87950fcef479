"""The design space: which sensors a robot may have where, and which other values evolve.

A genome is a vector of the unit cube, and *every* vector of the closed cube decodes to a design
that keeps to regions, limits and symmetry: an optimizer needs to know nothing of these rules.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated

import numpy as np

from evoros.base.arrays import Array
from evoros.base.checks import FLAG, NAME, TEXT, Rule, checked, invalid, mapping_of
from evoros.base.errors import InputError
from evoros.base.intervals import INTERVAL, bounds, pick_index, scale
from evoros.design.design import Design
from evoros.design.genes import Gene
from evoros.design.region import Region
from evoros.optimizer.protocol import Aspect, Block
from evoros.sensor.protocol import Mount, Sensor

if TYPE_CHECKING:
    from evoros.robot.model import Robot

PLACE = ("x_m", "y_m", "z_m")
ANGLE = ("yaw_deg", "pitch_deg")
SLOT_NUMBER = Rule(
    "a whole number of at least 0, or [least, most] of such numbers",
    lambda v: INTERVAL.holds(v) and all(end >= 0 and end.is_integer() for end in bounds(v)),
)


@dataclass(frozen=True)
@checked
class SensorDesign:
    """Sensors of the given types, placed in the given regions; other evolved values (``genes``).

    ``number`` is how many sensors are placed: a whole number, or [least, most] where the number
    evolves too. ``mirrored`` gives each of them a twin across the robot's x axis.
    """

    sensors: Annotated[Mapping[str, Sensor], mapping_of(Sensor, "sensors")]
    regions: Annotated[Mapping[str, Region], mapping_of(Region, "regions")]
    number: Annotated[int | Sequence[int], SLOT_NUMBER]
    mirrored: Annotated[bool, FLAG]
    genes: Annotated[Mapping[str, Gene], mapping_of(Gene, "genes")] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._check_names()
        keys = [gene.key for gene in self.genes.values()]
        for key in keys:
            if keys.count(key) > 1:
                raise invalid(self, "genes", key, "must not evolve one key twice", "remove one")

    def _check_names(self) -> None:
        for part in ("sensors", "regions"):
            for name in getattr(self, part):
                if not TEXT.holds(name):
                    raise invalid(self, part, name, f"each name must be {TEXT.text}")
        for part in ("sensors", "regions"):
            if self.most > 0 and not getattr(self, part):
                cure = "give at least one, or set number to 0"
                raise invalid(self, part, {}, "must not be empty where sensors are placed", cure)
        for name in self.genes:
            if not NAME.holds(name):  # a column of the table of a generation
                raise invalid(self, "genes", name, f"each name must be {NAME.text}", "rename it")
            if re.match(r"number$|sensor\d+_", name):
                cure = "choose another name"
                raise invalid(self, "genes", name, "names of sensor columns are taken", cure)

    @property
    def least(self) -> int:
        """The least number of placed sensors, twins not counted."""
        return int(bounds(self.number)[0])

    @property
    def most(self) -> int:
        """The greatest number of placed sensors, twins not counted."""
        return int(bounds(self.number)[1])

    def space(self, robot: "Robot") -> "DesignSpace":
        """The search space of this design on ``robot``.

        Raises:
            InputError: a region is not on the robot.
        """
        regions = {
            name: region.on(robot, self.mirrored, f"design.regions.{name}")
            for name, region in self.regions.items()
        }
        return DesignSpace(self, regions)


@dataclass(frozen=True)
class DesignSpace:
    """A design bound to a robot: ``regions`` leave nothing open (see ``Region.on``)."""

    design: SensorDesign
    regions: Mapping[str, Region]

    @cached_property
    def _layout(self) -> tuple[tuple[Block, ...], dict[str, int]]:
        """The blocks, and the index of each gene by its name. What cannot differ has no gene."""
        design = self.design
        index: dict[str, int] = {}

        def take(*names: str) -> tuple[int, ...]:
            return tuple(index.setdefault(name, len(index)) for name in names)

        def aspects(slot: str) -> tuple[Aspect, ...]:
            kind = take(f"{slot}_type") if len(design.sensors) > 1 else ()
            region = take(f"{slot}_region") if len(self.regions) > 1 else ()
            place = take(*(f"{slot}_{name}" for name in PLACE if self._varies(name)))
            angle = take(*(f"{slot}_{name}" for name in ANGLE if self._varies(name)))
            found = Aspect("type", (), kind), Aspect("place", place, region), Aspect("angle", angle)
            return tuple(aspect for aspect in found if aspect.continuous or aspect.categorical)

        blocks = [Block(slot, aspects(slot)) for slot in self._slots]
        if design.least < design.most:
            blocks.append(Block("number", (Aspect("number", take("number")),)))
        for name, gene in design.genes.items():
            if gene.low < gene.high:
                blocks.append(Block(name, (Aspect("value", take(name)),)))
        return tuple(block for block in blocks if block.genes), index

    @property
    def blocks(self) -> tuple[Block, ...]:
        """One for each placed sensor, one for their number where it evolves, one for each gene."""
        return self._layout[0]

    @property
    def size(self) -> int:
        """The number of genes."""
        return len(self._layout[1])

    @property
    def _slots(self) -> list[str]:
        return [f"sensor{i}" for i in range(self.design.most)]

    def _varies(self, name: str) -> bool:
        intervals = (bounds(getattr(region, name)) for region in self.regions.values())
        return any(low < high for low, high in intervals)

    def decode(self, genome: Array) -> Design:
        """The design at ``genome`` (size,), values from 0 to 1.

        A placed sensor is followed by its twin where the design is mirrored. Where the number of
        sensors evolves, the first so many are there. The mounts have the robot's order (that of
        ``Robot.with_sensors``): by the types in ``design.sensors``, those of one type as placed.

        Raises:
            InputError: the genome is not a vector of the closed unit cube.
        """
        genes = self._genes(genome)
        mounts: list[Mount] = []
        for slot in self._slots[: self._number(genes)]:
            mount, _ = self._mount(genes, slot)
            mounts.append(mount)
            if self.design.mirrored:  # 0.0 - y rather than -y, so that no text ever says -0.0
                mounts.append(replace(mount, y_m=0.0 - mount.y_m, yaw_deg=0.0 - mount.yaw_deg))
        types = list(self.design.sensors)
        mounts.sort(key=lambda mount: types.index(mount.sensor))
        evolved = {
            gene.key: gene.value(genes.get(name, 0.0)) for name, gene in self.design.genes.items()
        }
        return Design(tuple(mounts), evolved)

    def same(self, one: Array, other: Array) -> bool:
        """Whether two genomes decode to equal designs, as they do if only absent sensors differ.

        Raises:
            InputError: one of them is not a vector of the closed unit cube.
        """
        return self.decode(one) == self.decode(other)

    def values(self, genome: Array) -> dict[str, float | str]:
        """The decoded values for a table, by column; an absent sensor has empty texts and NaN.

        The columns follow the genes: ``sensorN`` is the Nth placed sensor, whatever its type.

        Raises:
            InputError: the genome is not a vector of the closed unit cube.
        """
        genes = self._genes(genome)
        number = self._number(genes)
        row: dict[str, float | str] = {}
        for i, slot in enumerate(self._slots):
            mount, region = self._mount(genes, slot)
            found: dict[str, float | str] = {"type": mount.sensor, "region": region}
            found |= {name: getattr(mount, name) for name in (*PLACE, *ANGLE)}
            for name in self._slot_columns:
                absent = "" if name in ("type", "region") else math.nan
                row[f"{slot}_{name}"] = found[name] if i < number else absent
        if self.design.least < self.design.most:
            row["number"] = number
        for name, gene in self.design.genes.items():
            row[name] = gene.value(genes.get(name, 0.0))
        return row

    @cached_property
    def _slot_columns(self) -> list[str]:
        kind = ["type"] if len(self.design.sensors) > 1 else []
        extra = [name for name in ("z_m", "pitch_deg") if self._varies(name)]
        return [*kind, "region", "x_m", "y_m", "yaw_deg", *extra]

    def _genes(self, genome: Array) -> dict[str, float]:
        vector = np.asarray(genome, dtype=np.float64)
        # The comparison is false for NaN, which is no gene either.
        if vector.shape != (self.size,) or not np.all((vector >= 0) & (vector <= 1)):
            raise InputError(
                f"genome: must be {self.size} numbers from 0 to 1, not {vector.tolist()}; "
                f"clip what the optimizer proposes"
            )
        return dict(zip(self._layout[1], vector.tolist(), strict=True))

    def _number(self, genes: dict[str, float]) -> int:
        least, most = self.design.least, self.design.most
        return least + pick_index(genes.get("number", 0.0), most - least + 1)

    def _mount(self, genes: dict[str, float], slot: str) -> tuple[Mount, str]:
        """The sensor placed by ``slot``, and the name of its region."""
        types, names = list(self.design.sensors), list(self.regions)
        kind = types[pick_index(genes.get(f"{slot}_type", 0.0), len(types))]
        name = names[pick_index(genes.get(f"{slot}_region", 0.0), len(names))]
        region = self.regions[name]
        pose = {
            value: scale(genes.get(f"{slot}_{value}", 0.0), *bounds(getattr(region, value)))
            for value in (*PLACE, *ANGLE)
        }
        assert region.link is not None  # bound to the robot
        return Mount(sensor=kind, link=region.link, **pose), name
