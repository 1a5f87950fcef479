"""Kernels: the mission loop and its rules as one piece of code, for this processor or for a GPU.

The code is what numba makes of the same functions before it optimizes it for this processor. No
sum or product is contracted or reordered, and none asks a library, so that every target has the
same bits.
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
from numba.core.registry import cpu_target

from evoros.compilation.kernel_entries import GPU_ENTRY, HOST_ENTRY
from evoros.compilation.kernel_runtime import RUNTIME
from evoros.compilation.machine_code import Lowered, cache_folder
from evoros.compilation.numbered_rules import RULES, NumberedRule
from evoros.compilation.ptx import find_inexact
from evoros.compilation.rules import NotCompilable
from evoros.files.disk import write_atomically
from evoros.terminal.activity import announce

ENTRY = "evoros_fly"
"""The name of the function to launch: (first row, bytes of a row, first and end number)."""
GPU = "sm_80"
"""The oldest generation of GPUs whose drivers take the code; newer ones do, too."""
_NOT_EXACT = re.compile(
    r"llvm\.(fma|fmuladd|frem|pow|powi|exp\d*|log\d*|a?(?:sin|cos|tan)h?|atan2|ldexp|frexp)\."
)
_REMAINDER = re.compile(r"= frem double ([^\s,]+), ([^\s,]+)")
Parts = Mapping[str, Mapping[int, Lowered]]
"""The rules of a kernel by their kinds and numbers."""


@dataclass(frozen=True)
class Target:
    """A processor for which kernels are made."""

    entry: str
    triple: str
    processor: str
    features: str = ""
    is_text: bool = False

    def make_machine(self) -> Any:
        """Create the machine of LLVM."""
        llvm.initialize_all_targets()
        llvm.initialize_all_asmprinters()
        target = llvm.Target.from_triple(self.triple)
        jit = not self.is_text
        return target.create_target_machine(self.processor, self.features, 3, jit=jit)

    def emit(self, machine: Any, module: Any) -> bytes:
        """Return the code of a module: PTX, or an object file."""
        if self.is_text:
            return str(machine.emit_assembly(module)).encode()
        return bytes(machine.emit_object(module))


def target_gpu() -> Target:
    """Return the target of NVIDIA's GPUs, whose code is PTX."""
    return Target(GPU_ENTRY, "nvptx64-nvidia-cuda", GPU, is_text=True)


def target_host() -> Target:
    """Return the target of this processor."""
    processor, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return Target(HOST_ENTRY, llvm.get_process_triple(), processor, features)


def make_kernel(target: Target, run: Lowered, rules: Parts) -> bytes | NotCompilable:
    """Make the code that runs missions, or load it from the disk.

    ``run`` is the function of a mission, which gets the address of its row.
    """
    path = _find_path(target, run, rules)
    if path is not None:
        with suppress(OSError):
            return path.read_bytes()
    with announce("compiling"):
        machine = target.make_machine()
        module = link_kernel(target, str(machine.target_data), run, rules)
        optimize(module, machine)
        if foreign := find_foreign(module):
            return NotCompilable(f"its rules call {', '.join(foreign)}, which a kernel lacks")
        code = target.emit(machine, module)
        if target.is_text and (inexact := find_inexact(code.decode())):
            return NotCompilable(f"its code has {', '.join(inexact)}, which is not exact")
    if path is not None:
        with suppress(OSError):
            write_atomically(path, code)
    return code


def _find_path(target: Target, run: Lowered, rules: Parts) -> Path | None:
    """Return where the code of a kernel is kept; None if there is no such folder."""
    folder = cache_folder()
    if folder is None:
        return None
    digest = hashlib.sha256(repr((target, RUNTIME)).encode() + run.module.as_bitcode())
    for kind in RULES:
        for number, lowered in rules[kind].items():
            digest.update(f"{kind} {number} {lowered.name}".encode() + lowered.module.as_bitcode())
    return folder / f"kernel-{digest.hexdigest()[:32]}"


def link_kernel(target: Target, layout: str, run: Lowered, rules: Parts) -> Any:
    """Link the function of a mission and its rules to a module with one entry."""
    module = llvm.parse_assembly(RUNTIME + target.entry.format(entry=ENTRY, run=run.name))
    calls = [llvm.parse_assembly(_write_call(RULES[kind], rules[kind])) for kind in RULES]
    lowered = {rule.name: rule.module for kind in RULES for rule in rules[kind].values()}
    # A function is linked only if something before it calls it.
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
    """Return a copy of a module, with remainders by the function of the runtime."""
    code, count = _REMAINDER.subn(
        r"= call double @evoros.remainder(double \1, double \2)", str(part)
    )
    if not count:
        return part.clone()
    return llvm.parse_assembly(f"{code}\ndeclare double @evoros.remainder(double, double)\n")


def _write_call(kind: NumberedRule, rules: Mapping[int, Lowered]) -> str:
    """Write the function that calls the rule of a kind with a number."""
    convention, rule = cpu_target.target_context.call_conv, kind.signature
    module = ir.Module()
    numbered = convention.get_function_type(rule.return_type, (types.int64, *rule.args))
    function = ir.Function(module, numbered, kind.symbol)
    choose = ir.IRBuilder(function.append_basic_block())
    otherwise = function.append_basic_block()
    ir.IRBuilder(otherwise).ret(ir.IntType(32)(0))
    # The arguments begin with the places of the result and of an error.
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
    """Optimize a module for a machine."""
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)


def find_foreign(module: Any) -> list[str]:
    """Return the functions that a module calls and lacks, or that are not exact."""
    names = [function.name for function in module.functions if function.is_declaration]
    return [name for name in names if not name.startswith("llvm.") or _NOT_EXACT.match(name)]
