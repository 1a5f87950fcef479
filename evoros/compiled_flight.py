"""Missions compiled from start to end, where all rules can be compiled.

Each rule is compiled by itself, with the one signature of its kind, and passed to the compiled loop
as a function of that type: so one compiled loop serves every combination of parts.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import numpy as np
from numba import njit, types

from evoros.compiled import (
    A1,
    A2,
    F8,
    FILTER,
    HOW,
    I8,
    LAYER,
    MOTION,
    RNG,
    Compiled,
    NotCompilable,
    attempt,
    compiling,
)
from evoros.flight import Arrays, Count, Link, Parts, Step, Timing, fly, name_of
from evoros.types import Array

Part = TypeVar("Part", Link, Step)

Fly = Callable[..., Count]


def step_by_step(parts: Parts) -> tuple[Fly, Parts]:
    """The interpreted loop with rules as they are."""
    return fly, parts


def best(parts: Parts) -> tuple[Fly, Parts]:
    """The compiled loop where all rules can be compiled, else the interpreted one.

    That one calls what is compiled of a simulation that is made of rules and of the other parts; a
    live engine's mission stays as it is.
    """
    observe, sense, advance = (
        _ready(rule, kind) for rule, kind in zip(parts[:3], MOTION, strict=True)
    )
    if not all(isinstance(rule, Compiled) for rule in (observe, sense, advance)):
        return fly, parts
    filters = tuple(map(_link, parts.filters))
    localization = tuple(map(_link, parts.localization))
    layers = tuple(map(_step, parts.layers))
    rules = [link.rule for link in (*filters, *localization)], [step.rule for step in layers]
    loop: Fly = fly
    if all(isinstance(rule, Compiled) for chain in rules for rule in chain):
        no_link, no_step = _pads()
        filters, localization = _padded(filters, no_link), _padded(localization, no_link)
        layers = _padded(layers, no_step)
        loop = _loop(len(filters), len(localization), len(layers))
    return loop, Parts(
        observe,
        sense,
        advance,
        parts.parameters,
        parts.memory,
        filters,
        localization,
        layers,
    )


def interpreted(parts: Parts) -> list[str]:
    """What of a simulation that is made of rules is not compiled, and why: a line a rule."""
    rules: list[tuple[Any, Any]] = [*zip(parts[:3], MOTION, strict=True)]
    rules += [(link.rule, FILTER) for link in (*parts.filters, *parts.localization)]
    rules += [(step.rule, LAYER) for step in parts.layers]
    answers = [(name_of(rule), attempt(rule, kind)) for rule, kind in rules]
    reasons = {
        f"{name} is not compiled: {reason}": None
        for name, reason in answers
        if isinstance(reason, NotCompilable)
    }
    return list(reasons)


def _link(link: Link) -> Link:
    return link._replace(rule=_ready(link.rule, FILTER))


def _step(step: Step) -> Step:
    return step._replace(rule=_ready(step.rule, LAYER))


def _ready(rule: Any, kind: Any) -> Any:
    answer = attempt(rule, kind)
    return answer if isinstance(answer, Compiled) else rule


def _padded(parts: tuple[Part, ...], pad: Part) -> tuple[Part, ...]:
    """To the next power of two: few lengths have to be compiled."""
    length = 1
    while length < len(parts):
        length *= 2
    return parts + (pad,) * (length - len(parts))


def _no_link(constants: Array, kept: Array, rng: Any, values: Array, time: float) -> None:
    """Never called."""


def _no_layer(
    constants: Array,
    kept: Array,
    state: Array,
    leg: Array,
    readings: Array,
    time: float,
    command: Array,
) -> bool:
    """Never decides."""
    return False


@cache
def _pads() -> tuple[Link, Step]:
    empty = np.zeros(0)
    link = _link(Link(0, _no_link, empty, empty, np.random.default_rng(0), empty))
    return link, _step(Step(_no_layer, empty, empty))


@cache
def _loop(filters: int, localization: int, layers: int) -> Fly:
    """``fly`` for so many links and layers."""
    link = types.NamedTuple((I8, types.FunctionType(FILTER), A1, A1, RNG, A1), Link)
    step = types.NamedTuple((types.FunctionType(LAYER), A1, A1), Step)
    signature = types.NamedUniTuple(I8, len(Count._fields), Count)(
        *map(types.FunctionType, MOTION),
        A1,
        A1,
        types.UniTuple(link, filters),
        types.UniTuple(link, localization),
        types.UniTuple(step, layers),
        A2,
        F8,
        types.boolean,
        types.NamedTuple((F8, I8, I8, I8, I8), Timing),
        types.NamedTuple((*(A1,) * 6, A2), Arrays),
        A1,
    )
    with compiling() as kept:
        loop = njit(signature, cache=kept, **HOW)(fly)
    # Without numba's look at the type of every argument, which costs as much as all else that a
    # mission does in Python: parts_of has checked what parts provide.
    entry: Fly = loop.get_compile_result(signature).entry_point
    return entry
