"""An NVIDIA GPU as a device, through the driver and the package cuda-bindings."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from ctypes import c_int64
from typing import Any

import numpy as np

from evoros.base.errors import require_extra, single_line
from evoros.compilation.device import Bytes, DeviceError, DeviceFull, Memory
from evoros.compilation.kernel import ENTRY, target_gpu

THREADS = 32  # missions per block, one per thread; small blocks spread few missions over the GPU
_FULL = "CUDA_ERROR_OUT_OF_MEMORY"
FIXES = {
    _FULL: "free some of the GPU's memory, or reduce executor.workers",
    "CUDA_ERROR_UNSUPPORTED_PTX_VERSION": "the driver is too old; install a newer driver",
    "CUDA_ERROR_SYSTEM_DRIVER_MISMATCH": "restart the machine after a driver update",
}
"""Advice on some errors of the driver."""


def import_driver() -> Any:
    """Import the module that calls the driver."""
    with require_extra("gpu", "executor=gpu"):
        from cuda.bindings import driver
    return driver


def require_gpu(driver: Any) -> None:
    """Raise a DeviceError unless the driver finds a GPU."""
    call_driver(driver, "cuInit", 0)
    if call_driver(driver, "cuDeviceGetCount") == 0:
        raise DeviceError("no GPU was found")


def call_driver(driver: Any, name: str, *arguments: Any) -> Any:
    """Call a driver function and return its result; raise every error as a DeviceError."""
    try:
        status, *results = getattr(driver, name)(*arguments)
    except Exception as error:  # a missing or old driver raises different exceptions
        raise DeviceError(f"{name}: {single_line(error).rstrip('.')}") from error
    if int(status) != 0:
        code = getattr(status, "name", str(status))
        failure = DeviceFull if code == _FULL else DeviceError
        fix = f" ({FIXES[code]})" if code in FIXES else ""
        raise failure(f"{name} of the driver reports {code}{fix}")
    return results[0] if results else None


class CudaMemory:
    """Allocated GPU memory."""

    def __init__(self, cuda: "Cuda", address: int) -> None:
        self._cuda, self.address = cuda, address

    def write(self, content: Bytes) -> None:
        """Write to the start of the memory."""
        self._cuda.call("cuMemcpyHtoD", self.address, content.ctypes.data, content.nbytes)

    def read(self, start: int, end: int) -> Bytes:
        """Return the bytes from ``start`` up to, but not including, ``end``."""
        content = np.empty(end - start, dtype=np.uint8)
        self._cuda.call("cuMemcpyDtoH", content.ctypes.data, self.address + start, content.nbytes)
        return content


class Cuda:
    """The first GPU visible to this process."""

    def __init__(self, driver: Any) -> None:
        require_gpu(driver)
        self.target, self._driver = target_gpu(), driver
        device = self.call("cuDeviceGet", 0)
        self.call("cuCtxSetCurrent", self.call("cuDevicePrimaryCtxRetain", device))

    def call(self, name: str, *arguments: Any) -> Any:
        """Call a driver function; see ``call_driver``."""
        return call_driver(self._driver, name, *arguments)

    def load(self, code: bytes) -> Any:
        """Load the code of a kernel."""
        module = self.call("cuModuleLoadData", code + b"\0")
        return self.call("cuModuleGetFunction", module, ENTRY.encode())

    @contextmanager
    def allocate(self, size: int) -> Iterator[Memory]:
        """Allocate ``size`` bytes; free them on exit."""
        address = self.call("cuMemAlloc", size)
        try:
            yield CudaMemory(self, int(address))
        finally:
            with suppress(DeviceError):  # an error of the GPU has been reported already
                self.call("cuMemFree", address)

    def launch(self, kernel: Any, rows: int, width: int, count: int) -> None:
        """Run ``count`` missions to the end; ``rows`` points to rows of ``width`` bytes."""
        values = (rows, width, 0, count), (c_int64,) * 4
        blocks = -(-count // THREADS)
        self.call("cuLaunchKernel", kernel, blocks, 1, 1, THREADS, 1, 1, 0, 0, values, 0)
        self.call("cuCtxSynchronize")
