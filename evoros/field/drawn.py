"""Worlds that are drawn: their SDF, with the comment that is enough to draw them again."""

import hashlib
from dataclasses import Field, fields, replace
from functools import lru_cache
from typing import Any, ClassVar, Protocol

from evoros.base.checks import FLAG
from evoros.base.errors import InputError
from evoros.field.note import write_note
from evoros.formats.sdf.reader import read_sdf
from evoros.formats.sdf.writer import write_sdf
from evoros.geometry.shapes import Body
from evoros.world.course import Course
from evoros.world.model import KEPT_WORLDS, World, WorldSampler

FIXED = "fixed"
"""The key of the random draws of a world that is the same in all missions."""


class Noted(Protocol):
    """A distribution of worlds: a frozen dataclass that can be hashed; all its fields count."""

    kind: ClassVar[str]
    """What it draws, in one word."""
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]


class Distribution(Noted, Protocol):
    """A distribution of worlds that are read from their SDF."""

    world_name: ClassVar[str]

    @property
    def course(self) -> Course:
        """The course of all its worlds."""

    @property
    def seed(self) -> int:
        """The seed of its draws."""

    def draw_bodies(self, draws: str) -> tuple[Body, ...]:
        """Draw the ground and all obstacles under a key of random draws."""


@lru_cache(maxsize=KEPT_WORLDS)
def draw_world(distribution: Distribution, draws: str) -> World:
    """Draw a world and read it from its own SDF, so that the file is equal to it in every bit."""
    note = note_draws(distribution, draws)
    name, source = distribution.world_name, f"generated {distribution.kind} {distribution.seed}"
    content = write_sdf(name, distribution.draw_bodies(draws), note).encode()
    bodies = read_sdf(content, source).bodies
    digest = hashlib.sha256(content).hexdigest()
    return World(name, bodies, distribution.course, source, digest, note=note)


def note_draws(distribution: Noted, draws: str) -> str:
    """Write the comment of the world under a key; fields that are empty tuples stay out of it."""
    values = {entry.name: getattr(distribution, entry.name) for entry in fields(distribution)}
    kept = {name: value for name, value in values.items() if value != ()}
    return write_note(distribution.kind, {"draws": draws} | kept)


def draw_example(sampler: WorldSampler, renew: bool, function: str) -> World:
    """Draw the world of a fixed key; with ``renew``, each mission draws one of its own.

    Raises:
        InputError: ``renew`` is no flag; the message names it by the function that has it.
    """
    if not FLAG.holds(renew):
        raise InputError(f"{function}.renew: must be {FLAG.text}, not {renew!r}; set it so")
    world = sampler.draw_world(FIXED)
    return replace(world, sampler=sampler) if renew else world
