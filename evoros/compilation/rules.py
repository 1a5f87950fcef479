"""Compiles rules: signatures, and elementary functions (``math.sin``, ``np.sin``)."""

import math
from contextlib import suppress
from dis import get_instructions
from functools import cache
from inspect import isfunction
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types, vectorize
from numba.extending import intrinsic, lower_builtin, type_callable
from numba.np.arrayobj import populate_array

from evoros.base import elementary
from evoros.base.compilable import compilable, is_bundled, take_waiting
from evoros.base.errors import InputError
from evoros.base.packing import list_dimensions, unpack
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

_INTEGER = ir.IntType(64)
_OF_BOTH = ("cos", "cosh", "exp", "expm1", "log", "log1p", "log2", "log10", "sin", "sinh", "tan")
_OF_NUMPY = {"acos": "arccos", "asin": "arcsin", "atan": "arctan", "atan2": "arctan2"}
# Types of arguments: float, integer, one- and two-dimensional arrays, random generator.
F8, I8 = types.float64, types.int64
A1, A2 = types.Array(F8, 1, "C"), types.Array(F8, 2, "C")
# Types of results.
NOTHING, TRUTH = types.void, types.boolean

# Signatures of rules by kind, as in the protocols of filters, controllers and simulators.
FILTER = types.void(A1, A1, RNG, A1, A1, F8)
LAYER = types.boolean(A1, A1, A1, A1, A1, F8, A1)
OBSERVE = SENSE = types.void(A1, A1, A1)
ADVANCE = types.void(A1, A1, A1, F8)
SIMULATION_RULES = (OBSERVE, SENSE, ADVANCE)
_OF_MISSIONS = (FILTER, LAYER, OBSERVE, ADVANCE)


class CompiledRule(types.WrapperAddressProtocol):  # type: ignore[misc]
    """A compiled rule, callable from Python and by its address, which is looked up once."""

    def __init__(self, dispatcher: Any, signature: Any, borrows: bool) -> None:
        self._signature = signature
        self.borrows = borrows  # whether the rule allocates no arrays
        self._dispatcher = dispatcher
        result = dispatcher.get_compile_result(signature)
        self._address = result.library.get_pointer_to_function(
            result.fndesc.llvm_cfunc_wrapper_name
        )

    def __wrapper_address__(self) -> int:
        address: int = self._address
        return address

    def signature(self) -> Any:
        """The numba signature shared by all rules of this kind."""
        return self._signature

    def lower(self) -> Lowered:
        """Return the LLVM code of the rule, for kernels."""
        return lower(self._dispatcher, self._signature)

    def __call__(self, *args: Any) -> Any:
        """Call the rule."""
        return self._dispatcher(*args)


class NotCompilable(Exception):
    """numba cannot compile a rule; the message is the reason."""


@intrinsic  # type: ignore[untyped-decorator]
def call_address(typing: Any, address: Any) -> Any:
    """Call a C function without arguments or result by its address, in compiled code."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function = ir.FunctionType(ir.VoidType(), ()).as_pointer()
        builder.call(builder.inttoptr(arguments[0], function), ())
        return context.get_dummy_value()

    return types.void(I8), generate


def compile_rule(rule: Any, signature: Any) -> CompiledRule:
    """Compile a rule, once per process; raise NotCompilable if numba cannot."""
    answer = try_compile(rule, signature)
    if isinstance(answer, NotCompilable):
        raise answer
    return answer


def try_compile(rule: Any, signature: Any) -> CompiledRule | NotCompilable:
    """Compile a rule, once per process, or return why numba cannot."""
    # Each mission has new methods of a live engine, all of which would stay in the cache of
    # _compile.
    function = _get_function(rule)
    if not isfunction(function):
        return NotCompilable("it is not a plain function")
    if function.__closure__ or "<locals>" in function.__qualname__:
        return NotCompilable("it is defined inside a function, not at the top level of a module")
    return _compile(rule, signature)


def compile_if_possible(rule: Any, signature: Any) -> Any:
    """Compile a rule if possible; otherwise, return an equivalent Python function."""
    answer = try_compile(rule, signature)
    return answer if isinstance(answer, CompiledRule) else interpret_rule(rule)


def interpret_rule(rule: Any) -> Any:
    """Return a rule in Python, with the elementary functions of compiled rules."""
    if isinstance(rule, NamedRule):
        return rule.adapt(substitute(rule.function, helpers=True))
    return substitute(rule, helpers=True)


def _get_function(rule: Any) -> Any:
    return rule.function if isinstance(rule, NamedRule) else rule


def _adapt(rule: Any) -> Any:
    function = substitute(_get_function(rule))
    if isinstance(rule, NamedRule):
        return rule.adapt(njit(inline="always", **NJIT_OPTIONS)(function))
    return function


@cache
def _compile(rule: Any, signature: Any) -> CompiledRule | NotCompilable:
    rule_function = _get_function(rule)
    # Compiled code ignores errors, so the mission would continue without the rule.
    if any(step.opname == "RAISE_VARARGS" for step in get_instructions(rule_function)):
        return NotCompilable("it raises errors, which compiled code ignores")
    with compiling() as on_disk:
        for function, inlined in take_waiting(bundled=False):
            register(function, substitute(function), inlined)
        # Users' rules are compiled in every process, because functions that they call may change.
        kept = on_disk and is_bundled(rule_function)
        if signature in _OF_MISSIONS:
            with suppress(Exception):  # a user's rule may allocate arrays
                borrowing = compile_function(_adapt(rule), signature, kept, **BORROWING)
                return CompiledRule(borrowing, signature, True)
        try:
            return CompiledRule(compile_function(_adapt(rule), signature, kept), signature, False)
        except InputError:
            raise
        except Exception as error:  # numba raises errors of many types
            return NotCompilable(_find_reason(str(error)))


def _find_reason(message: str) -> str:
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    reasons = [line for line in lines if not line.startswith(("Failed in", "During:", "File"))]
    return (reasons or lines or ["numba cannot compile it"])[0]


_OF_NUMPY |= {name: name for name in (*_OF_BOTH, "tanh", "hypot", "power")}


@compilable
def _log(x: float, base: float = math.e) -> float:
    value = elementary.log(x)
    return value if base == math.e else value / elementary.log(base)


@compilable
def _hypot(x: float, y: float = 0.0, z: float = 0.0) -> float:
    value = elementary.hypot(x, y)
    return value if z == 0.0 else elementary.hypot(value, z)


def _copy_module(module: ModuleType, replaced: dict[str, Any]) -> ModuleType:
    copy = ModuleType(module.__name__)
    copy.__dict__.update({**module.__dict__, **replaced})
    return copy


_own_math = {name: getattr(elementary, name) for name in (*_OF_BOTH, "tanh")}
_own_math |= {name: getattr(elementary, name) for name in ("acos", "asin", "atan", "atan2")}
_own_math |= {"pow": elementary.power, "log": _log, "hypot": _hypot}
# functions of numpy also accept arrays
_own_numpy = {numpys: vectorize(getattr(elementary, name)) for name, numpys in _OF_NUMPY.items()}
_MODULES = {math: _copy_module(math, _own_math), np: _copy_module(np, _own_numpy)}
_FUNCTIONS = {
    getattr(module, name): function
    for module, replaced in ((math, _own_math), (np, _own_numpy))
    for name, function in replaced.items()
}


def substitute(function: Any, helpers: bool = False) -> Any:
    """Copy a user's function (and its ``helpers``) to use the elementary functions of evoros."""
    if not isfunction(function) or is_bundled(function):
        return function
    return _substitute(function, helpers, {})


def _substitute(function: FunctionType, helpers: bool, known: dict[Any, Any]) -> FunctionType:
    names = _names(function.__code__)
    space = function.__globals__
    replaced = dict(space)
    known[function] = copy = FunctionType(
        function.__code__, replaced, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__kwdefaults__ = function.__kwdefaults__
    copy.__qualname__, copy.__module__ = function.__qualname__, function.__module__
    for name in names & space.keys():
        value = space[name]
        if isinstance(value, ModuleType):
            replaced[name] = _MODULES.get(value, value)
        elif helpers and isfunction(value) and value.__globals__ is space:
            replaced[name] = known.get(value) or _substitute(value, helpers, known)
        elif callable(value) and type(value).__hash__ is not None:
            replaced[name] = _FUNCTIONS.get(value, value)
    return copy


def _names(code: Any) -> set[str]:
    inner = (constant for constant in code.co_consts if hasattr(constant, "co_names"))
    return set(code.co_names).union(*map(_names, inner))


@type_callable(unpack)  # type: ignore[untyped-decorator]
def _type(context: Any) -> Any:
    def name_type(kind: Any, packed: Any) -> Any:
        counts = list_dimensions(kind.instance_class)
        fields = [types.Array(types.float64, n, "C") if n else types.float64 for n in counts]
        return types.NamedTuple(fields, kind.instance_class)

    return name_type


@lower_builtin(unpack, types.NamedTupleClass, types.Array)  # type: ignore[untyped-decorator]
def _unpack(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Make the named tuple; its arrays own no memory, so no references are counted."""
    result, packed = signature.return_type, signature.args[1]
    place = context.make_array(packed)(context, builder, arguments[1]).data
    values = []
    for field in result.types:
        count = field.ndim if isinstance(field, types.Array) else 0
        head = [builder.load(builder.gep(place, [_INTEGER(i)])) for i in range(max(count, 1))]
        place = builder.gep(place, [_INTEGER(len(head))])
        if count == 0:
            values += head
            continue
        shape = [builder.fptosi(length, _INTEGER) for length in head]
        array = borrow_array(context, builder, field, place, shape)
        place = builder.gep(place, [array.nitems])
        values.append(array._getvalue())
    return context.make_tuple(builder, result, values)


def borrow_array(context: Any, builder: Any, kind: Any, place: Any, shape: Any) -> Any:
    """Make a one- or two-dimensional array over values owned elsewhere."""
    item = _INTEGER(context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    strides = [builder.mul(shape[1], item), item] if len(shape) == 2 else [item]
    array = context.make_array(kind)(context, builder)
    populate_array(array, place, shape, strides, item, meminfo=None)
    return array
