"""Each module has one name, and hides no module of a user's."""

import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from helpers import ROOT
from own_modules import ONE_NAME, write_own_modules


def test_the_folder_analysis_has_one_name() -> None:
    with pytest.raises(ImportError, match=r"^analysis: .* is imported as evoros\.analysis; "):
        import_module("analysis")
    assert (
        import_module("evoros.analysis.subcommands").Product.__module__
        == "evoros.analysis.subcommands"
    )


@pytest.mark.slow
@pytest.mark.parametrize("inside", [False, True])
def test_names_in_a_checkout_that_is_not_installed(inside: bool, tmp_path: Path) -> None:
    modules = write_own_modules(tmp_path / "mine")
    done = subprocess.run(
        [sys.executable, "-c", ONE_NAME, modules],
        cwd=ROOT if inside else tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == f"{ROOT / 'evoros' / '__init__.py'}\n", done.stderr


def test_a_copy_that_lost_its_links_says_so(tmp_path: Path) -> None:
    """Links as git writes them with ``core.symlinks=false``: files with the link's target."""
    package = tmp_path / "evoros"
    package.mkdir()
    shutil.copy(ROOT / "evoros" / "__init__.py", package)
    (package / "analysis").write_text("../analysis")
    done = subprocess.run(
        [sys.executable, "-c", "import evoros"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr.splitlines()[-1].startswith(f"ImportError: {package}/analysis must be a ")
