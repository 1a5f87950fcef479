"""docs/reference.md has every key and default of conf/; commands of the documents build."""

import re
import shlex
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from documents import commands, files, split_command, table, text, write
from examples import composed
from fixture_types import Patch

from evoros.cli.command import parse_options
from evoros.files.plugins import conf_folders

CHOICES = {
    str(path.relative_to(folder).with_suffix("")): path
    for folder in conf_folders()
    for path in sorted(folder.rglob("*.yaml"))
}
DOCUMENTS = (
    "configuration",
    "run_folder",
    "worlds",
    "architecture",
    "agents",
    "evaluation",
    "sensors",
    "python",
    "search",
    "neural",
)


# Reference ----------------------------------------------------------------------------------


def sections() -> dict[str, str]:
    """The sections of reference.md that describe one file of conf/, by its path."""
    parts = re.split(r"^### `([^`]+)`$", text("reference"), flags=re.M)
    return {parts[i].replace("=", "/"): parts[i + 1] for i in range(1, len(parts), 2)}


def leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping) and value:
        for name, inner in value.items():
            if name not in ("_target_", "defaults"):
                yield from leaves(inner, f"{key}.{name}" if key else str(name))
    elif key:
        yield key, value


def test_every_choice_has_a_section_and_no_section_is_without_one() -> None:
    assert sorted(sections()) == sorted(CHOICES)


@pytest.mark.parametrize("choice", CHOICES)
def test_every_key_of_a_file_is_in_its_section_with_its_value(choice: str) -> None:
    """Read by another parser: what the script takes from the lines, YAML takes from the file."""
    rows = {row[0]: row[1] for row in table(sections()[choice], "key")}
    shown: dict[str, Any] = {}
    for key, default in rows.items():
        shown |= dict(leaves(yaml.safe_load(default or "null"), key))
    for key, value in leaves(yaml.safe_load(CHOICES[choice].read_text())):
        assert shown[key] == value, key


COMPOSING = ("evoros", "evoros evaluate", "evoros resume")
COMMANDS = sorted(
    {
        line
        for name in DOCUMENTS
        for line in commands(name)
        if split_command(line)[0] in COMPOSING and "like=" not in line
    }
)


@pytest.mark.slow
@pytest.mark.parametrize("line", COMMANDS)
def test_the_commands_compose_and_build(line: str, tmp_path: Path, monkeypatch: Patch) -> None:
    write(files("configuration"), tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))  # the user's own folder is added to it
    if line.startswith("evoros resume"):
        overrides = parse_options(shlex.split(line, comments=True)[3:]).overrides
        allowed = ("executor", "optimizer.generations", "trials", "controls", "stop_after")
        assert all(word.partition("=")[0].startswith(allowed) for word in overrides)
    else:
        next(iter(composed(line))).build()  # of a sweep its first job
