"""Skips tests whose needs this machine lacks, in one line each; a plugin that conftest loads.

A marker names a need that no Python package meets. A test that fails because a Python package is
not there needs that package. With ``--need-all``, as in continuous integration, a need that is not
met is a failure.
"""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Generator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import pytest

from evoros.base.errors import InputError
from evoros.files.plugins import find_plugins

ROS2_PYTHON = Path(
    os.environ.get("EVOROS_ROS2_PYTHON", Path(__file__).parents[1] / ".ros2" / "bin" / "python")
)
_DEBIAN = Path("/usr/lib/python3/dist-packages")


class Need(NamedTuple):
    """A need, whether this machine meets it, and how to meet it."""

    name: str
    is_met: Callable[[], bool]
    remedy: str


def _has_ros1() -> bool:
    modules = ("rospy", "rosmaster", "rosbag", "sensor_msgs", "nav_msgs", "tf2_msgs")
    return all((_DEBIAN / module).is_dir() for module in modules)


def _has_gazebo() -> bool:
    if shutil.which("ign") is None:
        return False
    return subprocess.run(["ign", "sdf", "--help"], capture_output=True).returncode == 0


def _has_gazebo_physics() -> bool:
    if "gazebo" not in find_plugins():
        return False
    from evoros.plugins.gazebo.server import find_library

    try:
        find_library()
    except InputError:
        return False
    return True


def find_ptxas() -> str:
    """Return the path of the assembler of NVIDIA's GPUs, of a wheel or a toolkit; else empty."""
    package = find_spec("nvidia")
    for folder in (package and package.submodule_search_locations) or ():
        for path in Path(folder).glob("*/bin/ptxas"):
            return str(path)
    return shutil.which("ptxas") or ""


def _has(*programs: str) -> Callable[[], bool]:
    return lambda: all(map(shutil.which, programs))


NEEDS = {
    "ros1": Need(
        "Debian's ROS 1",
        _has_ros1,
        "apt-get install python3-rospy python3-rosmaster python3-rosbag "
        "python3-{sensor,nav,geometry,rosgraph,std,tf2}-msgs",
    ),
    "ros2": Need(
        "ROS 2 in .ros2 or by EVOROS_ROS2_PYTHON", ROS2_PYTHON.exists, "as .ci/install makes it"
    ),
    "browser": Need(
        "Chromium", _has("chromium", "chromedriver"), "apt-get install chromium chromium-driver"
    ),
    "gazebo": Need("ign sdf", _has_gazebo, "apt-get install ignition-tools libsdformat-dev"),
    "gz_physics": Need(
        "Gazebo's physics library",
        _has_gazebo_physics,
        "see the page of the plug-in gazebo for its packages of Debian",
    ),
    "ptxas": Need("NVIDIA's ptxas", lambda: bool(find_ptxas()), "pip install -e '.[ptxas]'"),
    "compiler": Need("a C compiler", _has("cc"), "apt-get install gcc libc6-dev"),
}
"""By marker with its argument, such as ``ros(1)``."""

_PYBULLET = "PyBullet is not installed", "No module named 'pybullet'"
_DEV = (
    "av", "cma", "cuda", "distributed", "mcap", "mlflow", "nbclient", "nbformat",
    "py_trees", "pymavlink", "rerun", "rocrate", "rocrate_validator", "rosbags", "runcrate",
    "scenario_execution", "selenium", "sphinx", "tensorboard", "tensorboardX", "wandb",
)  # fmt: skip
"""Packages that tests import and only the extra ``dev`` has."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that continuous integration gives."""
    parser.addoption("--need-all", action="store_true", help="fail a test that lacks a need")


def pytest_itemcollected(item: pytest.Item) -> None:
    """Mark a test that uses the fixture ``browser``."""
    if "browser" in getattr(item, "fixturenames", ()):
        item.add_marker("browser")


@cache
def _find_lack(marker: str) -> str:
    """Return one line about a need that is not met; empty if it is."""
    need = NEEDS[marker]
    return "" if need.is_met() else f"needs {need.name}: {need.remedy}"


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip a test before its fixtures are made."""
    names = ["".join(map(str, (marker.name, *marker.args))) for marker in item.iter_markers()]
    for line in filter(None, (_find_lack(name) for name in names if name in NEEDS)):
        if item.config.getoption("need_all"):
            pytest.fail(line, pytrace=False)
        pytest.skip(line)


def _explain(failure: str) -> str:
    """Return one line about the package whose absence made a test fail; empty if none."""
    if sys.version_info >= (3, 12) and any(line in failure for line in _PYBULLET):
        return f"needs PyBullet, which has no wheels for Python 3.{sys.version_info.minor}"
    lacking = (name for name in _DEV if re.search(rf"No module named '{name}\b", failure))
    package = next((name for name in lacking if find_spec(name) is None), None)
    return f"needs {package}: pip install -e '.[dev]'" if package else ""


def _forgive(report: pytest.CollectReport | pytest.TestReport, config: pytest.Config) -> None:
    """Make a skip of a failure for want of a package."""
    if not report.failed or config.getoption("need_all"):
        return
    texts = [str(report.longrepr), *(text for _, text in report.sections)]
    if line := _explain("\n".join(texts)):
        report.outcome = "skipped"
        report.longrepr = (report.nodeid.partition("::")[0], 0, f"Skipped: {line}")


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    _forgive(report, collector.config)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    _forgive(report, item.config)
    return report
