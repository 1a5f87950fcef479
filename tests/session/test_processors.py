"""A planar run has the same bytes on processors with other instructions.

The settings below make the C library, numpy, BLAS and numba choose what they would choose on an
older processor. On architectures other than x86-64 they change nothing.
"""

import os
import platform
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import pytest
from dask_cases import cluster
from helpers import everything

from evoros.cli.main import evoros
from evoros.session.diff import diff_runs
from evoros.terminal.console import DONE

SMALL = ("simulator=planar", "executor=serial", "figures=[]", "record=all", "trials=1")
OPTIMIZER = ("population_size=3", "generations=2", "validation_trials=1")
TINY = (*SMALL, *(f"optimizer.{setting}" for setting in OPTIMIZER))
CASES = {
    "failures": ("failure=combined", "+filter@controller.localization.noise=pose_noise"),
    "spatial": ("failure=spatial", "controller=rover_l1"),
    "generated": ("experiment=yard", "failure=random"),
    "team": ("experiment=two_rovers",),
    "reckoning": ("experiment=reckoning",),
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


ALL = """
import sys
from evoros.cli.main import evoros

for line in sys.argv[1:]:
    assert evoros(line.split(" ")) == 0
"""


def run_cases(folder: Path, settings: Mapping[str, str], cases: Iterable[str]) -> Path:
    """Run small experiments in a process of their own, each into the folder of its name."""
    lines = [" ".join([*TINY, *CASES[case], f"hydra.run.dir={case}"]) for case in cases]
    folder.mkdir()
    subprocess.run(
        [sys.executable, "-c", ALL, *lines],
        cwd=folder,
        env={**os.environ, **settings},
        stdout=subprocess.DEVNULL,
        check=True,
    )
    return folder


def require_same(case: str, here: Path, there: Path) -> None:
    ours, theirs = (results(folder / case) for folder in (here, there))
    assert ours.keys() == theirs.keys()
    assert [name for name in ours if ours[name] != theirs[name]] == []


def results(folder: Path) -> dict[str, bytes]:
    """What a run has found: missions, generations, trajectories and the champion."""
    files = everything(folder)
    names = ("missions.csv", "generations/", "champion/", "trajectories/")
    assert any(name.startswith("champion/") for name in files)
    return {name: files[name] for name in files if name.startswith(names)}


@pytest.fixture(scope="module")
def everywhere(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """All cases as this processor runs them, and as an older one does, for which rules differ."""
    folder = tmp_path_factory.mktemp("processors")
    older = older_processor() | {"NUMBA_CPU_NAME": "generic"}
    return run_cases(folder / "here", {}, CASES), run_cases(folder / "there", older, CASES)


@pytest.mark.slow
@pytest.mark.parametrize("case", [*CASES])
def test_every_kind_of_run_has_the_same_bytes_with_older_instructions(
    case: str, everywhere: tuple[Path, Path]
) -> None:
    require_same(case, *everywhere)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="takes processors of Linux")
def test_a_cluster_of_different_processors_has_the_folder_of_this_one(tmp_path: Path) -> None:
    """Of a dask cluster, one of the two workers computes like an older processor."""
    arguments = [word for word in TINY if not word.startswith(("executor", "trials"))]
    arguments += [*CASES["failures"], "trials=2"]
    here, there = (tmp_path / name for name in ("here", "there"))
    assert evoros([*arguments, "executor=serial", f"hydra.run.dir={here}"]) == DONE
    with cluster(tmp_path, workers=1) as mixed:
        mixed.add_worker(older_processor())
        assert evoros([*arguments, "executor=dask", mixed.key, f"hydra.run.dir={there}"]) == DONE
    compared = diff_runs(here, there)
    assert compared.difference == ""
    assert compared.missions > 0


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
