"""Reads the verdicts on the requirements of an evaluation from its folder."""

import csv
from pathlib import Path

from evoros.requirement.pipeline import Row
from evoros.storage.file_reading import read_bytes
from evoros.storage.layout import REQUIREMENTS


def read_verdicts(folder: Path) -> list[Row]:
    """Read the verdicts of a finished evaluation; none if nothing was required."""
    path = folder / REQUIREMENTS
    if not path.is_file():
        return []
    return list(csv.DictReader(read_bytes(path).decode().splitlines()))


def name_worst(row: Row) -> dict[str, str]:
    """Return the columns by which ``evoros replay`` finds the mission that is worst."""
    place = {"world": row["worst_world"], "trial": row["worst_trial"]}
    return {"source": row["source"], "design": row["design"], **place}
