"""Missions compiled from start to end: the rules of all parts, and the loop that calls them.

A rule is compiled by itself, with the one signature of its kind, and passed to the compiled loop
as a function of that type; so one compiled loop serves every combination of parts. What has been
compiled is kept on disk, in a folder that is named by the sources: a change in any of them
compiles everything anew.
"""

import hashlib
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from inspect import isfunction
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar

import numba
import numpy as np
from numba import njit, types
from numba.core.errors import NumbaExperimentalFeatureWarning
from numba.extending import register_jitable

from evoros.flight import Arrays, Count, Link, Parts, Step, Timing, fly
from evoros.log import LOGGER
from evoros.types import Array

Part = TypeVar("Part", Link, Step)
Function = TypeVar("Function", bound=Callable[..., Any])

_F8, _I8 = types.float64, types.int64
_A1, _A2 = types.Array(_F8, 1, "C"), types.Array(_F8, 2, "C")
_RNG = numba.typeof(np.random.default_rng(0))

# The kinds of rules, as evoros.types has them.
FILTER = types.void(_A1, _A1, _RNG, _A1, _F8)
LAYER = types.boolean(_A1, _A1, _A1, _A1, _A1, _F8, _A1)
OBSERVE = SENSE = types.void(_A1, _A1, _A1)
ADVANCE = types.void(_A1, _A1, _A1, _F8)
MOTION = (OBSERVE, SENSE, ADVANCE)

# What evoros.plane.track computes.
CLEARANCES = types.void(_A2, _A2, _A2, _A2, _A1)
SURVEY = types.void(_A2, _A2, _A2, _A2, _A2, _I8, _A1)

Fly = Callable[..., Count]

_COMPILING = Lock()  # around settings of numba's that hold for the whole process


class Compiled(types.WrapperAddressProtocol):  # type: ignore[misc]
    """A compiled rule, called from Python, or from compiled code by its address.

    numba would look the address up at every mission; here it is looked up once.
    """

    def __init__(self, dispatcher: Any, kind: Any) -> None:
        self._kind = kind
        self._dispatcher = dispatcher
        result = dispatcher.get_compile_result(kind)
        self._address = result.library.get_pointer_to_function(
            result.fndesc.llvm_cfunc_wrapper_name
        )

    def __wrapper_address__(self) -> int:
        """Where the machine code is."""
        address: int = self._address
        return address

    def signature(self) -> Any:
        """The kind."""
        return self._kind

    def __call__(self, *args: Any) -> Any:
        """As the rule itself."""
        return self._dispatcher(*args)


class NotCompilable(Exception):
    """A rule that can only be interpreted, and why."""


def compilable(function: Function) -> Function:
    """Decorates a function that rules call, so that it can be compiled together with them."""
    jitable: Function = register_jitable(function)
    return jitable


def compiled(rule: Any, kind: Any) -> Compiled:
    """The rule compiled, once in a process.

    Raises:
        NotCompilable: numba cannot compile it. Only plain functions are: a method belongs to a
            live object, which numba does not know.
    """
    answer = _attempt(rule, kind)
    if isinstance(answer, NotCompilable):
        raise answer
    return answer


@cache
def _attempt(rule: Any, kind: Any) -> Compiled | NotCompilable:
    if not isfunction(rule):
        return NotCompilable("it is not a plain function")
    if rule.__closure__:
        return NotCompilable("it refers to variables of the function that defines it")
    # What a user's rule calls may change without our noticing: it is compiled in every process.
    ours = rule.__module__.partition(".")[0] == __package__
    try:
        with _compiling() as kept:
            return Compiled(njit(kind, cache=ours and kept, nogil=True)(rule), kind)
    except Exception as error:  # numba raises all kinds
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        telling = [line for line in lines if not line.startswith(("Failed in", "During:", "File"))]
        return NotCompilable((telling or lines or ["numba cannot compile it"])[0])


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
    answers = {rule: _attempt(rule, kind) for rule, kind in rules}
    return [
        f"{rule.__module__}.{rule.__qualname__} is not compiled: {reason}"
        for rule, reason in answers.items()
        if isinstance(reason, NotCompilable)
    ]


def _link(link: Link) -> Link:
    return link._replace(rule=_ready(link.rule, FILTER))


def _step(step: Step) -> Step:
    return step._replace(rule=_ready(step.rule, LAYER))


def _ready(rule: Any, kind: Any) -> Any:
    answer = _attempt(rule, kind)
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
    link = types.NamedTuple((_I8, types.FunctionType(FILTER), _A1, _A1, _RNG, _A1), Link)
    step = types.NamedTuple((types.FunctionType(LAYER), _A1, _A1), Step)
    signature = types.NamedUniTuple(_I8, len(Count._fields), Count)(
        *map(types.FunctionType, MOTION),
        _A1,
        _A1,
        types.UniTuple(link, filters),
        types.UniTuple(link, localization),
        types.UniTuple(step, layers),
        _A2,
        _F8,
        types.boolean,
        types.NamedTuple((_F8, _I8, _I8, _I8, _I8), Timing),
        types.NamedTuple((*(_A1,) * 6, _A2), Arrays),
        _A1,
    )
    with _compiling() as kept:
        loop: Fly = njit(signature, cache=kept, nogil=True)(fly)
    return loop


@contextmanager
def _compiling() -> Iterator[bool]:
    """While open, numba keeps what it compiles in our folder; yields whether there is one.

    It also calls functions as arguments an experimental feature, at each of them.
    """
    folder = _cache_folder()
    with _COMPILING, warnings.catch_warnings():
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(folder or before)
        try:
            yield folder is not None
        finally:
            numba.config.CACHE_DIR = before


@cache
def _cache_folder() -> Path | None:
    """Where compiled code is kept; None where nothing can be written.

    numba checks the file of a function alone, and not what it calls: hence the name by the
    content of all sources.
    """
    here = Path(__file__).parent
    digest = hashlib.sha256(numba.__version__.encode())
    for file in sorted(here.rglob("*.py")):
        digest.update(file.read_bytes())
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    for base in (Path(home) / "evoros", Path(tempfile.gettempdir()) / f"evoros-{os.getuid()}"):
        folder = base / digest.hexdigest()[:16]
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            # Compiled code that somebody else has put there must not be run.
            if os.access(folder, os.W_OK) and base.stat().st_uid == os.getuid():
                return folder
    LOGGER.warning("no folder can be written (%s): rules are compiled in every process", home)
    return None
