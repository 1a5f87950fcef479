"""docs/configuration.md names every key and default of conf/, and its commands build."""

import re
import shlex
import sys
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
import yaml
from documents import commands, files, table, text, write
from examples import composed
from helpers import ROOT

from evoros.config.options import parse_options

CONF = ROOT / "conf"
DOCUMENTS = (
    "configuration",
    "run_folder",
    "worlds",
    "architecture",
    "extending",
    "python",
    "search",
    "neural",
)


# Configuration ------------------------------------------------------------------------------


def sections() -> dict[str, str]:
    """The sections of configuration.md that describe one file of conf/, by its path."""
    parts = re.split(r"^### `([^`]+)`$", text("configuration"), flags=re.M)
    return {parts[i].replace("=", "/"): parts[i + 1] for i in range(1, len(parts), 2)}


def leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping) and value:
        for name, inner in value.items():
            if name not in ("_target_", "defaults"):
                yield from leaves(inner, f"{key}.{name}" if key else str(name))
    elif key:
        yield key, value


def chosen(defaults: list[Any]) -> Iterator[tuple[str, Any]]:
    """The choices of a defaults list by their place: {/filter@effect: silence}."""
    for entry in defaults:
        if isinstance(entry, Mapping):
            ((name, choice),) = entry.items()
            place = str(name).removeprefix("override ").split("@")[-1]
            yield place.lstrip("/").removeprefix("_global_."), choice
        elif "@" in entry:
            choice, _, place = entry.partition("@")
            yield place, choice


def keys(path: Path) -> dict[str, Any]:
    """Every key that a file sets, with its value; the user's names of regions are one."""
    content = yaml.safe_load(path.read_text())
    values = dict(chosen(content.get("defaults", []))) | dict(leaves(content))
    return {re.sub(r"^regions\.\w+", "regions.NAME", key): values[key] for key in values}


CHOICES = sorted(str(path.relative_to(CONF).with_suffix("")) for path in CONF.rglob("*.yaml"))


def test_every_choice_has_a_section_and_no_section_is_without_one() -> None:
    assert sorted(sections()) == CHOICES


@pytest.mark.parametrize("choice", CHOICES)
def test_exactly_the_keys_of_each_file_are_documented_with_their_defaults(choice: str) -> None:
    documented = {row[0]: row[1] for row in table(sections()[choice], "key")}
    configured = keys(CONF / f"{choice}.yaml")
    # What a region, a gene and a fixed sensor may have besides: fields of their classes.
    optional = {"z_m", "height_m", "pitch_deg", "link", "overhang_m", "key", "low", "high", "whole"}
    optional |= {"group"}
    extra = {key for key in documented if ".NAME." in key and key.split(".")[-1] in optional}
    extra |= {key for key in documented if key.startswith("fixed.NAME.")}
    assert set(documented) - extra == set(configured) - extra
    for key, value in configured.items():
        if ".NAME." not in key and key != "hydra.help.template":
            assert yaml.safe_load(documented[key]) == value, key


def test_the_table_of_regions_is_that_of_the_design() -> None:
    regions = yaml.safe_load((CONF / "design/six_sonars.yaml").read_text())["regions"]
    documented = {
        row[0]: [list(map(float, cell.split(" to "))) for cell in row[1:]]
        for row in table(sections()["design/six_sonars"], "region")
    }
    assert documented == {
        name: [region[key] for key in ("x_m", "y_m", "yaw_deg")] for name, region in regions.items()
    }


COMMANDS = sorted({line for name in DOCUMENTS if name != "extending" for line in commands(name)})


@pytest.mark.parametrize("line", COMMANDS)
def test_the_commands_compose_and_build(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(files("configuration"), tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))  # the user's own folder is added to it
    if "resume=" in line:
        overrides = parse_options(shlex.split(line)[1:]).overrides
        allowed = ("resume", "executor", "executor.workers", "optimizer.generations")
        assert all(override.partition("=")[0] in allowed for override in overrides)
    else:
        configs = list(islice(composed(line), 3))
        for config in (configs[0], configs[-1])[: len(configs)]:
            config.build()
