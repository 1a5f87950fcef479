"""Plug-ins: found, declared whole, apart from the core, which works without any of them."""

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers import ROOT

from evoros.files import plugins
from evoros.files.plugins import BUNDLED, Plugin, find_plugins
from evoros.files.resources import PACKAGE
from evoros.terminal.console import INPUT

WORDS = [(name, word) for name, words in BUNDLED.items() for word in words]
REPLACED = {"analyze claims"}
"""Figures of plug-ins in place of ones of the core, which the core has without them."""
WITHOUT = """
import json, pkgutil, sys
from importlib import import_module

import evoros
from evoros.config.compose import compose, list_choices
from evoros.files.plugins import find_plugins

failed = []
for module in pkgutil.walk_packages(evoros.__path__, "evoros."):
    if ".ros.bridge." in module.name or ".tests" in module.name or "__main__" in module.name:
        continue
    if module.name.split(".")[1] in ("robots", "worlds", "conf"):
        continue
    try:
        import_module(module.name)
    except ImportError as error:
        if (error.name or "evoros").startswith("evoros"):
            failed.append(f"{module.name}: {error}")
for group in sys.argv[1:]:
    for choice in list_choices(group):
        try:
            compose([f"{group}={choice}"])
        except evoros.InputError as error:
            failed.append(f"{group}={choice}: {error}")
print(json.dumps([evoros.__file__, sorted(find_plugins()), failed]))
"""


def list_words(plugin: Plugin) -> set[str]:
    """The words by which users choose what a plug-in adds."""
    files = plugin.conf.rglob("*.yaml")
    choices = {f"{file.parent.relative_to(plugin.conf)}={file.stem}" for file in files}
    figures = {f"analyze {figure}" for figure in plugin.figures} - REPLACED
    return choices | figures | set(plugin.subcommands)


def test_each_folder_is_a_plugin_with_a_page_and_tests() -> None:
    folders = {file.parent for file in (PACKAGE / "plugins").glob("*/__init__.py")}
    assert {plugin.folder for plugin in find_plugins().values()} == folders
    for folder in folders:
        assert (folder / "README.md").is_file(), folder
        assert list(folder.glob("tests/test_*.py")), folder


def test_the_table_has_the_words_of_each_bundled_plugin() -> None:
    declared = {name: list_words(plugin) for name, plugin in find_plugins().items()}
    assert {name: set(words) for name, words in BUNDLED.items()} == declared


@pytest.mark.parametrize(("name", "word"), WORDS)
def test_the_choice_of_a_missing_plugin_is_answered_by_how_to_get_it(
    name: str, word: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    others = {key: plugin for key, plugin in find_plugins().items() if key != name}
    monkeypatch.setattr(plugins, "find_plugins", lambda: others)
    assert plugins.explain_missing(word).startswith(f"{word}: needs the plug-in {name}, ")
    assert plugins.explain_missing("seed=0") == ""


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package, its links followed."""
    folder = tmp_path_factory.mktemp("copy")
    shutil.copytree(PACKAGE, folder / "evoros", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / ".importlinter", folder)
    return folder


@pytest.fixture(params=sorted(BUNDLED))
def without(
    copied: Path, request: pytest.FixtureRequest, tmp_path: Path
) -> Iterator[tuple[Path, str]]:
    """The copy without one plug-in, and its name."""
    place, aside = copied / "evoros" / "plugins" / request.param, tmp_path / request.param
    shutil.move(place, aside)
    yield copied, request.param
    shutil.move(aside, place)


@pytest.mark.slow
def test_the_core_works_without_any_of_them(without: tuple[Path, str]) -> None:
    """All modules import, and all experiments and choices beside the missing ones compose.

    ``.ci/plugins`` runs the whole quick suite.
    """
    folder, name = without
    groups = {word.partition("=")[0] for word in BUNDLED[name] if "=" in word} | {"experiment"}
    command = [sys.executable, "-c", WITHOUT, *sorted(groups)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    place, names, failed = json.loads(done.stdout.splitlines()[-1])
    assert Path(place).is_relative_to(folder)
    assert names == sorted(set(BUNDLED) - {name})
    assert failed == []
    if not BUNDLED[name]:
        return  # other programs use it
    word, *figure = BUNDLED[name][0].split()
    command = [sys.executable, "-m", "evoros", word, *figure, *(["a"] * bool(figure))]
    refused = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert refused.returncode == INPUT
    assert f": needs the plug-in {name}, which is not installed; restore" in refused.stderr
    assert len(refused.stderr.splitlines()) == 1
