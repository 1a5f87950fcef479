"""A program (arguments FOLDER NAME) that reruns the current best design of a run for the player."""

import resource
import sys
from pathlib import Path

from evoros.analysis.report.playback import encode_shown
from evoros.analysis.tables.champions import find_shown
from evoros.analysis.tables.records import Record, read_record
from evoros.analysis.tables.shown import ShownDesign, ShownMission, read_shown
from evoros.analysis.tables.tracks import find_first_mission, find_key
from evoros.base.errors import EvorosError, single_line
from evoros.session.replay import replay_in_plane
from evoros.terminal.console import DONE, INPUT

PROCESSOR_S = 60  # CPU time [s] after which the kernel kills this process


def main() -> int:
    """Run the program, print any error in one line, and return the exit status."""
    resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_S, PROCESSOR_S))
    folder, name = sys.argv[1:]
    try:
        print(encode_shown(fly_best(read_record(Path(folder), name))))
    except EvorosError as error:
        print(single_line(error), file=sys.stderr)
        return INPUT
    return DONE


def fly_best(record: Record) -> ShownDesign:
    """Rerun the missions shown in the player for the best design of an unfinished planar run."""
    design = find_shown(record)
    if design is None:
        record.require_finished()
        raise EvorosError(f"{record.path}: the run is finished, so its missions are recorded")
    rows = (find_first_mission(record.run, design, name) for name in record.context.courses)
    first = {find_key(row): row for row in rows}
    flown = {
        key: ShownMission(first[key], trajectory, world, f"{record.name}/{key[2]}")
        for key, world, trajectory in replay_in_plane(record.run, list(first))
    }
    return read_shown(record, design, lambda _, row: flown[find_key(row)])


if __name__ == "__main__":
    sys.exit(main())
