"""Missions and the evolution of a run as a recording for the viewer Rerun."""

import argparse

from evoros.base.errors import InputError
from evoros.base.extras import require_extra

from ..bags.choice import add_missions, choose_missions
from ..product import Product
from ..tables.study import Study

HELP = "recorded missions and the best designs of all generations, for the viewer Rerun"
NEEDS = "a run that keeps trajectories, and the package rerun-sdk"
FILES = {
    "rerun.rrd": "a recording for `rerun rerun.rrd`, with the layout of its views",
}
FORMATS: dict[str, str] = {}
OUTPUT = "rerun"
MAX_BYTES = 20_000_000
"""The viewer opens such a recording at once."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the missions."""
    add_missions(parser)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make the recording."""
    with require_extra("rerun", "evoros analyze rerun"):
        from .recording import record_study
    record, missions = choose_missions(study, options)
    content = record_study(record, missions)
    if len(content) > MAX_BYTES:
        raise InputError(
            f"{record.path}: the recording must have at most {MAX_BYTES / 1e6:.0f} MB, not "
            f"{len(content) / 1e6:.0f} MB for {len(missions)} missions; choose fewer by --world, "
            f"--generation or --trial"
        )
    message = f"{record.name}: {len(missions)} missions, {len(content) / 1e6:.1f} MB"
    return Product(messages=[message], files={"rerun.rrd": content})
