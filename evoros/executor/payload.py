"""Serialized calls and answers, which send shared contents to each process once."""

import hashlib
import pickle
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, NamedTuple

from evoros.base.errors import InputError

KEPT = 16
"""Maximum number of shared contents in a process; the longest unused one is dropped first."""

MISSING, RETURNED, RAISED, PILOT_LOST = range(4)
"""Kinds of answers; after ``MISSING``, the call is repeated with its shared contents."""


@dataclass(frozen=True)
class Shared:
    """Bytes that are an argument of many calls.

    As a direct argument, it is sent as a digest; the content goes only to a process that lacks it.
    """

    digest: bytes  # SHA-256, so that comparisons need 32 bytes and not megabytes
    content: bytes = field(compare=False, repr=False)

    @classmethod
    def of(cls, content: bytes) -> "Shared":
        """Share the content."""
        return cls(hashlib.sha256(content).digest(), content)


@dataclass(frozen=True)
class Call:
    """A pickled call, and the shared arguments that it names by digest."""

    name: str
    payload: bytes = field(repr=False)
    shared: tuple[Shared, ...] = ()


class Answer(NamedTuple):
    """A process's answer, with the pickled result or exception unless ``MISSING``."""

    kind: int
    content: bytes = b""


class MissingError(Exception):
    """The process lacks a shared content of the call."""


class Kept:
    """The shared contents of a process."""

    def __init__(self) -> None:
        self._kept: OrderedDict[bytes, Shared] = OrderedDict()
        self._lock = Lock()

    def add(self, contents: Sequence[Shared]) -> None:
        """Keep contents."""
        with self._lock:
            for shared in contents:
                self._kept[shared.digest] = shared
                self._kept.move_to_end(shared.digest)
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)

    def get(self, digest: bytes) -> Shared:
        """Return a content; raise a MissingError if it is not kept."""
        with self._lock:
            if digest not in self._kept:
                raise MissingError
            self._kept.move_to_end(digest)
            return self._kept[digest]


@dataclass(frozen=True)
class _Reference:
    """Stands for a shared argument in a pickled call."""

    digest: bytes


def pack_call(function: Callable[..., Any], args: Sequence[Any]) -> Call:
    """Pickle a call; raise an InputError if the function or an argument does not pickle."""
    name = getattr(function, "__qualname__", None) or repr(function)
    shared = tuple(arg for arg in args if isinstance(arg, Shared))
    sent = tuple(_Reference(arg.digest) if isinstance(arg, Shared) else arg for arg in args)
    try:
        return Call(name, pickle.dumps((function, sent)), shared)
    except Exception as error:  # whatever a user's __reduce__ raises
        raise InputError(
            f"{name}: cannot be sent to a worker process ({error}); define functions and "
            f"classes at the top of a module that can be imported, or use executor=serial"
        ) from error


def unpack_call(payload: bytes, kept: Kept) -> tuple[Callable[..., Any], tuple[Any, ...]]:
    """Unpickle a call; raise a MissingError if ``kept`` lacks a shared content."""
    function, sent = pickle.loads(payload)
    args = (kept.get(arg.digest) if isinstance(arg, _Reference) else arg for arg in sent)
    return function, tuple(args)
