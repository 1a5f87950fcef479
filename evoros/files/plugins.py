"""Plug-ins, their discovery, and messages about missing ones.

Bundled plug-ins are folders of ``evoros/plugins``; other packages offer theirs by entry points of
the group ``evoros.plugins``. In both cases, a package has a variable ``PLUGIN``.
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

GROUP = "evoros.plugins"  # package of bundled plug-ins, and entry point group
_NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class Subcommand:
    """A subcommand: its function (MODULE:NAME), arguments, help line and options."""

    target: str
    arguments: str
    about: str
    options: tuple[str, ...] = ()  # long options except --help; for ``analyze``, of all figures

    def load(self) -> Callable[[Sequence[str]], int]:
        """Import the function, which maps arguments to an exit status."""
        module, _, name = self.target.partition(":")
        function: Callable[[Sequence[str]], int] = getattr(import_module(module), name)
        return function


@dataclass(frozen=True)
class Plugin:
    """A plug-in; its additions have the names that users type as keys."""

    package: str  # ``__name__`` of the package
    title: str  # one-line title for users
    subcommands: Mapping[str, Subcommand] = field(default_factory=lambda: _NOTHING)
    figures: Mapping[str, str] = field(default_factory=lambda: _NOTHING)
    """Modules of figures of ``evoros analyze`` by name; they take precedence over core modules."""
    exports: frozenset[str] = frozenset()  # figures that are files for other software
    extras: tuple[str, ...] = ()  # extras of evoros that install the plug-in's libraries

    @property
    def folder(self) -> Path:
        """The folder of the plug-in's package."""
        return Path(str(import_module(self.package).__file__)).resolve().parent

    @property
    def conf(self) -> Path:
        """The folder of the plug-in's configuration groups; may be missing."""
        return self.folder / "conf"


@cache
def find_plugins() -> Mapping[str, Plugin]:
    """Find all plug-ins by name; bundled plug-ins take precedence over installed ones."""
    folders = sorted(file.parent.name for file in (PACKAGE / "plugins").glob("*/__init__.py"))
    bundled = {name: f"{GROUP}.{name}" for name in folders}
    installed = {entry.name: entry.value for entry in sorted(entry_points(group=GROUP))}
    modules = installed | bundled
    return {name: import_module(module).PLUGIN for name, module in modules.items()}


def conf_folders() -> Sequence[Path]:
    """Return the folders of configuration groups, first the core's, then those in plug-ins."""
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
"""Words that each bundled plug-in adds: ``GROUP=CHOICE``, a subcommand, or ``analyze FIGURE``."""


def explain_missing(word: str) -> str:
    """Explain how to obtain the bundled plug-in that adds a word; empty if none is missing."""
    names = [name for name, words in BUNDLED.items() if word in words]
    if not names or names[0] in find_plugins():
        return ""
    return (
        f"{word}: needs the plug-in {names[0]}, which is not installed; restore the folder "
        f"{PACKAGE / 'plugins' / names[0]}, for example by reinstalling evoros"
    )
