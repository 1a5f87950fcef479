"""Names of the files in the folder of a run or an evaluation, and the command that made it."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from evoros.files.regular import SMALL, read_regular
from evoros.storage.field_types import unseal

FORMAT_VERSION = 1
RUN, EVALUATE = "evoros", "evoros evaluate"
"""The command that evolves, which alone may extend what it resumes, and the one that scores."""
CONFIG, MANIFEST, STATUS, MISSIONS = "config.yaml", "manifest.json", "status.json", "missions.csv"
DESIGN_FILE, GENE_FILE = "designs_in.csv", "genes_in.csv"
"""The designs of an evaluation in its folder, complete and independent of their sources."""
ORIGINALS = (CONFIG, DESIGN_FILE, GENE_FILE)
"""Files from which, with the manifest, everything else follows; an evaluation has all three."""
ROBOT_AS_LOADED = "robot_as_loaded.urdf"
"""A champion as engines load it, if that is not its ``robot.urdf``."""
SELF_SIGHT = "self_sight.csv"
"""The sensors of a champion that see their own robot."""
RUNNING, FINISHED, STOPPED = "running", "finished", "stopped"
"""The states in ``status.json``."""
LOG, LOST = "evoros.log", "lost"
SETTING = "setting.json"
DIGESTS = "digests.csv"
TRAJECTORIES = "trajectories"
SCORES, WORST_CASES = "designs.csv", "worst_cases.csv"
REQUIREMENTS = "requirements.csv"
OVERRIDES = "overrides"
"""Field of the manifest of an evaluation: the overrides as typed."""
CONFIG_DIR = "config_dir"
"""Field of the manifest: the user's folder of configuration; null without one."""
SWEEP = "sweep"
"""Field of the manifest of a run: the folder of the sweep that it was a job of; null without."""
DAMAGED = "damaged"
"""The folder of copies of files that a bad disk had damaged before a resume mended them."""


def resume_command(path: Path, config_dir: str | None = None) -> str:
    """Return the command line that continues the run in the folder.

    Without a ``config_dir`` it has the folder of configuration with which the run was started.
    """
    folder = config_dir or read_json(path / MANIFEST).get(CONFIG_DIR)
    option = f" --config-dir {shlex.quote(str(folder))}" if folder else ""
    return f"evoros resume {shlex.quote(str(path))}{option}"


def replay_command(path: Path, columns: Mapping[Any, object]) -> str:
    """Return the command line that runs the mission again whose row has these values."""
    values = [f"{name}={value}" for name, value in columns.items()]
    return shlex.join(["evoros", "replay", str(path), *values])


def advise_finish(path: Path) -> str:
    """Advise how an unfinished run comes to its end; a killed run's state is still running."""
    if read_json(path / STATUS).get("state") == RUNNING:
        status = f"evoros status {shlex.quote(str(path))}"
        return f"wait for its end; to see whether it still runs, type: {status}"
    return f"type: {resume_command(path)}"


def command_of(path: Path) -> str:
    """Return the command that made the folder."""
    return str(read_json(path / MANIFEST).get("command", RUN))


def read_json(path: Path) -> dict[str, Any]:
    """Read the mapping in a sealed file; empty if there is none, or if it is damaged."""
    try:
        return unseal(path.name, read_regular(path, SMALL))
    except (OSError, ValueError):
        return {}
