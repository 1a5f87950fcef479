"""The README's commands and its example work, and it stays short."""

import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
from documents import shell_lines, write
from examples import composed
from helpers import ROOT

from evoros.filter.protocol import Channels

README = (ROOT / "README.md").read_text()
FILES = dict(re.findall(r"^<!-- file: (\S+) -->\n```\w+\n(.*?)^```$", README, re.M | re.S))
TYPED = [line.removeprefix(".venv/bin/") for line in shell_lines(README)]
COMMANDS = [
    line
    for line in TYPED
    if re.match(r"evoros( [\w.-]+=| -m| --config-dir| evaluate (?!like=)|$)", line)
]


def test_it_fits_on_a_few_screens() -> None:
    assert README.count("\n") <= 150


def test_the_test_command_installs_lints_and_tests() -> None:
    (command,) = re.findall(
        "<!-- test command -->\n```bash\n(.*?)\n```\n<!-- end -->", README, re.S
    )
    assert command == ".ci/install && .ci/check"
    steps = (ROOT / ".ci" / "check").read_text().splitlines()
    for tool in ("ruff check", "ruff format --check", "mypy", "lint-imports", "pytest"):
        assert any(step.startswith(tool) for step in steps), tool


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder ``mine`` of the README, below the current folder."""
    write(FILES, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))  # the user's own folder is added to it


@pytest.mark.usefixtures("mine")
@pytest.mark.parametrize("line", COMMANDS)
def test_the_commands_compose_and_build(line: str) -> None:
    words = [word for word in shlex.split(line, comments=True) if not word.startswith("designs=")]
    next(composed(shlex.join(words))).build()


@pytest.mark.usefixtures("mine")
def test_the_example_silences_the_first_half() -> None:
    (line,) = (line for line in COMMANDS if "mine" in line)
    failure = next(composed(line)).build().failure
    channels = Channels(np.zeros(6), np.full(6, 4.5), np.zeros((6, 3)), 0.1)
    (fault,) = failure.draw(channels, np.random.default_rng(0))
    np.testing.assert_array_equal(fault.onset, [30.0, 30.0, 30.0, np.inf, np.inf, np.inf])
