"""Plug-ins: found, declared whole, apart from the core, which works without any of them."""

import json
import shutil
import subprocess
import sys
from collections.abc import Sequence
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
from evoros.cli.main import evoros as command
from evoros.config.compose import compose, list_choices
from evoros.files.plugins import BUNDLED, find_plugins

failed, kept = [], sys.argv[1:]
packages = [import_module(f"evoros.plugins.{name}") for name in kept] or [evoros]
modules = [m for p in packages for m in pkgutil.walk_packages(p.__path__, f"{p.__name__}.")]
for module in modules:
    if ".ros.bridge." in module.name or ".tests" in module.name or "__main__" in module.name:
        continue
    if module.name.split(".")[1] in ("robots", "worlds", "conf"):
        continue
    try:
        import_module(module.name)
    except ImportError as error:
        if (error.name or "evoros").startswith("evoros"):
            failed.append(f"{module.name}: {error}")
words = {words[0]: name for name, words in BUNDLED.items() if words}
groups = {"experiment", *(word.split("=")[0] for word in words if "=" in word)}
choices = [f"{group}={choice}" for group in groups for choice in list_choices(group)]
for choice in [word for name in kept for word in BUNDLED[name]] or choices:
    try:
        compose([choice])
    except evoros.InputError as error:
        failed.append(f"{choice}: {error}")
print(json.dumps([evoros.__file__, sorted(find_plugins()), failed]))
for word, name in words.items():
    if name not in find_plugins():
        typed = [*word.split(), "a"] if "analyze" in word else [word]
        print(name, command(typed), file=sys.stderr)
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


def copy_package(folder: Path, kept: Sequence[str]) -> list[str]:
    """Copy the package with some of the plug-ins; return the names of the others."""
    left_out = [name for name in BUNDLED if name not in kept]
    ignored = shutil.ignore_patterns(*left_out)
    shutil.copytree(PACKAGE / "plugins", folder / "evoros" / "plugins", ignore=ignored)
    ignored = shutil.ignore_patterns("plugins")
    shutil.copytree(PACKAGE, folder / "evoros", ignore=ignored, dirs_exist_ok=True)
    return left_out


@pytest.mark.slow
@pytest.mark.parametrize("kept", [[], ["barn"]], ids=["none", "barn"])
def test_the_core_works_without_any_of_them(kept: list[str], tmp_path: Path) -> None:
    """All modules import, and all experiments and choices that are there compose.

    Those of the plug-in with experiments work without the others. ``.ci/plugins`` runs the whole
    quick suite without each of them.
    """
    left_out = copy_package(tmp_path, kept)
    command = [sys.executable, "-c", WITHOUT, *kept]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    place, names, failed = json.loads(done.stdout.splitlines()[-1])
    assert Path(place).is_relative_to(tmp_path)
    assert names == kept
    assert failed == []
    lines = iter(done.stderr.splitlines())
    for name in (name for name in left_out if BUNDLED[name]):  # openscenario serves other programs
        assert f": needs the plug-in {name}, which is not installed; restore" in next(lines)
        assert next(lines) == f"{name} {INPUT}"
    assert not list(lines)


@pytest.mark.slow
def test_the_tests_of_the_core_import_none_of_them(tmp_path: Path) -> None:
    """A copy that has no plug-in collects them."""
    copy_package(tmp_path, ())
    shutil.copytree(ROOT / "tests", tmp_path / "tests")
    for name in ("benchmarks", "docs", "conf", "worlds", "README.md", "pyproject.toml"):
        (tmp_path / name).symlink_to(ROOT / name)
    command = [sys.executable, "-m", "pytest", "tests", "--collect-only", "-p", "no:cacheprovider"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:]
