"""Modules of a user's own that have the names of folders of evoros."""

from pathlib import Path

from helpers import ROOT

ONE_NAME = (ROOT / "tests" / "one_name.py").read_text()


def write_own_modules(folder: Path) -> Path:
    """Write them into a new folder: two files and two packages."""
    for name in ("analysis.py", "tests/__init__.py", "docs/__init__.py", "conf.py"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("def locate():\n    return __file__\n")
    return folder
