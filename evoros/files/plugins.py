"""Plug-ins: their additions to the core, their discovery, and messages about missing ones.

A bundled plug-in is a folder of ``evoros/plugins``. Other packages add plug-ins by entry points of
the group ``evoros.plugins``. Both are packages with a variable ``PLUGIN``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from types import MappingProxyType
from typing import Any

from evoros.files.resources import PACKAGE, bundled_folder

GROUP = "evoros.plugins"  # package of the bundled plug-ins, and group of entry points
_NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class Subcommand:
    """A subcommand: its function as MODULE:NAME, arguments, one line of help, and options."""

    target: str
    arguments: str
    about: str
    options: tuple[str, ...] = ()
    """Long options except --help; for ``analyze``, the options common to all figures."""

    def load(self) -> Callable[[Sequence[str]], int]:
        """Import the function, which takes the arguments and returns the exit status."""
        module, _, name = self.target.partition(":")
        function: Callable[[Sequence[str]], int] = getattr(import_module(module), name)
        return function


@dataclass(frozen=True)
class Plugin:
    """A plug-in, and its additions, keyed by the names that users type."""

    package: str  # ``__name__`` of the package
    title: str  # one line for users
    subcommands: Mapping[str, Subcommand] = field(default_factory=lambda: _NOTHING)
    figures: Mapping[str, str] = field(default_factory=lambda: _NOTHING)
    """Modules of subcommands of ``evoros analyze`` by name; they replace modules of the core."""
    exports: frozenset[str] = frozenset()  # figures that only write files for other software
    extras: tuple[str, ...] = ()  # extras of evoros with the plug-in's libraries

    @property
    def folder(self) -> Path:
        """The folder of the plug-in's package."""
        return Path(str(import_module(self.package).__file__)).resolve().parent

    @property
    def conf(self) -> Path:
        """The folder of the plug-in's configuration groups, which may be missing."""
        return self.folder / "conf"


@cache
def find_plugins() -> Mapping[str, Plugin]:
    """Find all plug-ins by name; a bundled plug-in replaces an installed one of the same name."""
    folders = sorted(file.parent.name for file in (PACKAGE / "plugins").glob("*/__init__.py"))
    bundled = {name: f"{GROUP}.{name}" for name in folders}
    installed = {entry.name: entry.value for entry in sorted(entry_points(group=GROUP))}
    modules = installed | bundled
    return {name: import_module(module).PLUGIN for name, module in modules.items()}


def conf_folders() -> Sequence[Path]:
    """Return the folders of configuration groups of the core, then of the plug-ins."""
    folders = (plugin.conf for plugin in find_plugins().values())
    return [bundled_folder("conf"), *(folder for folder in folders if folder.is_dir())]


BUNDLED: Mapping[str, Sequence[str]] = {
    "ardupilot": ("controller=ardupilot",),
    "archives": ("archive", "reproduce"),
    "barn": (
        *("world=barn", "world=barn_files", "fitness=barn"),
        *("experiment=barn", "experiment=barn_gap"),
    ),
    "clusters": ("executor=dask",),
    "deploy": ("analyze deploy",),
    "evo_ros_2018": ("analyze failure", "analyze course", "analyze paper"),
    "gazebo": ("simulator=gazebo", "confirmation=gazebo"),
    "gpu": ("executor=gpu",),
    "leaderboard": ("leaderboard",),
    "openscenario": (),
    "recordings": ("analyze video", "analyze bag", "analyze rerun"),
    "ros": ("controller=ros1", "controller=ros2"),
    "trackers": ("observers=mlflow", "observers=tensorboard", "observers=wandb"),
    "watch": ("watch",),
}
"""Words of each bundled plug-in: ``GROUP=CHOICE``, a subcommand, or ``analyze FIGURE``."""


def explain_missing(word: str) -> str:
    """Explain how to get the missing bundled plug-in that adds a word; empty if none is missing."""
    names = [name for name, words in BUNDLED.items() if word in words]
    if not names or names[0] in find_plugins():
        return ""
    return (
        f"{word}: needs the plug-in {names[0]}, which is not installed; restore the folder "
        f"{PACKAGE / 'plugins' / names[0]}, for example by reinstalling evoros"
    )
