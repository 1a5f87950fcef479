"""Randomly drawn worlds: their SDF, with a comment from which they can be drawn again."""

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

FIXED = "fixed"  # key of the random draws of a world that is the same in all missions


class Distribution(ABC):
    """A distribution of worlds: a hashable frozen dataclass, identified by all its fields."""

    kind: ClassVar[str]  # noun for a world, such as "field"
    world_name: ClassVar[str]
    course: Course
    seed: int

    @abstractmethod
    def draw_bodies(self, draws: str) -> tuple[Body, ...]:
        """Draw the ground and all obstacles for a key of random draws."""

    def draw_world(self, draws: str) -> World:
        """Draw the world for a key of random draws; recent worlds are cached."""
        return _draw_world(self, draws)


@lru_cache(maxsize=KEPT_WORLDS)
def _draw_world(distribution: Any, draws: str) -> World:
    """Draw a world and read it back from its SDF, so that world and file match exactly."""
    note = note_draws(distribution, draws)
    name, source = distribution.world_name, f"generated {distribution.kind} {distribution.seed}"
    content = write_sdf(name, distribution.draw_bodies(draws), note).encode()
    bodies = read_sdf(content, source).bodies
    digest = hashlib.sha256(content).hexdigest()
    return World(name, bodies, distribution.course, source, digest, note=note)


def note_draws(distribution: Any, draws: str) -> str:
    """Return the SDF comment that identifies a drawn world; it omits fields with empty tuples."""
    values = {entry.name: getattr(distribution, entry.name) for entry in fields(distribution)}
    kept = {"draws": draws} | {name: value for name, value in values.items() if value != ()}
    lines = (f"{key}: {json.dumps(value, default=_describe)}" for key, value in kept.items())
    text = "\n".join(lines).replace("--", "-\\u002d")  # XML allows no -- in a comment
    return f"A {distribution.kind} that evoros generated from\n{text}\n"


def draw_example(sampler: WorldSampler, renew: bool, function: str) -> World:
    """Draw the world of a fixed key; with ``renew``, each mission draws a new one."""
    if not FLAG.holds(renew):
        raise InputError(
            f"{function}.renew: must be {FLAG.text}, not {renew!r}; type true for a new world in "
            f"each mission"
        )
    world = sampler.draw_world(FIXED)
    return replace(world, sampler=sampler) if renew else world


def _describe(part: object) -> dict[str, object]:
    """Return a part's values and the name of its type, without the module path."""
    return {"type": type(part).__name__.lower(), **vars(part)}
