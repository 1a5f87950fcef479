"""The tutorial's commands run as they are written, except for the size of the study."""

import re
import shlex
import struct
import subprocess
from pathlib import Path

import pytest
from evoros.analysis.command import evoros_analyze
from evoros.analysis.subcommands import EXPORTS, SUBCOMMANDS
from helpers import ROOT

from evoros.base.console import DONE
from evoros.cli.evaluate import evaluate
from evoros.cli.run import evoros

pytestmark = pytest.mark.slow

TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text()
COMMANDS = {"evoros": evoros, "evoros-evaluate": evaluate, "evoros-analyze": evoros_analyze}
SHORT = ["course.time_limit_s=25", "executor=serial"]
SMALL = {
    "evoros": [
        *SHORT,
        "seed=0,1",
        "figures=[]",
        "optimizer.population_size=3",
        "optimizer.generations=2",
        "optimizer.validation_trials=1",
    ],
    "evoros-evaluate": [*SHORT, "trials=1"],
}
CLIP = ["--to", "2", "--size", "160x90"]


def lines() -> list[list[str]]:
    blocks = re.findall(r"^```bash\n(.*?)^```$", TUTORIAL, re.M | re.S)
    typed = [shlex.split(line) for block in blocks for line in block.splitlines()]
    return [words for words in typed if words[0] in COMMANDS]


def smaller(words: list[str]) -> list[str]:
    """The arguments, with those of the smaller study in place of the same keys."""
    name, *arguments = words
    added = CLIP if arguments[0] == "replay" else SMALL.get(name, [])
    keys = {word.partition("=")[0] for word in added if "=" in word}
    return [*(word for word in arguments if word.partition("=")[0] not in keys), *added]


def test_every_command_runs_in_order_and_leaves_what_the_next_needs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for words in lines():
        assert COMMANDS[words[0]](smaller(words)) == DONE, (words, capsys.readouterr().err)
    used = {words[1] for words in lines() if words[0] == "evoros-analyze"}
    assert used == set(SUBCOMMANDS) - EXPORTS
    drawn = {path.stem for path in (tmp_path / "outputs" / "paper").iterdir()}
    assert drawn >= used
    assert "Traceback" not in capsys.readouterr().err


def test_a_shell_takes_every_line() -> None:
    for block in re.findall(r"^```bash\n(.*?)^```$", TUTORIAL, re.M | re.S):
        checked = subprocess.run(["bash", "-n"], input=block, capture_output=True, text=True)
        assert checked.stderr == ""


def test_its_pictures_are_there() -> None:
    names = re.findall(r"!\[[^\]]+\]\((img/[\w.]+)\)", TUTORIAL)
    assert len(names) >= 6
    for name in names:
        head = (ROOT / "docs" / name).read_bytes()[:24]
        width, _ = struct.unpack(">II", head[16:])
        assert width >= 1000  # pixels: of at least one column at 300 dots an inch
