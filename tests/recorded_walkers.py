"""Missions among walkers, and where these were."""

from pathlib import Path

import pandas as pd
from helpers import finished_run

from evoros.analysis.tables.records import Record, read_record
from evoros.base.arrays import Array

WORLDS = ("near", "far")
RADIUS_M, HEIGHT_M = 0.31, 1.52
PEOPLE = (
    "simulator=planar",
    "walkers=people",
    "walkers.people.number=[1,4]",
    f"walkers.people.radius_m={RADIUS_M}",
    f"walkers.people.height_m={HEIGHT_M}",
    "optimizer.generations=1",
)
"""A mission has one to four walkers, so that some of the columns can be empty."""


def read_people(folder: Path) -> Record:
    return read_record(finished_run(folder / "run", *PEOPLE), "run")


def find_places(flown: pd.DataFrame) -> dict[str, Array]:
    """The places (n, 2) [m] of each walker that the mission had, by its name."""
    columns = [str(name) for name in flown if flown[name].notna().any()]
    walkers = [name for name in columns if name.startswith("walkers.") and name.endswith(".x_m")]
    names = [name.removeprefix("walkers.").removesuffix(".x_m") for name in walkers]
    places = {name: flown[[f"walkers.{name}.{axis}_m" for axis in "xy"]] for name in names}
    return {name: columns.to_numpy(float) for name, columns in places.items()}
