"""Compiles the mission loop once per combination of parts, and runs it with compiled rules."""

from collections.abc import Callable, Iterable, Sequence
from ctypes import PYFUNCTYPE, c_char_p, c_void_p, py_object, pythonapi
from functools import cache, partial
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.cgutils import create_struct_proxy
from numba.extending import lower_builtin, type_callable
from numpy.typing import NDArray

from evoros.compilation.draws import RNG
from evoros.compilation.interrupts import hold_interrupts
from evoros.compilation.kernel import RULES, make_kernel_generator
from evoros.compilation.machine_code import BORROWING, compile_function, compiling
from evoros.compilation.named_rules import name_rule
from evoros.compilation.records import WORD, Reader, count_words, list_words
from evoros.compilation.rules import (
    A1,
    A2,
    F8,
    FILTER,
    I8,
    LAYER,
    SIMULATION_RULES,
    CompiledRule,
    NotCompilable,
    compile_if_possible,
    try_compile,
)
from evoros.mission.inputs import (
    STAGES,
    Agents,
    Arrays,
    FilterStage,
    LayerStage,
    Loop,
    LoopCall,
    LoopInputs,
    LoopResult,
    Timing,
    compile_calls,
    get_stage,
    run_with_calls,
)
from evoros.mission.loop import run_loop
from evoros.simulator.protocol import SimulationRules

TABLE = types.Array(I8, 2, "C")  # a row of words per stage; rules and generators are addresses
# Kernels use numbers for rules, and addresses of states for generators. The type is read-only so
# that it differs from TABLE.
KERNEL_TABLE = types.Array(I8, 2, "C", readonly=True)


def name_records(motion: Iterable[Any], table: Any) -> dict[Any, Any]:
    """Return the numba types of the loop's arguments, for these motion rules and tables."""
    truths, integers = types.Array(types.boolean, 1, "C"), types.Array(I8, 1, "C")
    fields: dict[Any, tuple[Any, ...]] = {
        LoopInputs: (*motion, A1, A1, *(table,) * len(STAGES), I8),
        Agents: (A1, truths, truths, *(integers,) * 6),
        Timing: (F8, *(I8,) * 5),
        Arrays: (A2, *(A1,) * 8, A2, A1, A2, A2),
    }
    return {kind: types.NamedTuple(kinds, kind) for kind, kinds in fields.items()}


def _name_types(rule: Any, layer: Any) -> dict[type[FilterStage | LayerStage], Any]:
    stage = (I8, rule, A1, A1, RNG, A1, A1, I8, I8)
    return {
        FilterStage: types.NamedTuple(stage, FilterStage),
        LayerStage: types.NamedTuple((layer, A1, A1), LayerStage),
    }


STAGE_TYPES = _name_types(types.FunctionType(FILTER), types.FunctionType(LAYER))
KERNEL_STAGES = _name_types(RULES["filter"], RULES["layer"])

_BITS = types.NumPyRandomBitGeneratorType("bit_generator")

# A copy, because setting argument types on pythonapi itself affects the whole process.
_find_pointer = PYFUNCTYPE(c_void_p, py_object, c_char_p)(("PyCapsule_GetPointer", pythonapi))


def find_address(value: Any) -> int:
    """Return the address of a compiled rule or a generator."""
    if hasattr(value, "bit_generator"):
        return int(_find_pointer(value.bit_generator.capsule, b"BitGenerator"))
    return int(value.__wrapper_address__())


def tabulate(
    kind: type[FilterStage | LayerStage],
    stages: Sequence[FilterStage | LayerStage],
    name: Callable[[Any], int] = find_address,
) -> NDArray[np.int64]:
    """Return the table of compiled stages; the caller must keep the stages alive."""
    types_ = STAGE_TYPES[kind]
    rows = [list(list_words(types_, stage, name)) for stage in stages]
    return np.array(rows, dtype=np.int64).reshape(len(stages), count_words(types_))


def tabulate_stages(inputs: LoopInputs, tabulate: Callable[..., Any] = tabulate) -> LoopInputs:
    """Return the inputs with a table in place of each tuple of stages."""
    tables = {name: tabulate(kind, getattr(inputs, name)) for name, kind in STAGES.items()}
    return inputs._replace(**tables)


@type_callable(get_stage)  # type: ignore[untyped-decorator]
def _type(context: Any) -> Any:
    def name_type(kind: Any, table: Any, place: Any) -> Any:
        stages = KERNEL_STAGES if table == KERNEL_TABLE else STAGE_TYPES
        return stages[kind.instance_class]

    return name_type


@lower_builtin(get_stage, types.NamedTupleClass, types.Array, types.Integer)  # type: ignore[untyped-decorator]
def _get_stage(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    stage, table = signature.return_type, signature.args[1]
    start = builder.mul(arguments[2], ir.Constant(arguments[2].type, count_words(stage)))
    place = builder.gep(context.make_array(table)(context, builder, arguments[1]).data, [start])
    make_generator = make_kernel_generator if table == KERNEL_TABLE else _make_generator
    return Reader(context, builder, place, make_generator).read(stage)


def _make_generator(context: Any, builder: Any, address: Any) -> Any:
    functions = builder.inttoptr(address, WORD.as_pointer())
    rng = create_struct_proxy(RNG)(context, builder)
    bits = create_struct_proxy(_BITS)(context, builder)
    names = ("state", "fnptr_next_uint64", "fnptr_next_uint32", "fnptr_next_double")
    for place, name in enumerate(names):
        value = builder.load(builder.gep(functions, [WORD(place)]))
        setattr(bits, name, value)
    rng.bit_generator = bits._getvalue()
    return rng._getvalue()


SIGNATURES: dict[type, Any] = {FilterStage: FILTER, LayerStage: LAYER}


def run_call(call: LoopCall) -> LoopResult:
    """Run the loop, compiled if possible."""
    loop, inputs = prepare(call.inputs)
    return loop(inputs, *call[1:])


def prepare(inputs: LoopInputs) -> tuple[Loop, LoopInputs]:
    """Choose the compiled loop if all filters can be compiled, otherwise the interpreted loop."""
    motion = SimulationRules(*map(compile_if_possible, inputs[:3], SIMULATION_RULES))
    live = not all(isinstance(rule, CompiledRule) for rule in motion)
    stages: dict[str, Any] = {
        name: tuple(
            stage._replace(rule=compile_if_possible(stage.rule, SIGNATURES[type(stage)]))
            for stage in getattr(inputs, name)
        )
        for name in STAGES
    }
    every = [stage for group in stages.values() for stage in group]
    interpreted = {type(stage) for stage in every if not isinstance(stage.rule, CompiledRule)}
    loop: Loop = run_loop
    if FilterStage not in interpreted:
        run = _run
        if live or interpreted:
            compile_calls()
            run = run_with_calls
        loop = partial(run, _run_tabulated)
    return loop, inputs._replace(**({} if live else motion._asdict()), **stages)


def _run(loop: Loop, *arguments: Any) -> LoopResult:
    with hold_interrupts():
        return loop(*arguments)


def explain_interpreted(inputs: LoopInputs) -> list[str]:
    """Return one line for each rule that is interpreted although the simulator is compiled."""
    rules: list[tuple[Any, Any]] = [*zip(inputs[:3], SIMULATION_RULES, strict=True)]
    stages = [stage for name in STAGES for stage in getattr(inputs, name)]
    rules += [(stage.rule, SIGNATURES[type(stage)]) for stage in stages]
    answers = [(name_rule(rule), try_compile(rule, kind)) for rule, kind in rules]
    reasons = [
        f"{name} is not compiled: {reason}"
        for name, reason in answers
        if isinstance(reason, NotCompilable)
    ]
    return list(dict.fromkeys(reasons))


def _run_tabulated(inputs: LoopInputs, *arguments: Any) -> LoopResult:
    tabulated = tabulate_stages(inputs)  # must stay alive until the loop ends
    result: LoopResult = compile_loop()(tabulated, *arguments)
    return result


@cache
def compile_loop() -> Any:
    """Compile the loop once per process, and return its entry point."""
    records = name_records(map(types.FunctionType, SIMULATION_RULES), TABLE)
    signature = types.NamedTuple((I8, I8, types.boolean), LoopResult)(*records.values())
    with compiling() as cached:
        loop = compile_function(run_loop, signature, cached, **BORROWING)
    # The entry point skips numba's type checks of arguments, which take as long as all other Python
    # code of a mission. ``collect_inputs`` checks the arrays instead.
    return loop.get_compile_result(signature).entry_point
