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

_HOMES = {
    "Evaluator": "evoros.api",
    "EvorosError": "evoros.errors",
    "InputError": "evoros.errors",
    "Run": "evoros.runs",
    "RunStopped": "evoros.errors",
    "compose": "evoros.config",
    "evaluate": "evoros.api",
    "load_run": "evoros.runs",
    "replay": "evoros.history",
    "resume": "evoros.api",
    "run": "evoros.api",
}

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


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'evoros' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
