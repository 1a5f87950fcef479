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
    from evoros.base.errors import EvorosError, InputError, RunStopped
    from evoros.config.compose import compose
    from evoros.session.api import Evaluator, evaluate, resume, run
    from evoros.session.replay import replay
    from evoros.session.status import NoDisplay
    from evoros.storage.reading import Run, load_run

    __version__: str
    """From the tags of git, see ``evoros.base.origin``."""

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

_HOMES = {
    "EvorosError": "base.errors",
    "InputError": "base.errors",
    "RunStopped": "base.errors",
    "Run": "storage.reading",
    "load_run": "storage.reading",
    "compose": "config.compose",
    "NoDisplay": "session.status",
    "replay": "session.replay",
    "Evaluator": "session.api",
    "evaluate": "session.api",
    "resume": "session.api",
    "run": "session.api",
}
"""The module of each public name."""

_PACKAGE = Path(__file__).resolve().parent
if not (_PACKAGE / "analysis").is_dir():
    # In a checkout, analysis/ lies beside the package; a wheel has it inside. Either way it is
    # imported as evoros.analysis, also where a script is started in the root of the checkout.
    __path__.append(str(_PACKAGE.parent))


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from evoros.base.origin import read_origin

        return read_origin().version
    if name in _HOMES:
        return getattr(import_module(f"evoros.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'evoros' has no attribute {name!r}")
