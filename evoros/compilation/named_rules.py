"""Rules take values by name: some arguments of their kind, and the values of their start.

The mission loop calls all rules of a kind alike, with flat arrays. An adapter stands between the
loop and a rule: it unpacks the parameters and the memory, and leaves out the arguments that the
rule does not take.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from dis import get_instructions
from functools import cached_property
from inspect import isfunction, signature
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

from evoros.base.arrays import Array
from evoros.base.checks import quote
from evoros.base.errors import InputError
from evoros.base.packing import pack, unpack

Started: TypeAlias = "NamedTuple | tuple[NamedTuple | None, NamedTuple] | None"
"""The start of a rule: its parameters, or its parameters and its memory; None for neither."""


UNUSED = "_"
"""An argument of the loop's calls that rules of a kind do not get."""


class Nothing(NamedTuple):
    """The parameters or the memory of a rule that has none."""


@dataclass(frozen=True)
class NamedRule:
    """A rule, called with all ``arguments`` of its kind."""

    function: Callable[..., Any]
    arguments: tuple[str, ...]
    parameters: type[NamedTuple] = Nothing
    memory: type[NamedTuple] = Nothing

    @cached_property
    def interpreted(self) -> Callable[..., Any]:
        """The rule with the arguments of its kind."""
        return self.adapt(self.function)

    def __call__(self, *arguments: Any) -> Any:
        """Call the rule."""
        return self.interpreted(*arguments)

    def adapt(self, rule: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function of all arguments that calls ``rule``, a form of this one, with its own.

        To numba, it lies where the rule does, so that both are kept on disk under the same name.

        Raises:
            InputError: the rule takes another argument, or uses a field that is not declared.
        """
        for problem in self._find_problems():
            raise InputError(f"{name_rule(self.function)}: {problem}; correct the rule")
        named = {name: f"unpack({name}_kind, {name})" for name in ("parameters", "memory")}
        taken = ", ".join(named.get(name, name) for name in signature(self.function).parameters)
        source = f"lambda {', '.join(self.arguments)}: rule({taken})"
        place = getattr(self.function, "__code__", None)
        names: dict[str, Any] = {"rule": rule, "unpack": unpack}
        names |= {"parameters_kind": self.parameters, "memory_kind": self.memory}
        adapter: Callable[..., Any] = eval(
            compile(source, place.co_filename if place else "adapter", "eval"), names
        )
        if place:
            adapter.__code__ = adapter.__code__.replace(co_firstlineno=place.co_firstlineno)
            adapter.__module__ = self.function.__module__
            adapter.__qualname__ = self.function.__qualname__
        return adapter

    def _find_problems(self) -> Iterator[str]:
        kinds = {"parameters": self.parameters, "memory": self.memory}
        taken = signature(self.function).parameters
        for name in taken:
            if name not in self.arguments:
                known = ", ".join(name for name in self.arguments if name != UNUSED)
                yield f"must take arguments of {known}, not {name}"
            if kinds.get(name) is Nothing:
                yield f"must not take {name}, because its start returns none"
        if isfunction(self.function):
            for before, after in pairwise(get_instructions(self.function)):
                # Newer versions of Python load two variables at once.
                loaded = before.argval[-1] if isinstance(before.argval, tuple) else before.argval
                if not before.opname.startswith("LOAD_FAST") or after.opname != "LOAD_ATTR":
                    continue
                kind = kinds.get(loaded)
                if kind is not None and not hasattr(kind, after.argval):
                    fields = ", ".join(kind._fields)
                    yield f"must use fields of {kind.__qualname__} ({fields}), not {after.argval}"


def name_rule(rule: Any) -> str:
    """Name the place of a rule's definition in a message, or the class of a callable object."""
    function = rule.function if isinstance(rule, NamedRule) else rule
    definition = function if hasattr(function, "__qualname__") else type(function)
    return f"{definition.__module__}.{definition.__qualname__}"


class Bound(NamedTuple):
    """A rule with its parameters and its memory, as the mission loop has them."""

    rule: NamedRule
    parameters: Array
    memory: Array

    def __call__(self, *arguments: Any) -> Any:
        """Call the rule with the other arguments of its kind."""
        return self.rule(self.parameters, self.memory, *arguments)


def start_part(start: Callable[..., Started], *arguments: Any) -> Started:
    """Call the ``start`` of a part.

    Raises:
        InputError: a named tuple that it makes lacks a field, or gets one too many.
    """
    try:
        return start(*arguments)
    except TypeError as error:
        kind, constructor, problem = str(error).partition(".__new__() ")
        if not constructor:
            raise
        raise InputError(
            f"{name_rule(start)}: its {kind} must have one value for each field ({problem}); "
            f"correct the start"
        ) from error


def bind(function: Callable[..., Any], arguments: tuple[str, ...], started: Started) -> Bound:
    """Pack the start of a rule of the kind with these arguments.

    Raises:
        InputError: it is no named tuple, or a value does not fit its field.
    """
    pair: Any = started if type(started) is tuple else (started, None)
    for values in pair:
        if len(pair) != 2 or not (values is None or hasattr(values, "_fields")):
            raise InputError(
                f"{name_rule(function)}: its start must return the parameters as a named tuple, or "
                f"a pair of parameters and memory, not {quote(values)}; correct the start"
            )
    parameters, memory = (Nothing() if values is None else values for values in pair)
    rule = NamedRule(function, arguments, type(parameters), type(memory))
    return Bound(rule, pack(parameters), pack(memory))
