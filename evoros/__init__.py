"""evoros: evolve robot designs in simulation, declared in configuration.

    import evoros

    run = evoros.run(["experiment=quickstart", "seed=1"], "outputs/mine")
    run.generations  # a pandas data frame

Everything here is imported on first use, so that ``import evoros`` costs nothing.
"""

import os

TYPE_CHECKING = False  # typing takes longer to import than all else here
if TYPE_CHECKING:
    from evoros.api import Evaluator, evaluate, resume, run
    from evoros.base.errors import EvorosError, InputError, RunStopped
    from evoros.config.compose import compose
    from evoros.config.configuration import Configuration
    from evoros.design.design import Design
    from evoros.evolution.experiment import Experiment
    from evoros.sensor.protocol import Mount
    from evoros.session.replay import replay
    from evoros.session.status import Display, NoDisplay
    from evoros.storage.reading import Run, load_run

    __version__: str  # derived from git tags; see ``evoros.files.origin``

# fmt: off
__all__ = [  # noqa: RUF022 - grouped by topic
    # Runs.
    "run", "resume", "load_run", "replay", "Run",
    # Designs.
    "evaluate", "Evaluator", "Design", "Mount",
    # Configurations.
    "compose", "Configuration", "Experiment",
    # Progress.
    "Display", "NoDisplay",
    # Errors.
    "EvorosError", "InputError", "RunStopped",
]
# fmt: on

_ANALYSIS = os.path.join(os.path.dirname(__file__), "analysis")
if os.path.isfile(_ANALYSIS):  # a copy of a checkout without its symbolic links
    raise ImportError(
        f"{_ANALYSIS} must be a symbolic link to ../analysis, but is a file: "
        "this copy lost its symbolic links; clone again with `git -c core.symlinks=true clone`"
    )

if not TYPE_CHECKING:  # type checkers would otherwise accept any name
    from evoros.base.lazy import import_lazily

    _HOMES = {
        "Configuration": "config.configuration",
        "Design": "design.design",
        "Display": "session.status",
        "Evaluator": "api",
        "EvorosError": "base.errors",
        "Experiment": "evolution.experiment",
        "InputError": "base.errors",
        "Mount": "sensor.protocol",
        "NoDisplay": "session.status",
        "Run": "storage.reading",
        "RunStopped": "base.errors",
        "compose": "config.compose",
        "evaluate": "api",
        "load_run": "storage.reading",
        "replay": "session.replay",
        "resume": "api",
        "run": "api",
    }
    _import_name, __dir__ = import_lazily(__name__, _HOMES)

    def __getattr__(name):
        if name == "__version__":
            from evoros.files.origin import read_origin

            return read_origin().version
        return _import_name(name)
