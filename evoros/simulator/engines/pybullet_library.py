"""The library of PyBullet, which prints as it is imported."""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, partial
from inspect import isroutine
from typing import Any

from evoros.base.errors import InputError


@cache
def import_pybullet() -> Any:
    """Import the pybullet module, without the line that it prints then.

    Raises:
        InputError: PyBullet is not installed.
    """
    try:
        with quiet():
            import pybullet
    except ImportError as error:
        raise not_installed() from error
    return pybullet


class Client:
    """A connection to PyBullet, with the functions of the library for it."""

    def __init__(self, library: Any) -> None:
        self._library, self._id = library, library.connect(library.DIRECT)

    def __getattr__(self, name: str) -> Any:
        attribute = getattr(self._library, name)
        if isroutine(attribute):
            attribute = partial(attribute, physicsClientId=self._id)
        setattr(self, name, attribute)  # looked up once
        return attribute


def not_installed() -> InputError:
    """Return the error of a Python without PyBullet."""
    return InputError(
        "simulator=pybullet: PyBullet is not installed, and it publishes wheels only up to Python "
        "3.11; use simulator=physics, install evoros with Python 3.11, or build PyBullet with `pip "
        "install pybullet` and a C++ compiler"
    )


@contextmanager
def quiet() -> Iterator[None]:
    """Keep all output from the terminal, including the output of C code."""
    libc = ctypes.CDLL(None)
    libc.fflush(None)
    saved = [(os.dup(descriptor), descriptor) for descriptor in (1, 2)]
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        for _, descriptor in saved:
            os.dup2(null, descriptor)
        yield
    finally:
        libc.fflush(None)
        for copy, descriptor in saved:
            os.dup2(copy, descriptor)
            os.close(copy)
        os.close(null)
