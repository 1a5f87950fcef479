"""The commands of docs/test_bench.md find the fault of a ROS 2 node, and show that it is mended."""

import csv
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from documents import files, shell_lines, split_command, text, write
from fixture_types import Patch
from needs import ROS2_PYTHON

from evoros.analysis.command import evoros_analyze
from evoros.cli.command import evaluate
from evoros.cli.replay import replay
from evoros.terminal.console import DONE, NOT_DECIDED, NOT_MET

COMMANDS: dict[str, Callable[[Sequence[str]], int]] = {
    "evoros evaluate": evaluate,
    "evoros replay": replay,
    "evoros analyze": evoros_analyze,
}
SHORT = [  # enough to get past the first wall, or not
    "course.time_limit_s=45",
    "requirements.completes.of=progress",
    "requirements.completes.at_least=0.15",
    "requirements.touches_nothing.share=0.6",
]
SHARE = "+requirements.completes.share"


def run(line: str, folder: Path) -> int:
    """Run a command of the page, with short missions."""
    name, *words = split_command(line)
    if name not in COMMANDS:
        return subprocess.run(["bash", "-c", line], cwd=folder).returncode
    if name == "evoros evaluate":
        share = 0.98 if "hydra.run.dir=outputs/before" in words else 0.6
        words += [*SHORT, f"{SHARE}={share}"]
    return COMMANDS[name](words)


@pytest.mark.slow
@pytest.mark.ros(2)
def test_the_fault_of_the_node_is_found_and_mended(tmp_path: Path, monkeypatch: Patch) -> None:
    write(files("test_bench"), tmp_path)
    (tmp_path / "rclpy").symlink_to(ROS2_PYTHON.parents[1])
    monkeypatch.chdir(tmp_path)
    *commands, pipeline = shell_lines(text("test_bench"))
    statuses = [run(line, tmp_path) for line in commands]
    # So few trials do not show the margin of the last command.
    assert statuses == [DONE, NOT_MET, DONE, DONE, DONE, NOT_DECIDED]
    assert pipeline == commands[4].replace("outputs/after", "outputs/tested")
    assert (tmp_path / "outputs" / "before" / "figures" / "requirements.html").is_file()
    with (tmp_path / "outputs" / "regression" / "regression_missions.csv").open() as table:
        changes = [row["change"] for row in csv.DictReader(table)]
    assert {"better"} < set(changes) <= {"better", "same"}
