"""Compiles functions with numba, and caches machine code on disk."""

import hashlib
import re
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
from numba.np import linalg

from evoros.base.compilable import take_waiting
from evoros.files.disk import sync, write_atomically
from evoros.files.private import cache_home, private_folder
from evoros.files.resources import PACKAGE
from evoros.terminal.activity import announce
from evoros.terminal.log import LOGGER

NJIT_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
"""Compiled code cannot raise errors, so a division by zero gives inf or NaN."""
SETTINGS: dict[str, Any] = {
    "LOOP_VECTORIZE": 0,  # loops are short, and kernels use the same code
    # Otherwise, environment variables of one process would change code that all processes load.
    **dict.fromkeys(("DISABLE_JIT", "BOUNDSCHECK"), 0),
}
BORROWING: dict[str, Any] = {"_nrt": False}  # references are counted only for arrays

LOCATOR = f"{__name__}.SharedLocator"
RULE_ROOMS = (
    *("base", "compilation", "controller", "drive", "failure", "field", "filter", "geometry"),
    *("mission", "sensor", "simulator", "walkers", "world"),
)
"""Packages of evoros with mission rules, or with code that compiles them."""
BUNDLED = "machine_code"  # folder in the package; missing in editable installations
_IMPORT = re.compile(
    rb"^[ \t]*(?:from (evoros[\w.]*) import (\([^)]*\)|.*)|import (evoros[\w.]*))", re.MULTILINE
)
_COMPILING = Lock()  # guards process-wide settings of numba


class SharedLocator(UserProvidedCacheLocator):  # type: ignore[misc]
    """Finds machine code by module name instead of by installation path."""

    def __init__(self, function: Any, file: str) -> None:
        super().__init__(function, file)
        self._folder = Path(numba.config.CACHE_DIR, *function.__module__.split(".")[:-1])

    def get_cache_path(self) -> str:
        """Return the folder for a package's functions; numba names files by module and line."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return a digest of all sources in the function's folder and of their imports."""
        return _hash_reachable((Path(self._py_file).parent,))


def compile_function(function: Any, signature: Any, on_disk: bool, **options: Any) -> Any:
    """Compile a function, or load its machine code from disk; call this within ``compiling()``."""
    for waiting, inlined in take_waiting(bundled=True):
        register(waiting, waiting, inlined)
    try:
        dispatcher = njit(signature, cache=on_disk, **NJIT_OPTIONS, **options)(function)
    except NumbaError:
        raise
    except Exception as error:
        if not on_disk:
            raise
        LOGGER.info(
            "the compiled code of %s is damaged (%r); recompiling the function", function, error
        )
        FunctionCache(function).flush()
        dispatcher = njit(signature, cache=True, **NJIT_OPTIONS, **options)(function)
    if on_disk and dispatcher.stats.cache_misses:
        for path in sorted(Path(FunctionCache(function).cache_path).iterdir()):
            with suppress(FileNotFoundError):  # another process may have removed the draft
                sync(path)
    return dispatcher


def register(function: Any, implementation: Any, inlined: bool) -> None:
    """Register a function that is called in compiled code."""
    # Functions compile 10 % faster without the C wrapper, which is never called.
    options = {"forceinline": inlined, "no_cfunc_wrapper": True}
    overload(function, strict=False, jit_options=options)(lambda *args, **keywords: implementation)


class Lowered(NamedTuple):
    """The LLVM code of a compiled function."""

    name: str
    module: Any  # LLVM module with the function and all functions it calls


def lower(dispatcher: Any, signature: Any) -> Lowered:
    """Return the LLVM code of a compiled function."""
    result = dispatcher.get_compile_result(signature)
    # numba has no public method for the module of a cached function
    return Lowered(result.fndesc.llvm_func_name, result.library._get_module_for_linking())


@contextmanager
def compiling() -> Iterator[bool]:
    """Make numba use evoros's cache folder; yield True if there is one."""
    folder = cache_folder()
    with announce("compiling"), _COMPILING, warnings.catch_warnings():
        _import_array_functions()
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
        places = {"CACHE_DIR": str(folder), "CACHE_LOCATOR_CLASSES": LOCATOR} if folder else {}
        settings = SETTINGS | places
        before = {name: getattr(numba.config, name) for name in settings}
        vars(numba.config).update(settings)
        try:
            yield folder is not None
        finally:
            vars(numba.config).update(before)


@cache
def _import_array_functions() -> None:
    """Import numba's array functions without the slow check for SciPy's linear algebra."""
    check, linalg.ensure_blas = linalg.ensure_blas, lambda: None
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        linalg.ensure_blas = check


@cache
def cache_folder() -> Path | None:
    """Return the folder for machine code, named by a digest of the sources; None if unwritable."""
    # numba checks only the file of a function, not the files of functions it calls.
    sources = _hash_reachable(tuple(PACKAGE / room for room in RULE_ROOMS))
    digest = hashlib.sha256(numba.__version__.encode() + sources.encode())
    folder = private_folder(digest.hexdigest()[:16])
    if folder is None:
        LOGGER.warning(
            "compiled rules cannot be cached, because neither %s nor the temporary folder has a "
            "folder that only this user can write to; every process compiles the rules again",
            cache_home(),
        )
    else:
        _copy_bundled(folder)
    return folder


def _copy_bundled(folder: Path) -> None:
    """Copy machine code made during installation, unless the sources have changed."""
    bundled = PACKAGE / BUNDLED / folder.name
    for file in sorted(bundled.rglob("*.nb?")):  # the index (.nbi) is copied after its code (.nbc)
        copy = folder / file.relative_to(bundled)
        if not copy.exists():
            copy.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(copy, file.read_bytes())


@cache
def _hash_reachable(folders: tuple[Path, ...]) -> str:
    modules = _list_modules()
    found = {file: file.name for folder in folders for file in folder.rglob("*.py")}
    waiting, texts = list(found), []
    while waiting:
        file = waiting.pop()
        text = file.read_bytes()
        texts.append((found[file], text))
        for name in _list_imported(text) & modules.keys():
            if modules[name] not in found:
                found[modules[name]] = name
                waiting.append(modules[name])
    digest = hashlib.sha256()
    for name, text in sorted(texts):
        digest.update(f"{name}:{len(text)}:".encode() + text)
    return digest.hexdigest()


def _list_imported(text: bytes) -> set[str]:
    names: set[str] = set()
    for source, imported, module in _IMPORT.findall(text):
        package = (source or module).decode()
        names |= {f"{package}.{name}" for name in re.findall(r"\w+", imported.decode())}
        while "." in package:  # Python imports the parent packages as well
            names.add(package)
            package = package.rpartition(".")[0]
    return names


@cache
def _list_modules() -> dict[str, Path]:
    start = len(str(PACKAGE.parent)) + 1
    names = {str(path)[start:-3].replace("/", "."): path for path in PACKAGE.rglob("*.py")}
    return {name.removesuffix(".__init__"): path for name, path in names.items()}
