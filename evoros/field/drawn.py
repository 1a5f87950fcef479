"""Random worlds, whose SDF has a comment with all that is needed to generate them again."""

import hashlib
import json
from abc import ABC, abstractmethod
from dataclasses import fields, replace
from functools import lru_cache
from typing import Any, ClassVar

from evoros.base.checks import FLAG
from evoros.base.errors import InputError
from evoros.formats.sdf.reader import read_sdf
from evoros.formats.sdf.writer import write_sdf
from evoros.geometry.shapes import Body
from evoros.world.course import Course
from evoros.world.model import KEPT_WORLDS, World, WorldSampler

FIXED = "fixed"  # key of the random draws for a world shared by all missions


class Distribution(ABC):
    """A distribution of worlds: a frozen, hashable dataclass, identified by its fields."""

    kind: ClassVar[str]  # noun for a world in messages, such as "field"
    world_name: ClassVar[str]
    course: Course
    seed: int

    @abstractmethod
    def draw_bodies(self, draws: str) -> tuple[Body, ...]:
        """Generate the ground and all obstacles from a key of random draws."""

    def draw_world(self, draws: str) -> World:
        """Generate the world for a key of random draws, or return it from the cache."""
        return _draw_world(self, draws)


@lru_cache(maxsize=KEPT_WORLDS)
def _draw_world(distribution: Any, draws: str) -> World:
    """Generate a world and parse its SDF, so that the world and the file agree exactly."""
    note = note_draws(distribution, draws)
    name, source = distribution.world_name, f"generated {distribution.kind} {distribution.seed}"
    content = write_sdf(name, distribution.draw_bodies(draws), note).encode()
    bodies = read_sdf(content, source).bodies
    digest = hashlib.sha256(content).hexdigest()
    return World(name, bodies, distribution.course, source, digest, note=note)


def note_draws(distribution: Any, draws: str) -> str:
    """Return the SDF comment that identifies a world; empty tuples are omitted."""
    values = {entry.name: getattr(distribution, entry.name) for entry in fields(distribution)}
    kept = {"draws": draws} | {name: value for name, value in values.items() if value != ()}
    lines = (f"{key}: {json.dumps(value, default=_describe)}" for key, value in kept.items())
    text = "\n".join(lines).replace("--", "-\\u002d")  # XML comments must not contain "--"
    return f"A {distribution.kind} that evoros generated from\n{text}\n"


def draw_example(sampler: WorldSampler, renew: bool, function: str) -> World:
    """Generate the world of a fixed key, or with ``renew`` a world that each mission replaces."""
    if not FLAG.holds(renew):
        raise InputError(
            f"{function}.renew: must be {FLAG.text}, not {renew!r}; type true for a new world in "
            f"each mission"
        )
    world = sampler.draw_world(FIXED)
    return replace(world, sampler=sampler) if renew else world


def _describe(part: object) -> dict[str, object]:
    """Return the fields of a part, and the name of its class without the module."""
    return {"type": type(part).__name__.lower(), **vars(part)}
