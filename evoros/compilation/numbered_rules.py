"""Rules as numbers, which a kernel calls by functions of its own and not by addresses.

Code for a GPU has no addresses of functions of this process. A kernel has, for each kind of rules,
one function that calls the rule with a number (``kernel.py``).
"""

from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import types
from numba.core.cgutils import create_struct_proxy, get_or_insert_function
from numba.core.datamodel.models import PrimitiveModel
from numba.core.typing.templates import Signature
from numba.extending import lower_builtin, register_model

from evoros.compilation.draws import RNG
from evoros.compilation.records import WORD
from evoros.compilation.rules import ADVANCE, FILTER, LAYER, OBSERVE, SENSE

DRAWS = {"next_uint64": WORD, "next_uint32": ir.IntType(32), "next_double": ir.DoubleType()}
"""The results of the functions by which a kernel draws; ``kernel_runtime.py`` has them."""
_BITS = types.NumPyRandomBitGeneratorType("bit_generator")


class NumberedRule(types.Callable):  # type: ignore[misc]
    """The type of the number of a rule of one kind, which compiled code calls as a function."""

    def __init__(self, kind: str, signature: Signature) -> None:
        self.symbol, self.signature = f"evoros.{kind}", signature
        super().__init__(f"NumberedRule({kind})")

    def get_call_type(self, context: Any, arguments: Any, keywords: Any) -> Signature:
        """Return the signature, by which numba gives the number to the call."""
        return Signature(self.signature.return_type, self.signature.args, recvr=self)

    def get_call_signatures(self) -> tuple[list[Signature], bool]:
        """Return the one signature."""
        return [self.signature], False

    def get_impl_key(self, signature: Signature) -> Any:
        """Return the key of the code below."""
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
"""By the names of the kinds."""

for _name in (*RULES, *DRAWS):
    # numba resolves all names of what it compiles, though nobody calls its machine code.
    llvm.add_symbol(f"evoros.{_name}", 1)


@lower_builtin(NumberedRule, NumberedRule, types.VarArg(types.Any))  # type: ignore[untyped-decorator]
def _call(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Call the function of the kind. Errors of rules are lost, as in all compiled missions."""
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
    """Generate code that makes a generator which draws by the kernel's functions from a state."""
    rng = create_struct_proxy(RNG)(context, builder)
    bits = create_struct_proxy(_BITS)(context, builder)
    bits.state = state
    for name, result in DRAWS.items():
        kind = ir.FunctionType(result, [WORD])
        function = get_or_insert_function(builder.module, kind, f"evoros.{name}")
        setattr(bits, f"fnptr_{name}", builder.ptrtoint(function, WORD))
    rng.bit_generator = bits._getvalue()
    return rng._getvalue()
