"""Compile functions with numba, and keep their machine code on the disk."""

import hashlib
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

import numba
from numba import njit
from numba.core.caching import FunctionCache, UserProvidedCacheLocator
from numba.core.errors import NumbaError, NumbaExperimentalFeatureWarning
from numba.extending import overload

from evoros.base.compilable import take_waiting
from evoros.files.disk import sync
from evoros.files.private import cache_home, private_folder
from evoros.files.resources import PACKAGE
from evoros.terminal.activity import announce
from evoros.terminal.log import LOGGER

NJIT_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
"""Compiled code loses errors, so a division by zero gives inf or NaN."""
BORROWING: dict[str, Any] = {"_nrt": False}
"""Options of code that makes no arrays, so that numba need not count references to them."""

LOCATOR = f"{__name__}.SharedLocator"
_COMPILING = Lock()  # around settings of numba that apply to the whole process


class SharedLocator(UserProvidedCacheLocator):  # type: ignore[misc]
    """Finds machine code by the name of a module, not by the path of the installation.

    So all environments with the same sources share what is compiled.
    """

    def __init__(self, function: Any, file: str) -> None:
        super().__init__(function, file)
        self._folder = Path(numba.config.CACHE_DIR, *function.__module__.split(".")[:-1])

    def get_cache_path(self) -> str:
        """Return the folder for the functions of a module; numba names files by module and line."""
        return str(self._folder)


def compile_function(function: Any, signature: Any, on_disk: bool, **options: Any) -> Any:
    """Compile a function, or load its machine code from the disk; for use within ``compiling``.

    Code that cannot be loaded, for example after a loss of power, is discarded and compiled anew.
    """
    for waiting, inlined in take_waiting(bundled=True):
        register(waiting, waiting, inlined)
    try:
        dispatcher = njit(signature, cache=on_disk, **NJIT_OPTIONS, **options)(function)
    except NumbaError:
        raise
    except Exception as error:
        if not on_disk:
            raise
        LOGGER.info("compiled code of %s is damaged (%r) and is made anew", function, error)
        FunctionCache(function).flush()
        dispatcher = njit(signature, cache=True, **NJIT_OPTIONS, **options)(function)
    if on_disk and dispatcher.stats.cache_misses:
        for path in sorted(Path(FunctionCache(function).cache_path).iterdir()):
            with suppress(FileNotFoundError):  # a draft of another process
                sync(path)
    return dispatcher


def register(function: Any, implementation: Any, inlined: bool) -> None:
    """Tell numba of a function that compiled code calls."""
    # Without the wrapper for C, which nobody calls, functions compile a tenth faster.
    options = {"forceinline": inlined, "no_cfunc_wrapper": True}
    overload(function, strict=False, jit_options=options)(lambda *args, **keywords: implementation)


class Lowered(NamedTuple):
    """The code of a compiled function, in LLVM's language."""

    name: str
    module: Any  # of LLVM, with all functions that it calls


def lower(dispatcher: Any, signature: Any) -> Lowered:
    """Return the code of a compiled function."""
    result = dispatcher.get_compile_result(signature)
    # numba links the code of functions by this, and does not show that of cached ones otherwise.
    return Lowered(result.fndesc.llvm_func_name, result.library._get_module_for_linking())


@contextmanager
def compiling() -> Iterator[bool]:
    """Make numba cache in the folder of evoros; yields whether there is such a folder.

    Loops are not vectorized: they are short, and kernels are made of the same code. Also silences
    the warning that functions as arguments are an experimental feature of numba.
    """
    folder = cache_folder()
    with announce("compiling"), _COMPILING, warnings.catch_warnings():
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
        config = numba.config
        before = config.CACHE_DIR, config.CACHE_LOCATOR_CLASSES, config.LOOP_VECTORIZE
        config.LOOP_VECTORIZE = 0
        if folder is not None:
            config.CACHE_DIR, config.CACHE_LOCATOR_CLASSES = str(folder), LOCATOR
        try:
            yield folder is not None
        finally:
            config.CACHE_DIR, config.CACHE_LOCATOR_CLASSES, config.LOOP_VECTORIZE = before


@cache
def cache_folder() -> Path | None:
    """Return the folder for machine code; None if no safe folder can be written.

    Its name is a hash of all sources of evoros, because numba only checks the file of a function
    and not the files of the functions that it calls.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    # In a clone, analysis is a link.
    folders = os.walk(PACKAGE, followlinks=True)
    files = [Path(folder, name) for folder, _, names in folders for name in names]
    for file in sorted(file for file in files if file.suffix == ".py"):
        content = file.read_bytes()
        digest.update(f"{file.relative_to(PACKAGE)}:{len(content)}:".encode() + content)
    folder = private_folder(digest.hexdigest()[:16])
    if folder is None:
        LOGGER.warning(
            "no cache for compiled rules: neither %s nor the folder for temporary files has a "
            "place that only this user can write to; rules are compiled in every process",
            cache_home(),
        )
    return folder
