"""Compile rules with numba: the signature of each kind, and the cache of machine code."""

import hashlib
import os
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dis import get_instructions
from functools import cache
from inspect import isfunction
from pathlib import Path
from threading import Lock
from typing import Any

import numba
from llvmlite import ir
from numba import njit, types
from numba.core.caching import FunctionCache
from numba.core.errors import NumbaError, NumbaExperimentalFeatureWarning
from numba.extending import intrinsic, overload

from evoros.base.activity import announce
from evoros.base.compilable import take_waiting
from evoros.base.compiled_draws import RNG
from evoros.base.disk import sync
from evoros.base.log import LOGGER
from evoros.base.resources import PACKAGE
from evoros.base.substitution import substitute

# Types of arguments: float, integer, arrays of one and two dimensions, random generator.
F8, I8 = types.float64, types.int64
A1, A2 = types.Array(F8, 1, "C"), types.Array(F8, 2, "C")
# Types of results.
NOTHING, TRUTH = types.void, types.boolean

# Signatures of the kinds of rules, as the protocols of filters, controllers and simulators have
# them.
FILTER = types.void(A1, A1, RNG, A1, F8)
LAYER = types.boolean(A1, A1, A1, A1, A1, F8, A1)
OBSERVE = SENSE = types.void(A1, A1, A1)
ADVANCE = types.void(A1, A1, A1, F8)
SIMULATION_RULES = (OBSERVE, SENSE, ADVANCE)

NJIT_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
"""Compiled code loses errors, so a division by zero gives inf or NaN."""

_COMPILING = Lock()  # around settings of numba that apply to the whole process


class CompiledRule(types.WrapperAddressProtocol):  # type: ignore[misc]
    """A compiled rule that Python calls as a function and compiled code calls by its address.

    numba would look up the address at every mission; this class looks it up once.
    """

    def __init__(self, dispatcher: Any, signature: Any) -> None:
        self._signature = signature
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
    if not isfunction(rule):
        return NotCompilable("it is not a plain function")
    if rule.__closure__ or "<locals>" in rule.__qualname__:
        return NotCompilable("it is defined inside a function, not at the top of a module")
    return _compile(rule, signature)


@cache
def _compile(rule: Any, signature: Any) -> CompiledRule | NotCompilable:
    # Errors do not pass from compiled code to its caller: the mission would go on without the rule.
    if any(instruction.opname == "RAISE_VARARGS" for instruction in get_instructions(rule)):
        return NotCompilable("it raises errors, which compiled code ignores")
    # What a user's rule calls may change unnoticed, so every process compiles such rules itself.
    bundled = rule.__module__.partition(".")[0] == "evoros"
    try:
        with compiling() as on_disk:
            dispatcher = compile_function(rule, signature, bundled and on_disk)
            return CompiledRule(dispatcher, signature)
    except Exception as error:  # numba raises errors of many types
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        reasons = [line for line in lines if not line.startswith(("Failed in", "During:", "File"))]
        return NotCompilable((reasons or lines or ["numba cannot compile it"])[0])


def compile_function(function: Any, signature: Any, on_disk: bool) -> Any:
    """Compile a function, or load its machine code from the disk; for use within ``compiling``.

    What cannot be loaded, for example after a loss of power, is discarded and compiled anew.
    """
    for waiting, inlined in take_waiting():
        _register(waiting, inlined)
    function = substitute(function)
    try:
        dispatcher = njit(signature, cache=on_disk, **NJIT_OPTIONS)(function)
    except NumbaError:
        raise
    except Exception as error:
        if not on_disk:
            raise
        LOGGER.info("compiled code of %s is damaged (%r) and is made anew", function, error)
        FunctionCache(function).flush()
        dispatcher = njit(signature, cache=True, **NJIT_OPTIONS)(function)
    if on_disk and dispatcher.stats.cache_misses:
        for path in sorted(Path(FunctionCache(function).cache_path).iterdir()):
            with suppress(FileNotFoundError):  # a draft of another process
                sync(path)
    return dispatcher


def _register(function: Any, inlined: bool) -> None:
    """Tell numba of a function that rules call."""
    own = substitute(function)
    options = {"forceinline": inlined}
    overload(function, strict=False, jit_options=options)(lambda *args, **keywords: own)


@contextmanager
def compiling() -> Iterator[bool]:
    """Make numba cache in the folder of evoros; yields whether there is such a folder.

    Also silences the warning that functions as arguments are an experimental feature of numba.
    """
    folder = _cache_folder()
    with announce("compiling"), _COMPILING, warnings.catch_warnings():
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(folder or before)
        try:
            yield folder is not None
        finally:
            numba.config.CACHE_DIR = before


@cache
def _cache_folder() -> Path | None:
    """The folder for machine code; None if no safe folder can be written.

    Its name is a hash of all sources of evoros, because numba only checks the file of a function
    and not those of the functions that it calls.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for file in sorted(PACKAGE.rglob("*.py")):
        content = file.read_bytes()
        digest.update(f"{file.relative_to(PACKAGE)}:{len(content)}:".encode() + content)
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    for base in (Path(home) / "evoros", Path(tempfile.gettempdir()) / f"evoros-{os.getuid()}"):
        folder = base / digest.hexdigest()[:16]
        with suppress(OSError):
            base.parent.mkdir(parents=True, exist_ok=True)
            for path in (base, folder):  # mkdir(parents=True) would leave the mode to the umask
                path.mkdir(exist_ok=True, mode=0o700)
            if os.access(folder, os.W_OK) and _is_private(base) and _is_private(folder):
                return folder
    LOGGER.warning(
        "no cache for compiled rules: neither %s nor the folder for temporary files has a place "
        "that only this user can write to; rules are compiled in every process",
        home,
    )
    return None


def _is_private(folder: Path) -> bool:
    """Whether only this user can write to the folder; machine code of others must not be run."""
    status = folder.stat()
    return status.st_uid == os.getuid() and not status.st_mode & 0o022
