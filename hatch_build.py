"""Records in the wheel and in the source distribution which commit they are built from."""

import json
import runpy
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class RecordOrigin(BuildHookInterface):
    """Adds ``evoros/origin.json``; an editable install needs none, because it asks git."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Write the record into a temporary folder: a build leaves no file in the checkout."""
        origin = runpy.run_path(str(Path(self.root, "evoros", "files", "origin.py")))
        if version == "editable" or Path(self.root, "evoros", origin["RECORD"]).exists():
            return
        self.folder = TemporaryDirectory()
        file = Path(self.folder.name, origin["RECORD"])
        file.write_text(json.dumps(origin["read_origin"]()._asdict()) + "\n", encoding="utf-8")
        build_data["force_include"][str(file)] = f"evoros/{origin['RECORD']}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Delete the temporary folder."""
        if hasattr(self, "folder"):
            self.folder.cleanup()
