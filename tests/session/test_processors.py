"""A planar run has the same bytes on processors with other instructions.

The settings below make the C library, numpy, BLAS and numba choose what they would choose on an
older processor. On architectures other than x86-64 they change nothing.
"""

import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import ROOT, everything

from evoros.cli.main import evoros
from evoros.terminal.console import DONE

SMALL = ("simulator=planar", "executor=serial", "figures=[]", "record=all", "trials=1")
OPTIMIZER = ("population_size=3", "generations=2", "validation_trials=1")
TINY = (*SMALL, *(f"optimizer.{setting}" for setting in OPTIMIZER))
NOISE = "+filter@controller.localization.noise=pose_noise"
CASES = {
    "team": ("experiment=two_rovers", "failure=spatial", "controller=rover_l1", NOISE),
    "reckoning": ("experiment=reckoning", "failure=combined", "world=generated"),
    "lidar": ("experiment=lidar", "failure=random"),
    "rooms": ("experiment=rooms",),
}


def older_processor() -> dict[str, str]:
    """Environment variables that switch off instructions which this processor may have."""
    extensions = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    return {
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
        "NPY_DISABLE_CPU_FEATURES": " ".join(extensions),
        "OPENBLAS_CORETYPE": "Prescott",
    }


ALL = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_processors import run_cases

run_cases(".")
"""


def run_cases(folder: str | Path) -> None:
    """Run small experiments, each into the folder of its name."""
    for case, parts in CASES.items():
        assert evoros([*TINY, *parts, f"hydra.run.dir={folder}/{case}"]) == DONE


def results(folder: Path) -> dict[str, bytes]:
    """What a run has found: missions, generations, trajectories and the champion."""
    files = everything(folder)
    names = ("missions.csv", "generations/", "champion/", "trajectories/")
    assert any(name.startswith("champion/") for name in files)
    return {name: files[name] for name in files if name.startswith(names)}


@pytest.mark.slow
def test_every_kind_of_run_has_the_same_bytes_with_older_instructions(tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    run_cases(here)
    there.mkdir()
    older = older_processor() | {"NUMBA_CPU_NAME": "generic"}
    environment = {**os.environ, **older, "PYTHONPATH": str(ROOT / "tests")}
    subprocess.run([sys.executable, "-c", ALL], cwd=there, env=environment, check=True)
    for case in CASES:
        ours, theirs = (results(folder / case) for folder in (here, there))
        assert ours.keys() == theirs.keys()
        assert [name for name in ours if ours[name] != theirs[name]] == []


def test_the_settings_change_what_the_libraries_compute() -> None:
    """Or the tests above could not fail."""
    if platform.machine() != "x86_64":
        pytest.skip("the settings are for x86-64")
    here, there = (
        subprocess.run(
            [sys.executable, "-c", PROBE],
            env={**os.environ, **settings},
            stdout=subprocess.PIPE,
            check=True,
        ).stdout
        for settings in ({}, older_processor())
    )
    if here == there:
        pytest.skip("this processor has no newer instructions")


PROBE = """
import math, numpy as np
x = np.linspace(0.1, 9.0, 900)
square = x.reshape(30, 30)
print(list(map(math.sin, x)), list(map(math.exp, x)), (square @ square).tolist())
"""
