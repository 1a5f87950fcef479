"""Each module has one name, and hides no module of a user's."""

import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from helpers import ROOT


def test_the_folder_analysis_has_one_name() -> None:
    with pytest.raises(ImportError, match=r"^analysis: .* is imported as evoros\.analysis; "):
        import_module("analysis")
    assert (
        import_module("evoros.analysis.subcommands").Product.__module__
        == "evoros.analysis.subcommands"
    )


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
