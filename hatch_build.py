"""Adds to the wheel the commit that it is built from, and machine code for this processor.

The source distribution has the commit alone, and an editable installation neither: it asks git, and
compiles rules when they are first used.
"""

import json
import os
import runpy
import sys
from pathlib import Path
from subprocess import Popen
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class AddMade(BuildHookInterface):
    """Adds ``evoros/origin.json`` and ``evoros/machine_code/``."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Make the files in a temporary folder: a build leaves no file in the checkout."""
        if version == "editable":
            return
        self.folder = TemporaryDirectory()
        made = build_data["force_include"]
        origin = runpy.run_path(str(Path(self.root, "evoros", "files", "origin.py")))
        if not Path(self.root, "evoros", origin["RECORD"]).exists():
            file = Path(self.folder.name, origin["RECORD"])
            file.write_text(json.dumps(origin["read_origin"]()._asdict()) + "\n", encoding="utf-8")
            made[str(file)] = f"evoros/{origin['RECORD']}"
        if self.target_name == "wheel":
            made |= self._compile(Path(self.folder.name))

    def _compile(self, folder: Path) -> dict[str, str]:
        """Compile the bundled rules on all cores; return the path in the wheel of each file.

        If that fails, the wheel has no machine code, and rules are compiled when they are used.
        """
        shares = min(os.cpu_count() or 1, 4)
        variables = os.environ | {"XDG_CACHE_HOME": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-m", "evoros.mission.bundled_rules"]
        processes = [
            Popen([*command, str(share), str(shares)], cwd=self.root, env=variables)
            for share in range(shares)
        ]
        statuses = [process.wait() for process in processes]  # before the folder is deleted
        if any(statuses):
            return {}
        cache = folder / "evoros"
        files = [file for file in cache.rglob("*.nb?") if file.is_file()]
        return {str(file): f"evoros/machine_code/{file.relative_to(cache)}" for file in files}

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Delete the temporary folder."""
        if hasattr(self, "folder"):
            self.folder.cleanup()
