"""The protocol of devices, which run kernels, and the device that is this processor."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from ctypes import CFUNCTYPE, c_int64
from typing import Any, Protocol

import llvmlite.binding as llvm
import numpy as np
from numpy.typing import NDArray

from evoros.base.errors import EvorosError
from evoros.compilation.kernel import ENTRY, Target, target_host

Bytes = NDArray[np.uint8]


class DeviceError(EvorosError):
    """A device cannot be used, in one line; missions can run without it."""


class DeviceFull(DeviceError):
    """A device has too little memory for so many missions."""


class Memory(Protocol):
    """Memory of a device."""

    @property
    def address(self) -> int:
        """Where it begins, for the device."""
        ...

    def write(self, content: Bytes) -> None:
        """Fill it from its beginning."""
        ...

    def read(self, start: int, end: int) -> Bytes:
        """Return the bytes from ``start`` to before ``end``."""
        ...


class Device(Protocol):
    """Runs kernels. Each method raises DeviceError if the device cannot be used."""

    @property
    def target(self) -> Target:
        """For which kernels are made."""
        ...

    def load(self, code: bytes) -> Any:
        """Load the code of a kernel."""
        ...

    def allocate(self, size: int) -> AbstractContextManager[Memory]:
        """Take memory of so many bytes; raise DeviceFull if there is not so much."""
        ...

    def launch(self, kernel: Any, rows: int, width: int, count: int) -> None:
        """Run the missions of rows at an address, each of ``width`` bytes, to their ends."""
        ...


class HostMemory:
    """Memory of this process."""

    def __init__(self, size: int) -> None:
        self._bytes = np.empty(size, dtype=np.uint8)
        self.address: int = self._bytes.__array_interface__["data"][0]

    def write(self, content: Bytes) -> None:
        """Fill it from its beginning."""
        self._bytes[: len(content)] = content

    def read(self, start: int, end: int) -> Bytes:
        """Return the bytes from ``start`` to before ``end``."""
        return self._bytes[start:end]


class Host:
    """This processor, which runs the missions one after another."""

    def __init__(self) -> None:
        self.target = target_host()
        self._engines: list[Any] = []  # keep the code

    def load(self, code: bytes) -> Any:
        """Load the code of a kernel."""
        machine = self.target.make_machine()
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        self._engines.append(engine)
        return CFUNCTYPE(None, *[c_int64] * 4)(engine.get_function_address(ENTRY))

    @contextmanager
    def allocate(self, size: int) -> Iterator[Memory]:
        """Take memory of so many bytes."""
        yield HostMemory(size)

    def launch(self, kernel: Any, rows: int, width: int, count: int) -> None:
        """Run the missions of rows at an address, each of ``width`` bytes, to their ends."""
        kernel(rows, width, 0, count)
