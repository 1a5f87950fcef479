"""evoros: evolve robot designs in simulation, declared in configuration.

    import evoros

    run = evoros.run(["experiment=quickstart", "seed=1"], "outputs/mine")
    run.generations  # a pandas frame

Everything here is imported on first use, so that ``import evoros`` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from evoros.api import Evaluator, evaluate, resume, run
    from evoros.config import compose
    from evoros.errors import EvorosError, InputError, RunStopped
    from evoros.history import replay
    from evoros.runs import Run, load_run

__all__ = [
    "Evaluator",
    "EvorosError",
    "InputError",
    "Run",
    "RunStopped",
    "compose",
    "evaluate",
    "load_run",
    "replay",
    "resume",
    "run",
]


_HOMES = ("errors", "runs", "config", "history", "api")
"""The modules that have these names; what is asked for is looked for in the lightest ones first."""


def __getattr__(name: str) -> Any:
    if name in __all__:
        for home in _HOMES:
            module = import_module(f"evoros.{home}")
            if hasattr(module, name):
                return getattr(module, name)
    raise AttributeError(f"module 'evoros' has no attribute {name!r}")
