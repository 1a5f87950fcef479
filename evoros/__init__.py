"""evoros: evolve robot designs in simulation, declared in configuration.

    import evoros

    run = evoros.run(["experiment=quickstart", "seed=1"], "outputs/mine")
    run.generations  # a pandas frame

Everything here is imported on first use, so that ``import evoros`` costs nothing.
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from evoros.api import Evaluator, evaluate, resume, run
    from evoros.base.errors import EvorosError, InputError, RunStopped
    from evoros.config.compose import compose
    from evoros.session.replay import replay
    from evoros.session.status import NoDisplay
    from evoros.storage.reading import Run, load_run

    __version__: str
    """From the tags of git, see ``evoros.files.origin``."""

__all__ = [
    "Evaluator",
    "EvorosError",
    "InputError",
    "NoDisplay",
    "Run",
    "RunStopped",
    "compose",
    "evaluate",
    "load_run",
    "replay",
    "resume",
    "run",
]

if Path(__file__).with_name("analysis").is_file():  # a copy of the checkout without its links
    raise ImportError(
        f"{Path(__file__).parent}/analysis must be a symbolic link to ../analysis, but is a file: "
        "this copy lost its links; clone again with `git -c core.symlinks=true clone`"
    )

_HOMES = {
    "EvorosError": "base.errors",
    "InputError": "base.errors",
    "RunStopped": "base.errors",
    "Run": "storage.reading",
    "load_run": "storage.reading",
    "compose": "config.compose",
    "NoDisplay": "session.status",
    "replay": "session.replay",
    "Evaluator": "api",
    "evaluate": "api",
    "resume": "api",
    "run": "api",
}
"""The module of each public name."""


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from evoros.files.origin import read_origin

        return read_origin().version
    if name in _HOMES:
        return getattr(import_module(f"evoros.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'evoros' has no attribute {name!r}")
