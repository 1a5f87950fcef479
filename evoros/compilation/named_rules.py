"""Adapters that call a rule with only the arguments that its signature names."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from inspect import signature
from typing import Any, NamedTuple, TypeAlias, cast

from evoros.base.arrays import Array
from evoros.base.checks import Rule, ask, quote
from evoros.base.errors import InputError
from evoros.base.packing import pack, unpack

Started: TypeAlias = "NamedTuple | tuple[NamedTuple | None, NamedTuple] | None"
"""Start values of a rule: parameters, (parameters, memory), or None for neither."""

UNUSED = "_"  # loop argument that rules of a kind do not receive


class Nothing(NamedTuple):
    """Empty parameters or an empty memory of a rule."""


@dataclass(frozen=True)
class NamedRule:
    """A rule that is called with all ``arguments`` of its kind."""

    function: Callable[..., Any]
    arguments: tuple[str, ...]
    parameters: type[NamedTuple] = Nothing
    memory: type[NamedTuple] = Nothing

    @cached_property
    def interpreted(self) -> Callable[..., Any]:
        """The rule as a function of all arguments of its kind."""
        return self.adapt(self.function)

    def __call__(self, *arguments: Any) -> Any:
        """Call the rule."""
        return self.interpreted(*arguments)

    def adapt(self, rule: Callable[..., Any]) -> Callable[..., Any]:
        """Wrap ``rule``, the Python or compiled form of this rule, to accept all arguments."""
        # numba cannot compile ``**`` in a call, and closures take four times as long
        kinds = {"parameters": self.parameters, "memory": self.memory}
        for name in signature(self.function).parameters:
            problem = ""
            if name not in self.arguments:
                known = ", ".join(name for name in self.arguments if name != UNUSED)
                problem = f"must take only the arguments {known}, not {name}"
            elif kinds.get(name) is Nothing:
                problem = f"has the argument {name}, which start() does not return"
            if problem:
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
            adapter.__module__ = self.function.__module__
            adapter.__qualname__ = self.function.__qualname__
        return adapter


def name_rule(rule: Any) -> str:
    """Return the full name of a rule, or of the class of a callable object, for a message."""
    function = rule.function if isinstance(rule, NamedRule) else rule
    definition = function if hasattr(function, "__qualname__") else type(function)
    return f"{definition.__module__}.{definition.__qualname__}"


class Bound(NamedTuple):
    """A rule with packed parameters and memory."""

    rule: NamedRule
    parameters: Array
    memory: Array

    def __call__(self, *arguments: Any) -> Any:
        """Call the rule with the other arguments of its kind."""
        return self.rule(self.parameters, self.memory, *arguments)


def _are_started(value: object) -> bool:
    pair = value if type(value) is tuple else (value, None)
    return len(pair) == 2 and all(one is None or hasattr(one, "_fields") for one in pair)


STARTED = Rule("named tuples (parameters, or parameters and memory) or None", _are_started)


def start_rule(
    rule: Callable[..., Any], names: tuple[str, ...], start: Callable[..., Started], *arguments: Any
) -> Bound:
    """Start a part with ``arguments`` and bind its rule; ``names`` lists its kind's arguments."""
    return bind(rule, names, start_part(start, *arguments))


def start_part(start: Callable[..., Started], *arguments: Any) -> Started:
    """Call the ``start`` of a part, and check the return value."""
    try:
        return cast(Started, ask("", start, STARTED, *arguments))
    except TypeError as error:
        kind, constructor, problem = str(error).partition(".__new__() ")
        if not constructor:
            raise
        raise InputError(
            f"{name_rule(start)}: {kind} must have one value for each field ({problem}); "
            f"correct start()"
        ) from error


def bind(function: Callable[..., Any], arguments: tuple[str, ...], started: Started) -> Bound:
    """Pack the start values of a rule; ``arguments`` lists the arguments of its kind."""
    pair: Any = started if type(started) is tuple else (started, None)
    if not STARTED.holds(started):
        raise InputError(
            f"{name_rule(function)}: start() must return {STARTED.text}, not {quote(started)}; "
            f"correct start()"
        )
    parameters, memory = (Nothing() if values is None else values for values in pair)
    rule = NamedRule(function, arguments, type(parameters), type(memory))
    return Bound(rule, pack(parameters), pack(memory))
