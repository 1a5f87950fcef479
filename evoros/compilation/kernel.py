"""Kernels: the mission loop and its rules as one program, for this processor or a GPU.

The code is numba's before optimization, so results are bitwise equal on all targets.
"""

import hashlib
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import types
from numba.core.cgutils import create_struct_proxy, get_or_insert_function
from numba.core.datamodel.models import PrimitiveModel
from numba.core.registry import cpu_target
from numba.core.typing.templates import Signature
from numba.extending import lower_builtin, register_model

from evoros.compilation.draws import RNG
from evoros.compilation.kernel_runtime import RUNTIME
from evoros.compilation.machine_code import Lowered, cache_folder
from evoros.compilation.records import WORD
from evoros.compilation.rules import ADVANCE, FILTER, LAYER, OBSERVE, SENSE, NotCompilable
from evoros.files.disk import write_atomically
from evoros.terminal.activity import announce

DRAWS = {"next_uint64": WORD, "next_uint32": ir.IntType(32), "next_double": ir.DoubleType()}
"""Result types of a kernel's random functions, defined in ``kernel_runtime.py``."""
_BITS = types.NumPyRandomBitGeneratorType("bit_generator")


class NumberedRule(types.Callable):  # type: ignore[misc]
    """The numba type of a rule identified by its number among the rules of a kind."""

    def __init__(self, kind: str, signature: Signature) -> None:
        self.symbol, self.signature = f"evoros.{kind}", signature
        super().__init__(f"NumberedRule({kind})")

    def get_call_type(self, context: Any, arguments: Any, keywords: Any) -> Signature:
        """Return a signature whose receiver is this type, so that calls pass the rule's number."""
        return Signature(self.signature.return_type, self.signature.args, recvr=self)

    def get_call_signatures(self) -> tuple[list[Signature], bool]:
        """Return the only signature."""
        return [self.signature], False

    def get_impl_key(self, signature: Signature) -> Any:
        """Return the key under which ``_call`` is registered."""
        return NumberedRule


@register_model(NumberedRule)
class _Model(PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, WORD)


RULES = {
    "observe": NumberedRule("observe", OBSERVE),
    "sense": NumberedRule("sense", SENSE),
    "advance": NumberedRule("advance", ADVANCE),
    "filter": NumberedRule("filter", FILTER),
    "layer": NumberedRule("layer", LAYER),
}

for _name in (*RULES, *DRAWS):
    # numba resolves all names in compiled code, although the code is never called here
    llvm.add_symbol(f"evoros.{_name}", 1)


@lower_builtin(NumberedRule, NumberedRule, types.VarArg(types.Any))  # type: ignore[untyped-decorator]
def _call(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Call the function of the kind; errors in rules are ignored, as in all compiled missions."""
    kind, *kinds = signature.args
    convention, numbered = context.call_conv, (types.int64, *kinds)
    function = get_or_insert_function(
        builder.module, convention.get_function_type(signature.return_type, numbered), kind.symbol
    )
    _, result = convention.call_function(
        builder, function, signature.return_type, numbered, arguments
    )
    return result


def make_kernel_generator(context: Any, builder: Any, state: Any) -> Any:
    """Generate code that makes a random generator from a state, with the kernel's functions."""
    rng = create_struct_proxy(RNG)(context, builder)
    bits = create_struct_proxy(_BITS)(context, builder)
    bits.state = state
    for name, result in DRAWS.items():
        kind = ir.FunctionType(result, [WORD])
        function = get_or_insert_function(builder.module, kind, f"evoros.{name}")
        setattr(bits, f"fnptr_{name}", builder.ptrtoint(function, WORD))
    rng.bit_generator = bits._getvalue()
    return rng._getvalue()


_ARITHMETIC = re.compile(
    r"\b(?:add|sub|mul|div|fma|mad|sqrt|rcp|rsqrt|sin|cos|tanh|ex2|lg2|min|max)"
    r"\.[\w.:]*\bf(?:16|16x2|32|64)\b"
)
_EXACT = re.compile(r"(?:(?:add|sub|mul|div|sqrt|rcp)\.rn|min|max)\.f64")
_OTHER = re.compile(
    r"\.extern\s+\.func[^;]*|\.callprototype|[\w.]*\.(?:ftz|approx|full|sat)\b[\w.]*"
)
_RUN_ROW = """
declare i32 @{run}(ptr, ptr, i64)

define void @evoros.run_row(i64 %rows, i64 %width, i64 %i) alwaysinline {{
  %result = alloca ptr
  %error = alloca ptr
  %offset = mul i64 %i, %width
  %row = add i64 %rows, %offset
  %status = call i32 @{run}(ptr %result, ptr %error, i64 %row)
  ret void
}}
"""

_EACH_ROW = """
define void @{entry}(i64 %rows, i64 %width, i64 %first, i64 %end) {{
entry:
  br label %loop
loop:
  %i = phi i64 [ %first, %entry ], [ %next, %body ]
  %more = icmp slt i64 %i, %end
  br i1 %more, label %body, label %done
body:
  call void @evoros.run_row(i64 %rows, i64 %width, i64 %i)
  %next = add i64 %i, 1
  br label %loop
done:
  ret void
}}
"""

_ROW_OF_THREAD = """
declare i32 @llvm.nvvm.read.ptx.sreg.tid.x()
declare i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
declare i32 @llvm.nvvm.read.ptx.sreg.ntid.x()

define ptx_kernel void @{entry}(i64 %rows, i64 %width, i64 %first, i64 %end) {{
  %thread = call i32 @llvm.nvvm.read.ptx.sreg.tid.x()
  %block = call i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
  %threads = call i32 @llvm.nvvm.read.ptx.sreg.ntid.x()
  %thread64 = zext i32 %thread to i64
  %block64 = zext i32 %block to i64
  %threads64 = zext i32 %threads to i64
  %before = mul i64 %block64, %threads64
  %place = add i64 %before, %thread64
  %i = add i64 %first, %place
  %more = icmp slt i64 %i, %end
  br i1 %more, label %body, label %done
body:
  call void @evoros.run_row(i64 %rows, i64 %width, i64 %i)
  br label %done
done:
  ret void
}}
"""

_HOST_ENTRY = _RUN_ROW + _EACH_ROW  # runs the missions in a range of rows, one after another
_GPU_ENTRY = _RUN_ROW + _ROW_OF_THREAD  # runs the mission of one row per thread
ENTRY = "evoros_fly"  # function to launch: address of row 0, bytes per row, first row, end row
GPU = "sm_80"  # oldest GPU generation supported
_NOT_EXACT = re.compile(
    r"llvm\.(fma|fmuladd|frem|pow|powi|exp\d*|log\d*|a?(?:sin|cos|tan)h?|atan2|ldexp|frexp)\."
)
_REMAINDER = re.compile(r"= frem double ([^\s,]+), ([^\s,]+)")
Parts = Mapping[str, Mapping[int, Lowered]]  # rules of a kernel by kind and number


@dataclass(frozen=True)
class Target:
    """A processor for which kernels are compiled."""

    entry: str
    triple: str
    processor: str
    features: str = ""
    is_text: bool = False

    def make_machine(self) -> Any:
        """Create the target machine of LLVM."""
        llvm.initialize_all_targets()
        llvm.initialize_all_asmprinters()
        target = llvm.Target.from_triple(self.triple)
        jit = not self.is_text
        return target.create_target_machine(self.processor, self.features, 3, jit=jit)

    def emit(self, machine: Any, module: Any) -> bytes:
        """Return the code of a module, as PTX or as an object file."""
        if self.is_text:
            return str(machine.emit_assembly(module)).encode()
        return bytes(machine.emit_object(module))


def target_gpu() -> Target:
    """Return the target for NVIDIA GPUs, in PTX."""
    return Target(_GPU_ENTRY, "nvptx64-nvidia-cuda", GPU, is_text=True)


def target_host() -> Target:
    """Return the target of this processor."""
    processor, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return Target(_HOST_ENTRY, llvm.get_process_triple(), processor, features)


def make_kernel(target: Target, run: Lowered, rules: Parts) -> bytes | NotCompilable:
    """Compile the code that runs missions, or load it from disk."""
    path = _find_path(target, run, rules)
    if path is not None:
        with suppress(OSError):
            return path.read_bytes()
    with announce("compiling"):
        machine = target.make_machine()
        module = link_kernel(target, str(machine.target_data), run, rules)
        optimize(module, machine)
        if foreign := find_foreign(module):
            return NotCompilable(
                f"its rules call {', '.join(foreign)}, which kernels do not support"
            )
        code = target.emit(machine, module)
        if target.is_text and (inexact := find_inexact(code.decode())):
            return NotCompilable(
                f"its code contains {', '.join(inexact)}, which is inexact on a GPU"
            )
    if path is not None:
        with suppress(OSError):
            write_atomically(path, code)
    return code


def _find_path(target: Target, run: Lowered, rules: Parts) -> Path | None:
    folder = cache_folder()
    if folder is None:
        return None
    digest = hashlib.sha256(repr((target, RUNTIME)).encode() + run.module.as_bitcode())
    for kind in RULES:
        for number, lowered in rules[kind].items():
            digest.update(f"{kind} {number} {lowered.name}".encode() + lowered.module.as_bitcode())
    return folder / f"kernel-{digest.hexdigest()[:32]}"


def link_kernel(target: Target, layout: str, run: Lowered, rules: Parts) -> Any:
    """Link the mission function and its rules to a module with one entry point."""
    module = llvm.parse_assembly(RUNTIME + target.entry.format(entry=ENTRY, run=run.name))
    calls = [llvm.parse_assembly(_write_call(RULES[kind], rules[kind])) for kind in RULES]
    lowered = {rule.name: rule.module for kind in RULES for rule in rules[kind].values()}
    # a function is linked only if an earlier part calls it
    for part in (module, *map(_take, (run.module, *calls, *lowered.values()))):
        part.triple, part.data_layout = target.triple, layout
        if part is not module:
            module.link_in(part)
    for thing in (*module.functions, *module.global_variables):
        if not thing.is_declaration and thing.name != ENTRY:
            thing.linkage = "internal"
    module.verify()
    return module


def _take(part: Any) -> Any:
    """Return a copy of a module that computes remainders with the kernel runtime's function."""
    code, count = _REMAINDER.subn(
        r"= call double @evoros.remainder(double \1, double \2)", str(part)
    )
    if not count:
        return part.clone()
    return llvm.parse_assembly(f"{code}\ndeclare double @evoros.remainder(double, double)\n")


def _write_call(kind: NumberedRule, rules: Mapping[int, Lowered]) -> str:
    convention, rule = cpu_target.target_context.call_conv, kind.signature
    module = ir.Module()
    numbered = convention.get_function_type(rule.return_type, (types.int64, *rule.args))
    function = ir.Function(module, numbered, kind.symbol)
    choose = ir.IRBuilder(function.append_basic_block())
    otherwise = function.append_basic_block()
    ir.IRBuilder(otherwise).ret(ir.IntType(32)(0))
    # first arguments: pointers to the result and to an error
    result, error, number, *arguments = function.args
    switch = choose.switch(number, otherwise)
    called: dict[str, Any] = {}
    for i, (name, _) in rules.items():
        if name not in called:
            callee = convention.get_function_type(rule.return_type, rule.args)
            called[name] = ir.Function(module, callee, name)
        block = function.append_basic_block()
        switch.add_case(number.type(i), block)
        builder = ir.IRBuilder(block)
        builder.ret(builder.call(called[name], [result, error, *arguments]))
    return str(module)


def optimize(module: Any, machine: Any) -> None:
    """Optimize a module for a target machine."""
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)


def find_foreign(module: Any) -> list[str]:
    """Return the called functions that are undefined or inexact."""
    names = [function.name for function in module.functions if function.is_declaration]
    return [name for name in names if not name.startswith("llvm.") or _NOT_EXACT.match(name)]


def find_inexact(ptx: str) -> list[str]:
    """Return the distinct PTX operations not rounded as in IEEE 754, such as fused ones."""
    arithmetic = [found[0] for found in _ARITHMETIC.finditer(ptx)]
    wrong = [name for name in arithmetic if not _EXACT.fullmatch(name)]
    wrong += [" ".join(found[0].split()) for found in _OTHER.finditer(ptx)]
    return list(dict.fromkeys(wrong))
