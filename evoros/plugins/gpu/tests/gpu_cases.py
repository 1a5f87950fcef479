"""A stand-in for NVIDIA's driver, which runs kernels that are compiled for this processor."""

from ctypes import memmove
from enum import IntEnum
from typing import Any

import numpy as np

from evoros.compilation.device import Host
from evoros.compilation.kernel import target_host
from evoros.plugins.gpu.cuda import Cuda


class Result(IntEnum):
    """Some of the codes of the driver."""

    CUDA_SUCCESS = 0
    CUDA_ERROR_OUT_OF_MEMORY = 2
    CUDA_ERROR_NO_DEVICE = 100
    CUDA_ERROR_UNSUPPORTED_PTX_VERSION = 222
    CUDA_ERROR_ILLEGAL_ADDRESS = 700


class StandInDriver:
    """The functions of ``cuda.bindings.driver`` that evoros calls.

    ``errors`` has the result of a function by name, if it fails, and ``memory_size`` the bytes that
    can be taken at a time.
    """

    def __init__(self, gpus: int = 1, memory_size: int = 1 << 40) -> None:
        self.gpus, self.memory_size = gpus, memory_size
        self.errors: dict[str, Result] = {}
        self.taken: dict[int, Any] = {}  # memory by address
        self.launches: list[int] = []  # missions of each
        self._host = Host()

    def __getattribute__(self, name: str) -> Any:
        if name.startswith("cu") and (error := self.errors.get(name)):
            return lambda *arguments: (error,)
        return super().__getattribute__(name)

    def cuInit(self, flags: int) -> tuple[Any, ...]:  # noqa: N802
        return (Result.CUDA_SUCCESS,)

    def cuDeviceGetCount(self) -> tuple[Any, ...]:  # noqa: N802
        return Result.CUDA_SUCCESS, self.gpus

    def cuDeviceGet(self, number: int) -> tuple[Any, ...]:  # noqa: N802
        return Result.CUDA_SUCCESS, number

    def cuDevicePrimaryCtxRetain(self, device: int) -> tuple[Any, ...]:  # noqa: N802
        return Result.CUDA_SUCCESS, "context"

    def cuCtxSetCurrent(self, context: str) -> tuple[Any, ...]:  # noqa: N802
        return (Result.CUDA_SUCCESS,)

    def cuModuleLoadData(self, image: bytes) -> tuple[Any, ...]:  # noqa: N802
        assert image.endswith(b"\0")  # text ends so
        return Result.CUDA_SUCCESS, self._host.load(image[:-1])

    def cuModuleGetFunction(self, module: Any, name: bytes) -> tuple[Any, ...]:  # noqa: N802
        assert name == b"evoros_fly"
        return Result.CUDA_SUCCESS, module

    def cuMemAlloc(self, size: int) -> tuple[Any, ...]:  # noqa: N802
        if size > self.memory_size:
            return (Result.CUDA_ERROR_OUT_OF_MEMORY,)
        content = np.full(size, 0xAA, dtype=np.uint8)
        self.taken[content.ctypes.data] = content
        return Result.CUDA_SUCCESS, content.ctypes.data

    def cuMemFree(self, address: int) -> tuple[Any, ...]:  # noqa: N802
        del self.taken[address]
        return (Result.CUDA_SUCCESS,)

    def cuMemcpyHtoD(self, device: int, host: int, size: int) -> tuple[Any, ...]:  # noqa: N802
        self._copy(device, host, size)
        return (Result.CUDA_SUCCESS,)

    def cuMemcpyDtoH(self, host: int, device: int, size: int) -> tuple[Any, ...]:  # noqa: N802
        self._copy(host, device, size)
        return (Result.CUDA_SUCCESS,)

    def cuLaunchKernel(self, kernel: Any, *settings: Any) -> tuple[Any, ...]:  # noqa: N802
        blocks, threads, (values, _) = settings[0], settings[3], settings[8]
        rows, width, first, end = values
        assert (blocks - 1) * threads < end <= blocks * threads
        self.launches.append(end)
        kernel(rows, width, first, end)
        return (Result.CUDA_SUCCESS,)

    def cuCtxSynchronize(self) -> tuple[Any, ...]:  # noqa: N802
        return (Result.CUDA_SUCCESS,)

    def _copy(self, target: int, source: int, size: int) -> None:
        memmove(target, source, size)


def open_stand_in(driver: StandInDriver) -> Cuda:
    """Return a GPU with a driver that runs code of this processor."""
    cuda = Cuda(driver)
    cuda.target = target_host()
    return cuda
