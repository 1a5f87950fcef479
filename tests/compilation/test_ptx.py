"""Code for GPUs has the arithmetic of this processor: nothing fused, approximate or borrowed."""

import subprocess
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest
from mission_cases import COMBINATIONS, experiment_of, missions
from needs import find_ptxas

from evoros.compilation.device import DeviceError, Memory
from evoros.compilation.kernel import ENTRY, find_inexact, target_gpu
from evoros.mission.batch import Batcher


class Recorder:
    """A device that keeps the code of the kernel and launches nothing."""

    def __init__(self) -> None:
        self.target, self.code = target_gpu(), b""

    def load(self, code: bytes) -> Any:
        self.code = code

    def allocate(self, size: int) -> AbstractContextManager[Memory]:
        raise DeviceError("only records")

    def launch(self, kernel: Any, rows: int, width: int, count: int) -> None:
        raise AssertionError


def ptx_of(*chosen: list[str]) -> str:
    """The code of a kernel for missions of experiments."""
    recorder, experiments = Recorder(), [experiment_of(*overrides) for overrides in chosen]
    with pytest.raises(DeviceError):
        Batcher(recorder).run([(one.scenario, missions(one, 1)) for one in experiments])
    return recorder.code.decode()


@pytest.fixture(scope="module")
def ptx() -> str:
    return ptx_of(COMBINATIONS[1])


@pytest.mark.parametrize(
    "line",
    [
        "fma.rn.f64 %fd1, %fd2, %fd3, %fd4;",
        "mad.rn.f64 %fd1, %fd2, %fd3, %fd4;",
        "add.f64 %fd1, %fd2, %fd3;",  # the assembler may fuse it
        "mul.rz.f64 %fd1, %fd2, %fd3;",
        "div.full.f32 %f1, %f2, %f3;",
        "sqrt.approx.f64 %fd1, %fd2;",
        "rcp.approx.ftz.f64 %fd1, %fd2;",
        "add.rn.f32 %f1, %f2, %f3;",
        "min.f32 %f1, %f2, %f3;",
        ".extern .func (.param .b64 func_retval0) sin",
        "call (retval0), %rd1, (param0), prototype_0; .callprototype",
    ],
)
def test_arithmetic_with_other_bits_is_found(line: str) -> None:
    assert find_inexact(f"\tmov.f64 %fd1, 0d0000000000000000;\n\t{line}\n")


def test_exact_arithmetic_is_not() -> None:
    exact = [f"{name}.rn.f64" for name in ("add", "sub", "mul", "div", "sqrt", "rcp")]
    exact += ["min.f64", "max.f64"]
    others = ("abs.f64", "neg.f64", "setp.lt.f64", "selp.f64", "cvt.rn.f64.s64", "cvt.rzi.s64.f64")
    assert not find_inexact("\n".join(f"\t{name} %fd1, %fd2, %fd3;" for name in (*exact, *others)))


@pytest.mark.slow
def test_the_kernel_of_the_baseline_is_exact_and_whole(ptx: str) -> None:
    assert find_inexact(ptx) == []
    assert f".entry {ENTRY}(" in ptx
    for name in ("add", "sub", "mul", "div", "sqrt"):
        assert f"{name}.rn.f64" in ptx


@pytest.mark.slow
def test_a_kernel_of_other_parts_is_exact() -> None:
    assert find_inexact(ptx_of(*COMBINATIONS)) == []


@pytest.mark.slow
@pytest.mark.ptxas
def test_nvidias_assembler_takes_it(ptx: str, tmp_path: Path) -> None:
    """It finds the stack of each thread, which it cannot for calls by address or recursion."""
    source, target = tmp_path / "kernel.ptx", tmp_path / "kernel.cubin"
    source.write_text(ptx)
    command = [find_ptxas(), "-arch=sm_80", "-v", str(source), "-o", str(target)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert target.stat().st_size > 0
    assert "cumulative stack size" in done.stderr
    assert "cannot be statically determined" not in done.stderr
