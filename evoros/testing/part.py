"""Conformance tests for parts of every kind."""

import datetime
import math
import pickle
import random
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from dataclasses import fields, is_dataclass, replace
from functools import cached_property
from inspect import get_annotations
from types import UnionType
from typing import Any, ClassVar, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from evoros.base.checks import Rule, list_rules, quote
from evoros.base.errors import InputError

LEAVES = (str, bytes, int, bool, type(None))
LATER_S = 123_456_789  # about four years
_CLOCKS = "time", "monotonic", "perf_counter", "process_time", "thread_time"
_CANDIDATES: tuple[Any, ...] = (
    math.nan, math.inf, -math.inf, -1, -1.0, 0, 2.5, True, None, "", "wrong", [], ["wrong"], {},
    {"name": "wrong"}, object(),
)  # fmt: skip
T = TypeVar("T")


def bits(value: Any) -> Any:
    """Return nested tuples that are equal if values have equal bits, types and shapes."""
    return _bits(value, ())


def _bits(value: Any, above: tuple[int, ...]) -> Any:
    if id(value) in above:
        return "itself"
    above = (*above, id(value))
    if isinstance(value, LEAVES):
        return (type(value).__name__, value)
    if isinstance(value, float | np.floating):
        return "nan" if math.isnan(value) else float(value).hex()
    if isinstance(value, np.ndarray):
        array = np.where(np.isnan(value), np.nan, value) if value.dtype.kind == "f" else value
        return (array.dtype.str, array.shape, array.tobytes())
    if isinstance(value, np.random.Generator):
        return repr(value.bit_generator.state)
    if is_dataclass(value) and not isinstance(value, type):
        content = [(field.name, getattr(value, field.name)) for field in fields(value)]
        return (_name(type(value)), *((name, _bits(item, above)) for name, item in content))
    return _container_bits(value, above)


def _container_bits(value: Any, above: tuple[int, ...]) -> Any:
    if isinstance(value, Mapping):
        return tuple((_bits(key, above), _bits(item, above)) for key, item in value.items())
    if isinstance(value, Set):
        return tuple(sorted((_bits(item, above) for item in value), key=repr))
    if isinstance(value, Sequence):
        return tuple(_bits(item, above) for item in value)
    if isinstance(value, type) or callable(value):
        return _name(value)
    return (_name(type(value)), _bits(getattr(value, "__dict__", None), above))


def _name(definition: Any) -> str:
    return f"{definition.__module__}.{getattr(definition, '__qualname__', type(definition))}"


class DescriptionSuite:
    """Conformance tests for the description of a part, a class whose fields a YAML file sets.

    A test class inherits the suite for its kind of part and sets ``part``. It may also set
    ``bad_values`` to fields that must be rejected, such as ``{"low": 2.0, "high": 1.0}``.
    """

    part: Any
    bad_values: Sequence[Mapping[str, Any]] = ()
    protocol: ClassVar[Any]

    def test_it_has_what_its_kind_has(self) -> None:
        """The part inherits the base class of its kind, and has all attributes declared there."""
        part, kind = type(self.part).__name__, self.protocol
        assert isinstance(self.part, kind), f"{part} must be a subclass of {kind.__name__}"
        declared = [name for base in kind.__mro__ for name in get_annotations(base)]
        lacking = ", ".join(name for name in declared if not hasattr(self.part, name))
        assert not lacking, f"{part} lacks these attributes of {kind.__name__}: {lacking}"

    def test_it_is_a_frozen_dataclass(self) -> None:
        """Descriptions are immutable, so that missions cannot change them."""
        assert is_dataclass(self.part), f"{type(self.part).__name__} must be a dataclass"
        try:
            setattr(self.part, "trace_of_the_suite", 0)  # noqa: B010 - no field has this name
        except AttributeError:
            return
        raise AssertionError(f"{type(self.part).__name__} must be @dataclass(frozen=True)")

    def test_it_pickles(self) -> None:
        """A part equals its pickled copy, which is what a worker process receives."""
        assert bits(self.copy()) == bits(self.part), "pickling must not change the part's fields"

    def copy(self) -> Any:
        """Return a pickled copy of the part, as received by a worker process."""
        try:
            return pickle.loads(pickle.dumps(self.part))
        except Exception as error:
            raise AssertionError(f"the part must be picklable, but raises {error!r}") from error

    def test_bad_values_are_refused_in_one_line(self) -> None:
        """A value that breaks a field's rule raises an InputError that names the field."""
        derived = _list_bad_values(self.part) if fields(self.part) else ()
        problems = (_find_problem(self.part, values) for values in (*derived, *self.bad_values))
        reported = [problem for problem in problems if problem]
        assert not reported, "\n".join(reported)


class PartSuite(DescriptionSuite):
    """Conformance tests for a part that computes; subclasses define its use."""

    together: ClassVar[bool] = True  # False if two uses must not overlap

    def use(self, part: Any, seed: int) -> Iterator[Any]:
        """Use a part as evoros does, and yield the result of each step."""
        raise NotImplementedError

    def lend(self, value: T) -> T:
        """Return an argument that the part must not change, and record its bits."""
        self.lent.append((value, bits(value)))
        return value

    @cached_property
    def lent(self) -> list[tuple[Any, Any]]:
        """The arguments that the part must not change, with their recorded bits."""
        return []

    def record(self, part: Any, seed: int) -> list[Any]:
        """Return the bits of each step in a use of the part."""
        return [bits(step) for step in self.use(part, seed)]

    def test_equal_uses_give_equal_bits(self) -> None:
        """Equal arguments and random streams give equal results."""
        first, second = self.record(self.part, 1), self.record(self.part, 1)
        assert first == second, "two equal uses must give equal results"

    def test_uses_share_no_state(self) -> None:
        """A use gives the same results after and during another use."""
        alone, steps = self.record(self.part, 1), []
        other = self.use(self.part, 2) if self.together else iter(self.record(self.part, 2))
        for step in self.use(self.part, 1):
            steps.append(bits(step))
            next(other, None)
        assert steps == alone, "a use must not change the results of another use"

    def test_fields_stay_as_they_are(self) -> None:
        """Using a part does not change its description, including lists and arrays."""
        before = bits(self.part)
        self.record(self.part, 1)
        assert bits(self.part) == before, "a use must not change the fields of the part"

    def test_arguments_stay_as_they_are(self) -> None:
        """The part changes only those arguments that its protocol allows."""
        self.record(self.part, 1)
        for value, before in self.lent:
            assert bits(value) == before, f"the part must not change an argument to {value!r}"

    def test_the_clock_does_not_matter(self) -> None:
        """Results do not depend on the time of day."""
        now = self.record(self.part, 1)
        with later():
            then = self.record(self.part, 1)
        assert then == now, "the results must not depend on the clock"

    def test_global_random_generators_do_not_matter(self) -> None:
        """All random numbers come from the generators given to the part."""
        records = []
        for seed in (1, 2):
            with _global_seed(seed) as is_untouched:
                records.append(self.record(self.part, 1))
                assert is_untouched(), "the part must not draw from numpy.random or random"
        assert records[0] == records[1], "the results must not depend on numpy.random or random"

    def test_a_pickled_part_gives_equal_bits(self) -> None:
        """A pickled copy of the part, as received by a worker process, gives equal results."""
        here, there = self.record(self.part, 1), self.record(self.copy(), 1)
        assert there == here, "a pickled part must give the same results"


def _list_bad_values(part: Any) -> Iterator[dict[str, Any]]:
    settable = {field.name for field in fields(part) if field.init}
    ruled = {name: (rule, optional) for name, rule, optional in list_rules(type(part))}
    for name, (rule, optional) in ruled.items():
        for value in _CANDIDATES if name in settable else ():
            if not (_holds(rule, value) or (optional and value is None)):
                yield {name: value}
    for name, hint in get_type_hints(type(part)).items():
        if name in settable and name not in ruled and _is_number(hint):
            yield from ({name: value} for value in (math.nan, "wrong"))


def _holds(rule: Rule, value: Any) -> bool:
    try:
        return bool(rule.holds(value))
    except Exception:  # the constructor then raises the same error, which the test reports
        return False


def _is_number(hint: Any) -> bool:
    kinds = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    return any(kind in (int, float) for kind in kinds)


def _find_problem(part: Any, values: Mapping[str, Any]) -> str:
    """Return what is wrong with the rejection of invalid values, or "" if correct."""
    given = ", ".join(f"{name}={quote(value)}" for name, value in values.items())
    call = f"{type(part).__name__}({given})"
    try:
        replace(part, **values)
    except InputError as error:
        message = str(error)
        if "\n" in message:
            return f"the message of {call} must be one line, but is {message!r}"
        if not any(f"{field.name}: must" in message for field in fields(part)):
            return f"the message of {call} must contain 'FIELD: must', but is {message!r}"
        if not any(quote(value) in message for value in _pieces(values)):
            return f"the message of {call} must quote the value, but is {message!r}"
        return ""
    except Exception as error:
        return f"{call} must raise InputError, not {error!r}"
    fix = "put `@checked` below `@dataclass`, and give each field a rule"
    return f"{call} must raise InputError; {fix}"


def _pieces(values: Mapping[str, Any]) -> Iterator[Any]:
    for value in values.values():
        yield value
        if isinstance(value, list | tuple):
            yield from value


@contextmanager
def later() -> Iterator[None]:
    """Advance Python's clocks in every module that has imported them."""
    changed: dict[Any, Any] = {
        getattr(time, name): _forward(getattr(time, name), LATER_S) for name in _CLOCKS
    }
    for name in (f"{clock}_ns" for clock in _CLOCKS):
        changed[getattr(time, name)] = _forward(getattr(time, name), LATER_S * 10**9)
    changed |= {datetime.datetime: _LaterDatetime, datetime.date: _LaterDate}
    before = list(_find(changed))
    for namespace, name, value in before:
        namespace[name] = changed[value]
    try:
        yield
    finally:
        for namespace, name, value in before:
            namespace[name] = value


def _find(values: dict[Any, Any]) -> Iterator[tuple[dict[str, Any], str, Any]]:
    by_id = {id(value): value for value in values}
    for module in list(sys.modules.values()):
        namespace = getattr(module, "__dict__", None)
        if namespace is None or namespace is globals():
            continue
        for name, value in list(namespace.items()):
            if id(value) in by_id:
                yield namespace, name, value


def _forward(clock: Callable[[], Any], by: Any) -> Callable[[], Any]:
    return lambda: clock() + by


class _LaterDatetime(datetime.datetime):
    @classmethod
    def now(cls, tz: datetime.tzinfo | None = None) -> Any:
        return datetime.datetime.fromtimestamp(time.time(), tz)

    @classmethod
    def utcnow(cls) -> Any:
        return cls.now(datetime.UTC).replace(tzinfo=None)

    @classmethod
    def today(cls) -> Any:
        return cls.now()


class _LaterDate(datetime.date):
    @classmethod
    def today(cls) -> Any:
        return _LaterDatetime.now().date()


@contextmanager
def _global_seed(seed: int) -> Iterator[Callable[[], bool]]:
    """Seed the global generators of Python and numpy; yield a check that neither was used."""
    python, numpy = random.getstate(), np.random.get_state()
    random.seed(seed)
    np.random.seed(seed)
    fresh = _global_state()
    try:
        yield lambda: _global_state() == fresh
    finally:
        random.setstate(python)
        np.random.set_state(numpy)


def _global_state() -> Any:
    return random.getstate(), repr(np.random.get_state(legacy=False))
