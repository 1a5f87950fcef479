"""The choice of recorded missions on the command line."""

import argparse
from collections.abc import Callable, Iterator
from functools import partial

from evoros.base.errors import InputError
from evoros.terminal.log import LOGGER

from ..subcommands import add_run, add_worlds
from ..tables.records import Record
from ..tables.shown import is_kept
from ..tables.study import Study
from .missions import RecordedMission, list_rows, read_champion_mission, read_mission


def add_missions(parser: argparse.ArgumentParser) -> None:
    """Add the choice of missions."""
    add_run(parser)
    add_worlds(parser)
    every = "instead of the champion: the recorded missions"
    parser.add_argument("--design", type=int, metavar="ID", help=f"{every} of this individual")
    parser.add_argument("--generation", type=int, metavar="N", help=f"{every} of this generation")
    parser.add_argument("--trial", type=int, metavar="N", help=f"{every} of this trial")


def choose_missions(
    study: Study, options: argparse.Namespace
) -> tuple[Record, list[RecordedMission]]:
    """Read the chosen missions, at least one, and their run."""
    study.check_worlds(options.world or [])
    return study.choose(options.run, partial(_read, options=options))


def _read(record: Record, options: argparse.Namespace) -> list[RecordedMission]:
    """Read the missions of one design; report and skip those that cannot be read."""
    record.run.require_trajectories()
    missions: list[RecordedMission] = []
    for read in _list_readers(record, options):
        try:
            missions.append(read())
        except InputError as error:
            LOGGER.warning("%s; left out", error)
    if not missions:
        raise InputError(
            f"{record.path}: must have a complete mission as chosen, but has none; choose others, "
            f"or restore the run"
        )
    return missions


def _list_readers(
    record: Record, options: argparse.Namespace
) -> Iterator[Callable[[], RecordedMission]]:
    wanted = options.world or list(record.context.courses)
    numbers = (options.generation, options.design, options.trial)
    if numbers == (None, None, None):
        for world in record.context.courses:
            if world in wanted:
                yield partial(read_champion_mission, record, world)
        return
    record.run.require_trajectories(of_others=True)
    keeps_all = record.run.manifest.get("record") == "all"
    for row in list_rows(record, *numbers):
        if row["world"] in wanted and (keeps_all or is_kept(record, row)):
            yield partial(read_mission, record, row)
