"""Tables of champions; the current best individual represents an unfinished run."""

import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext
from evoros.storage.layout import advise_finish
from evoros.world.model import World

from . import designs
from .records import Record
from .tracks import find_first_mission, load_champion_world, load_mission_world, select_robot

BEST_SO_FAR = "best so far"  # title of the design that represents an unfinished run


def read_champion_sensors(record: Record) -> pd.DataFrame:
    """Read a champion's sensors with its recorded fitness and validated fitness and interval."""
    return designs.place_sensors(_read_mounts(record), adapt_context(record)).assign(
        **_fitness(record)
    )


def read_champion_signals(record: Record) -> pd.DataFrame:
    """Read a champion's sensors without rays; see ``read_champion_sensors``."""
    return designs.place_signals(_read_mounts(record), adapt_context(record))


def read_champion(record: Record) -> pd.DataFrame:
    """Read a champion's sensors; return a single row with the fitness if it has no sensors."""
    return require_row(read_champion_sensors(record), **_fitness(record))


def require_row(frame: pd.DataFrame, **scores: float) -> pd.DataFrame:
    """Return a table of sensors or, if empty, a single row with the scores."""
    if len(frame):
        return frame
    missing = dict.fromkeys(("design", "sensor", "pair"), "Int64")  # numbers stay integers in joins
    return frame.reindex([0]).assign(**scores).astype(missing)


def adapt_context(record: Record) -> FigureContext:
    """Return the robot's context with the sensor parameters that the champion has evolved."""
    design = find_shown(record)
    if design is not None:
        return designs.adapt_types(record.context, designs.read_evolved(record, design))
    genes = select_robot(record.run.genes)
    evolved = dict(zip(genes.key.astype(str), genes.value.tolist(), strict=True))
    return designs.adapt_types(record.context, evolved)


def find_shown(record: Record) -> int | None:
    """Return the current best individual of an unfinished run; None for a finished run."""
    return None if record.finished else int(designs.read_best(record)["id"].iloc[0])


def require_trajectories(record: Record) -> None:
    """Check that the run has recorded trajectories of its champion or current best design."""
    kept = record.run.manifest.get("record")
    if not record.finished and kept not in ("all", "none"):
        raise InputError(
            f"{record.path}: not finished, so there are no trajectories and worlds of a champion "
            f"yet (record={kept}); {advise_finish(record.path)}"
        )
    record.run.require_trajectories()


def load_shown_world(record: Record, name: str) -> World:
    """Load a world as in the first mission of the champion or current best design."""
    design = find_shown(record)
    if design is None:
        return load_champion_world(record.run, record.context, name)
    require_trajectories(record)
    row = find_first_mission(record.run, design, name)
    return load_mission_world(record.run, record.context, row)


def _read_mounts(record: Record) -> pd.DataFrame:
    if not record.finished:
        return designs.list_mounts(designs.read_best(record), record)
    return select_robot(record.run.champion)


def _fitness(record: Record) -> dict[str, float]:
    status = record.run.status
    names = {
        "fitness": "best_fitness",
        "validated_fitness": "best_validated_fitness",
        "fitness_low": "fitness_low",
        "fitness_high": "fitness_high",
    }
    return {name: designs.to_number(status.get(key)) for name, key in names.items()}
