"""The commands of docs/your_robot.md lead from its example files to an evaluated champion."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
import yaml
from documents import example_files, shell_lines, split_command, text, write
from fixture_types import Capture, Patch

from evoros.analysis.command import evoros_analyze
from evoros.cli.command import evaluate
from evoros.cli.inspect import inspect
from evoros.cli.main import evoros
from evoros.storage.figure_context import FigureContext
from evoros.storage.reading import load_run
from evoros.terminal.console import DONE

PAGE = text("your_robot")
LINES = [split_command(line) for line in shell_lines(PAGE)]
COMMANDS: dict[str, Callable[[Sequence[str]], int]] = {  # in the order of the page
    "evoros inspect": inspect,
    "evoros": evoros,
    "evoros evaluate": evaluate,
    "evoros analyze": evoros_analyze,
}
LIMIT = "world.depot.course.time_limit_s=6"
SMALL = {
    "evoros": [
        LIMIT,
        "executor=serial",
        "figures=[]",
        "optimizer.population_size=3",
        "optimizer.generations=2",
        "optimizer.validation_trials=1",
    ],
    "evoros evaluate": [LIMIT, "executor=serial"],
}


@pytest.mark.slow
def test_every_command_runs_in_order(tmp_path: Path, monkeypatch: Patch, capsys: Capture) -> None:
    write(example_files(), tmp_path)
    monkeypatch.chdir(tmp_path)
    assert [words[0] for words in LINES] == list(COMMANDS)
    for name, *words in LINES:
        assert COMMANDS[name]([*words, *SMALL.get(name, [])]) == DONE, capsys.readouterr().err
        if name == "evoros inspect":  # the page shows what it prints, apart from long lines
            shown = re.findall(r"^```text\n(robot scout.*?)^```$", PAGE, re.M | re.S)[0]
            printed = capsys.readouterr().out
            for line in shown.splitlines():
                assert line.removesuffix("...").rstrip() in printed
    champion = tmp_path / "outputs" / "scout" / "champion"
    assert (champion / "robot.urdf").exists()
    assert (champion / "world_depot.sdf").exists()
    package = tmp_path / "outputs" / "src" / "scout_champion"  # its root link is off the ground
    parameters = yaml.safe_load((package / "config" / "robot.yaml").read_text())
    sensors = parameters["/**"]["ros__parameters"]["evoros"]
    poses = load_run(champion.parent).champion
    assert len(sensors["sensors"]) == len(poses) > 0
    ground = FigureContext.read(champion.parent).places["base_link"][2]
    for name, z in zip(sensors["sensors"], poses.z_m, strict=True):
        assert sensors[name]["pose"][2] == ground + z
    assert (package / "drawing" / "mounting.pdf").exists()
