"""Compile rules with numba: the signature of each kind, and the elementary functions in them."""

from contextlib import suppress
from dis import get_instructions
from functools import cache
from inspect import isfunction
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from evoros.base.compilable import is_bundled, take_waiting
from evoros.base.errors import InputError
from evoros.compilation import packing  # noqa: F401 - tells numba
from evoros.compilation.draws import RNG
from evoros.compilation.machine_code import (
    BORROWING,
    NJIT_OPTIONS,
    Lowered,
    compile_function,
    compiling,
    lower,
    register,
)
from evoros.compilation.named_rules import NamedRule
from evoros.compilation.substitution import substitute

# Types of arguments: float, integer, arrays of one and two dimensions, random generator.
F8, I8 = types.float64, types.int64
A1, A2 = types.Array(F8, 1, "C"), types.Array(F8, 2, "C")
# Types of results.
NOTHING, TRUTH = types.void, types.boolean

# Signatures of the kinds of rules, as the protocols of filters, controllers and simulators have
# them.
FILTER = types.void(A1, A1, RNG, A1, A1, F8)
LAYER = types.boolean(A1, A1, A1, A1, A1, F8, A1)
OBSERVE = SENSE = types.void(A1, A1, A1)
ADVANCE = types.void(A1, A1, A1, F8)
SIMULATION_RULES = (OBSERVE, SENSE, ADVANCE)
_OF_MISSIONS = (FILTER, LAYER, OBSERVE, ADVANCE)


class CompiledRule(types.WrapperAddressProtocol):  # type: ignore[misc]
    """A compiled rule that Python calls as a function and compiled code calls by its address.

    numba would look up the address at every mission; this class looks it up once.
    """

    def __init__(self, dispatcher: Any, signature: Any, borrows: bool) -> None:
        self._signature = signature
        self.borrows = borrows  # whether it makes no arrays
        self._dispatcher = dispatcher
        result = dispatcher.get_compile_result(signature)
        self._address = result.library.get_pointer_to_function(
            result.fndesc.llvm_cfunc_wrapper_name
        )

    def __wrapper_address__(self) -> int:
        """The address of the machine code."""
        address: int = self._address
        return address

    def signature(self) -> Any:
        """The signature of the rule's kind."""
        return self._signature

    def lower(self) -> Lowered:
        """Return the code of the rule, for kernels."""
        return lower(self._dispatcher, self._signature)

    def __call__(self, *args: Any) -> Any:
        """Call the rule."""
        return self._dispatcher(*args)


class NotCompilable(Exception):
    """The reason why a rule can only be interpreted."""


@intrinsic  # type: ignore[untyped-decorator]
def call_address(typing: Any, address: Any) -> Any:
    """Call a C function without arguments and result, in compiled code, by its address (int)."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function = ir.FunctionType(ir.VoidType(), ()).as_pointer()
        builder.call(builder.inttoptr(arguments[0], function), ())
        return context.get_dummy_value()

    return types.void(I8), generate


def compile_rule(rule: Any, signature: Any) -> CompiledRule:
    """Compile a rule, once per process.

    Raises:
        NotCompilable: numba cannot compile the rule. It compiles plain functions only, because a
            method belongs to a live object, which numba does not know.
    """
    answer = try_compile(rule, signature)
    if isinstance(answer, NotCompilable):
        raise answer
    return answer


def try_compile(rule: Any, signature: Any) -> CompiledRule | NotCompilable:
    """Compile a rule, once per process, or return the reason why numba cannot."""
    # These checks come before the cache of _compile: a live engine has new methods and inner
    # functions at each mission, and the cache would compile each of them and keep it forever.
    function = _get_function(rule)
    if not isfunction(function):
        return NotCompilable("it is not a plain function")
    if function.__closure__ or "<locals>" in function.__qualname__:
        return NotCompilable("it is defined inside a function, not at the top of a module")
    return _compile(rule, signature)


def compile_if_possible(rule: Any, signature: Any) -> Any:
    """Compile a rule, or return a function of Python that does the same."""
    answer = try_compile(rule, signature)
    return answer if isinstance(answer, CompiledRule) else interpret_rule(rule)


def interpret_rule(rule: Any) -> Any:
    """Return a rule as Python calls it, with the elementary functions that compiled ones have."""
    if isinstance(rule, NamedRule):
        return rule.adapt(substitute(rule.function, helpers=True))
    return substitute(rule, helpers=True)


def _get_function(rule: Any) -> Any:
    return rule.function if isinstance(rule, NamedRule) else rule


def _adapt(rule: Any) -> Any:
    """Return the function of a rule with the signature of its kind."""
    function = substitute(_get_function(rule))
    if isinstance(rule, NamedRule):
        return rule.adapt(njit(inline="always", **NJIT_OPTIONS)(function))
    return function


@cache
def _compile(rule: Any, signature: Any) -> CompiledRule | NotCompilable:
    rule_function = _get_function(rule)
    # Errors do not pass from compiled code to its caller: the mission would go on without the rule.
    if any(step.opname == "RAISE_VARARGS" for step in get_instructions(rule_function)):
        return NotCompilable("it raises errors, which compiled code ignores")
    with compiling() as on_disk:
        for function, inlined in take_waiting(bundled=False):
            register(function, substitute(function), inlined)
        # Functions that a user's rule calls may change unnoticed, so every process compiles it.
        kept = on_disk and is_bundled(rule_function)
        if signature in _OF_MISSIONS:
            with suppress(Exception):  # a user's rule may make arrays
                borrowing = compile_function(_adapt(rule), signature, kept, **BORROWING)
                return CompiledRule(borrowing, signature, True)
        try:
            return CompiledRule(compile_function(_adapt(rule), signature, kept), signature, False)
        except InputError:
            raise
        except Exception as error:  # numba raises errors of many types
            return NotCompilable(_find_reason(str(error)))


def _find_reason(message: str) -> str:
    """Return the line of numba's message that says why it cannot compile a rule."""
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    reasons = [line for line in lines if not line.startswith(("Failed in", "During:", "File"))]
    return (reasons or lines or ["numba cannot compile it"])[0]
