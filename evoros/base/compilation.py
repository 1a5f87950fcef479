"""Rules compiled with numba: the signature of each kind, and the folder where they are kept."""

import hashlib
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dis import get_instructions
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

from evoros.base.log import LOGGER
from evoros.base.resources import PACKAGE

Function = TypeVar("Function", bound=Callable[..., Any])

# How the arguments of rules are typed.
F8, I8 = types.float64, types.int64
A1, A2 = types.Array(F8, 1, "C"), types.Array(F8, 2, "C")
RNG = numba.typeof(np.random.default_rng(0))

# The kinds of rules, as evoros.base.arrays has them.
FILTER = types.void(A1, A1, RNG, A1, F8)
LAYER = types.boolean(A1, A1, A1, A1, A1, F8, A1)
OBSERVE = SENSE = types.void(A1, A1, A1)
ADVANCE = types.void(A1, A1, A1, F8)
SIMULATION_RULES = (OBSERVE, SENSE, ADVANCE)

# An error would be lost on its way through compiled code: a division by zero gives inf or NaN.
HOW: dict[str, Any] = {"nogil": True, "error_model": "numpy"}

_COMPILING = Lock()  # around settings of numba's that hold for the whole process


class CompiledRule(types.WrapperAddressProtocol):  # type: ignore[misc]
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


def compile_rule(rule: Any, kind: Any) -> CompiledRule:
    """The rule compiled, once in a process.

    Raises:
        NotCompilable: numba cannot compile it. Only plain functions are: a method belongs to a
            live object, which numba does not know.
    """
    answer = try_compile(rule, kind)
    if isinstance(answer, NotCompilable):
        raise answer
    return answer


def try_compile(rule: Any, kind: Any) -> CompiledRule | NotCompilable:
    """As ``compile_rule``, but returns why not."""
    # Not remembered: the methods and inner functions of a live engine are others at each mission,
    # and each of them would be compiled anew and kept for ever.
    if not isfunction(rule):
        return NotCompilable("it is not a plain function")
    if rule.__closure__ or "<locals>" in rule.__qualname__:
        return NotCompilable("it is defined inside a function, not at the top of a module")
    # Errors do not pass from compiled code to its caller: the mission would go on without the rule.
    if any(instruction.opname == "RAISE_VARARGS" for instruction in get_instructions(rule)):
        return NotCompilable("it raises errors, which compiled code ignores")
    return _compile(rule, kind)


@cache
def _compile(rule: Any, kind: Any) -> CompiledRule | NotCompilable:
    # What a user's rule calls may change without our noticing: it is compiled in every process.
    ours = rule.__module__.partition(".")[0] == "evoros"
    try:
        with compiling() as kept:
            return CompiledRule(njit(kind, cache=ours and kept, **HOW)(rule), kind)
    except Exception as error:  # numba raises all kinds
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        telling = [line for line in lines if not line.startswith(("Failed in", "During:", "File"))]
        return NotCompilable((telling or lines or ["numba cannot compile it"])[0])


@contextmanager
def compiling() -> Iterator[bool]:
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
    digest = hashlib.sha256(numba.__version__.encode())
    for file in sorted(PACKAGE.rglob("*.py")):
        digest.update(file.read_bytes())
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    for base in (Path(home) / "evoros", Path(tempfile.gettempdir()) / f"evoros-{os.getuid()}"):
        folder = base / digest.hexdigest()[:16]
        with suppress(OSError):
            base.parent.mkdir(parents=True, exist_ok=True)
            for each in (base, folder):  # not by `parents`, which would let the umask decide
                each.mkdir(exist_ok=True, mode=0o700)
            if os.access(folder, os.W_OK) and _ours_alone(base) and _ours_alone(folder):
                return folder
    LOGGER.warning(
        "no folder that nobody else can write to (%s): rules are compiled in every process", home
    )
    return None


def _ours_alone(folder: Path) -> bool:
    """Compiled code that somebody else can put there must not be run."""
    status = folder.stat()
    return status.st_uid == os.getuid() and not status.st_mode & 0o022
