"""Exports missions and the evolution of a run to the Rerun viewer."""

import argparse

from evoros.analysis.subcommands import Product
from evoros.analysis.tables.study import Study
from evoros.base.errors import InputError, require_extra, write_count
from evoros.plugins.recordings.missions import add_missions, choose_missions

WORST_MISSION = True
HELP = "recorded missions, and the best design of each generation, for the Rerun viewer"
NEEDS = "a run or an evaluation that recorded trajectories, and the package rerun-sdk"
FILES = ("rerun.rrd",)
FORMATS: dict[str, str] = {}
OUTPUT = "rerun"
add_arguments = add_missions
MAX_BYTES = 20_000_000  # maximum size [bytes] that the viewer opens without delay


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Make the recording."""
    with require_extra("rerun", "evoros analyze rerun"):
        from evoros.plugins.recordings.rerun.recording import record_study
    record, missions = choose_missions(study, options)
    content = record_study(record, missions)
    if len(content) > MAX_BYTES:
        raise InputError(
            f"{record.path}: the recording of {len(missions)} missions takes "
            f"{len(content) / 1e6:.0f} MB, but the limit is {MAX_BYTES / 1e6:.0f} MB; choose fewer "
            f"missions with --world, --generation or --trial"
        )
    count = write_count(len(missions), "mission")
    message = f"{record.name}: {count}, {len(content) / 1e6:.1f} MB"
    return Product(messages=[message], files={"rerun.rrd": content})
