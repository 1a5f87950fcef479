"""Generated worlds: a random field of obstacles around a course, with a way through it."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import (
    FLAG,
    NAME,
    NOT_NEGATIVE,
    POSITIVE,
    WHOLE,
    Rule,
    checked,
    invalid,
)
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.field.kinds import KINDS, Kind
from evoros.field.note import write_note
from evoros.field.passage import MARGIN_M, Passage
from evoros.field.placement import PlacedObstacles
from evoros.formats.sdf.reader import read_sdf
from evoros.formats.sdf.writer import write_sdf
from evoros.geometry.footprint import project_shape
from evoros.geometry.inertia import solid_moments
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.world.course import A_COURSE, Course
from evoros.world.model import World

FIXED = "fixed"
"""The key of the draws of a field that is not renewed."""
NAME_OF_WORLD = "generated"
WALL_WIDTH_M, WALL_HEIGHT_M = 0.2, 1.0
TRIES, ATTEMPTS, HOPELESS = 300, 50, 0.5
"""Places tried for one obstacle; how often a field is begun again that did not become full, unless
less than this share of its obstacles found a place."""
GROUND = Body("ground", Pose(), (Shape("plane", (0.0, 0.0, 1.0)),))

EXTENT = Rule(
    "two numbers [x, y] greater than 0",
    lambda v: isinstance(v, list | tuple) and len(v) == 2 and all(map(POSITIVE.holds, v)),
)


@dataclass(frozen=True)
@checked
class Field:
    """How fields are drawn: which obstacles, how many, and what they leave free.

    A function of ``seed`` and of the key of the draws: the same two give the same bytes of SDF.
    Obstacles are put one after another at uniformly random places and headings; one that would
    come too near to the route's points or to another one, or would close the way, is put somewhere
    else. Places are rounded to millimetres and headings to milliradians.
    """

    course: Annotated[Course, A_COURSE]
    extent_m: Annotated[Sequence[float], EXTENT]  # along x and y, centred on the course
    density: Annotated[float, NOT_NEGATIVE]  # obstacles for each square metre of the extent
    kinds: Annotated[Mapping[str, Kind], KINDS]
    clearing_m: Annotated[float, POSITIVE]  # free radius around home and each waypoint
    gap_m: Annotated[float, NOT_NEGATIVE]  # least distance between obstacles
    passage_m: Annotated[float, POSITIVE]  # width of a way that exists along each leg
    enclosed: Annotated[bool, FLAG]  # a wall around the extent
    seed: Annotated[int, WHOLE] = 0

    def __post_init__(self) -> None:
        if not self.kinds or not all(map(NAME.holds, self.kinds)):
            rule = f"must have at least one kind, and each key be {NAME.text}"
            raise invalid(self, "kinds", dict(self.kinds), rule)
        least = self.passage_m / 2 + 2 * MARGIN_M
        if self.clearing_m < least:
            rule = f"must be at least {least:.3f}, half of passage_m and a margin"
            raise invalid(self, "clearing_m", self.clearing_m, rule)
        low, high = self.corners
        if (np.minimum(self._places - low, high - self._places) < self.clearing_m).any():
            rule = "must reach at least clearing_m beyond home and all waypoints"
            raise invalid(self, "extent_m", self.extent_m, rule, "enlarge it")

    def __hash__(self) -> int:
        """Of the numbers: the mapping of kinds has none."""
        return hash((self.seed, self.density, self.course))

    @property
    def _places(self) -> Array:
        """(n, 2) [m]: home, the corners, home."""
        home = self.course.home[:2]
        return np.array([home, *self.course.waypoints, home])

    @property
    def corners(self) -> tuple[Array, Array]:
        """The corners [x, y] of the extent with the least and the greatest coordinates [m]."""
        middle = (self._places.min(axis=0) + self._places.max(axis=0)) / 2
        return middle - np.array(self.extent_m) / 2, middle + np.array(self.extent_m) / 2

    def world(self, draws: str) -> World:
        """The field under this key of random draws; it is kept, and so drawn once in a process.

        Raises:
            InputError: the density leaves no room for all obstacles.
        """
        return _world(self, draws)

    def ways(self, bodies: Sequence[Body]) -> list[Array]:
        """A way (n, 2) [m], ``passage_m`` wide, along each leg of the course among the bodies."""
        passage = self._passage()
        for body in bodies:
            if not body.is_ground:
                for shape in body.shapes:
                    passage.add(project_shape(shape, body.pose @ shape.pose))
        return passage.ways

    def bodies(self, draws: str) -> tuple[Body, ...]:
        """The ground, the wall if there is one, and the obstacles."""
        return (GROUND, *self._walls(), *self._obstacles(draws))

    def _obstacles(self, draws: str) -> list[Body]:
        rng = generator(draws, f"field {self.seed}")
        low, high = self.corners
        count = round(self.density * float((high - low).prod()))
        most = 0
        for _ in range(ATTEMPTS):
            found = list(self._placed(count, rng))
            if len(found) == count:
                return found
            most = max(most, len(found))
            if len(found) < HOPELESS * count:
                break
        raise invalid(
            self,
            "density",
            self.density,
            f"must leave room for all obstacles; of {count}, {most} found a place",
            "lower it, gap_m, clearing_m or the sizes of the kinds",
        )

    def _placed(self, count: int, rng: Generator) -> Iterator[Body]:
        """So many obstacles, or fewer if one of them finds no place."""
        placed = self._crowd()
        names = list(self.kinds)
        shares = np.cumsum([self.kinds[name].share for name in names])
        for number in range(count):
            drawn = int(np.searchsorted(shares, rng.random() * shares[-1], side="right"))
            kind = self.kinds[names[drawn]]
            shape = kind.draw(rng)
            pose = self._place(shape, placed, rng)
            if pose is None:
                return
            name = f"{names[drawn]}_{number + 1}"
            if kind.mass_kg is None:
                yield Body(name, pose, (shape,))
            else:
                yield Body(
                    name, pose, (shape,), kind.mass_kg, 1.0, solid_moments(shape, kind.mass_kg)
                )

    def _place(self, shape: Shape, placed: PlacedObstacles, rng: Generator) -> Pose | None:
        """A pose on the ground that the others leave free."""
        height = shape.size[-1] / 2
        for _ in range(TRIES):
            u, v, w = rng.random(3).tolist()
            x, y = (
                round(float(a) + part * float(b - a), 3)
                for a, b, part in zip(*self.corners, (u, v), strict=True)
            )
            yaw = round((2 * w - 1) * np.pi, 3)
            pose = Pose.from_rpy((x, y, height), 0.0, 0.0, yaw)
            if placed.add(project_shape(shape, pose)):
                return pose
        return None

    def _crowd(self) -> PlacedObstacles:
        """Nothing but the wall, if there is one."""
        passage = self._passage()
        for wall in self._walls():
            passage.add(project_shape(wall.shapes[0], wall.pose))
        low, high = self.corners
        inset = self.gap_m if self.enclosed else 0.0
        return PlacedObstacles(
            low + inset, high - inset, self._places, self.clearing_m, self.gap_m, passage
        )

    def _passage(self) -> Passage:
        low, high = self.corners
        return Passage(low, high, self._places, self.passage_m)

    def _walls(self) -> tuple[Body, ...]:
        """Four walls around the extent, or none."""
        if not self.enclosed:
            return ()
        low, high = self.corners
        (x, y), (length, width) = (low + high) / 2, high - low
        out, z = WALL_WIDTH_M / 2, WALL_HEIGHT_M / 2
        long, broad = length + 2 * WALL_WIDTH_M, width
        return tuple(
            Body(f"wall_{side}", Pose((px, py, z)), (Shape("box", (sx, sy, WALL_HEIGHT_M)),))
            for side, px, py, sx, sy in (
                ("south", x, low[1] - out, long, WALL_WIDTH_M),
                ("north", x, high[1] + out, long, WALL_WIDTH_M),
                ("west", low[0] - out, y, WALL_WIDTH_M, broad),
                ("east", high[0] + out, y, WALL_WIDTH_M, broad),
            )
        )


def generated_world(
    course: Course,
    extent_m: Annotated[Sequence[float], EXTENT],
    density: float,
    kinds: Mapping[str, Kind],
    clearing_m: float,
    gap_m: float,
    passage_m: float,
    enclosed: bool,
    seed: int = 0,
    renew: bool = False,
) -> World:
    """A generated field as a world; with ``renew``, another one under each key of draws.

    Raises:
        InputError: a value is out of range, or the density leaves no room for all obstacles.
    """
    if not FLAG.holds(renew):
        raise InputError(f"generated_world.renew: must be {FLAG.text}, not {renew!r}; set it so")
    field = Field(course, extent_m, density, kinds, clearing_m, gap_m, passage_m, enclosed, seed)
    world = field.world(FIXED)
    return replace(world, renewal=field) if renew else world


@lru_cache(maxsize=256)
def _world(field: Field, draws: str) -> World:
    """What its SDF says, so that the file is the same world in every bit."""
    parameters = {entry.name: getattr(field, entry.name) for entry in fields(field)}
    note = write_note({"draws": draws} | parameters)
    source = f"generated field {field.seed}"
    content = write_sdf(NAME_OF_WORLD, field.bodies(draws), note).encode()
    digest = hashlib.sha256(content).hexdigest()
    bodies = read_sdf(content, source)
    return World(NAME_OF_WORLD, bodies, field.course, source, digest, note=note)
