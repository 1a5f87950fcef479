"""The protocol of devices that run kernels, and this processor as a device."""

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
    """A device cannot be used; missions can run without it."""


class DeviceFull(DeviceError):
    """A device has too little memory for a batch of missions."""


class Memory(Protocol):
    """Memory on a device."""

    @property
    def address(self) -> int:
        """The start address on the device."""

    def write(self, content: Bytes) -> None:
        """Write ``content`` at the start address."""

    def read(self, start: int, end: int) -> Bytes:
        """Return the bytes from ``start`` up to, but not including, ``end``."""


class Device(Protocol):
    """A device that runs kernels; its methods raise DeviceError if it cannot be used."""

    @property
    def target(self) -> Target:
        """The target of the device's kernels."""

    def load(self, code: bytes) -> Any:
        """Load the code of a kernel, and return the kernel."""

    def allocate(self, size: int) -> AbstractContextManager[Memory]:
        """Allocate ``size`` bytes; raise DeviceFull if there is too little memory."""

    def launch(self, kernel: Any, rows: int, width: int, count: int) -> None:
        """Run the missions in ``count`` rows of ``width`` bytes at the address ``rows``."""


class HostMemory:
    """Memory of this process."""

    def __init__(self, size: int) -> None:
        self._bytes = np.empty(size, dtype=np.uint8)
        self.address: int = self._bytes.__array_interface__["data"][0]

    def write(self, content: Bytes) -> None:
        """Write ``content`` at the start address."""
        self._bytes[: len(content)] = content

    def read(self, start: int, end: int) -> Bytes:
        """Return the bytes from ``start`` up to, but not including, ``end``."""
        return self._bytes[start:end]


class Host:
    """This processor, which runs missions one after another."""

    def __init__(self) -> None:
        self.target = target_host()
        self._engines: list[Any] = []  # keeps the code loaded

    def load(self, code: bytes) -> Any:
        """Load the code of a kernel, and return the kernel."""
        machine = self.target.make_machine()
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        self._engines.append(engine)
        return CFUNCTYPE(None, *[c_int64] * 4)(engine.get_function_address(ENTRY))

    @contextmanager
    def allocate(self, size: int) -> Iterator[Memory]:
        """Allocate ``size`` bytes."""
        yield HostMemory(size)

    def launch(self, kernel: Any, rows: int, width: int, count: int) -> None:
        """Run the missions in ``count`` rows of ``width`` bytes at the address ``rows``."""
        kernel(rows, width, 0, count)
