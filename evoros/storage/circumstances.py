"""The circumstances of a run besides its configuration: code, packages, machine."""

import platform
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any

from evoros.files.origin import read_origin
from evoros.files.resources import PACKAGE

OWN = "evoros"
COMPUTING = ("evoros", "numpy", "numba")  # packages that can change missions in every simulator


def describe_circumstances(
    packages: Iterable[str], programs: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return manifest fields on the code, packages, programs and machine of this process."""
    origin = read_origin()
    names = sorted({OWN, *map(normalize, (*packages, *_list_required()))})
    return {
        "commit": origin.commit,
        "dirty": origin.dirty,
        "packages": {name: find_version(name) for name in names},
        "programs": dict(programs or {}),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "operating_system": _operating_system(),
        "processor": processor(),
    }


def find_version(package: str) -> str | None:
    """Return the version of a package, or None if not installed."""
    return read_origin().version if package == OWN else _find_installed(package)


@cache
def _find_installed(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def normalize(package: str) -> str:
    """Return the normalized name of a package, such as ``pyyaml`` for ``PyYAML``."""
    return re.sub(r"[-_.]+", "-", package).lower()


@cache
def _list_required() -> Sequence[str]:
    listed: Sequence[str] = ()
    try:
        listed = requires(OWN) or ()
    except PackageNotFoundError:  # evoros is a clone that is not installed
        with suppress(OSError):
            project = tomllib.loads(
                (PACKAGE.parent / "pyproject.toml").read_text(encoding="utf-8")
            )["project"]
            listed = project["dependencies"]
    needed = (text for text in listed if "extra ==" not in text)
    return [re.split(r"[^\w.-]", text, maxsplit=1)[0] for text in needed]


def _operating_system() -> str:
    with suppress(OSError):
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    return f"{platform.system()} {platform.release()}"


def processor() -> str:
    """Return the model of the processor or, if unknown, its architecture."""
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
        if models:
            return models[0]
    return platform.processor() or platform.machine()
