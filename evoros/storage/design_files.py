"""Converts designs to CSV text, as ``docs/run_folder.md`` documents it."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

from evoros.design.design import Design
from evoros.storage.tables import AGENT, to_csv

POSE_COLUMNS = ("x_m", "y_m", "z_m", "yaw_deg", "pitch_deg")
DESIGN_COLUMNS = ("design", "sensor", "type", "link", *POSE_COLUMNS)
GENE_COLUMNS = ("design", "gene", "key", "value")


def design_table(designs: Mapping[int, Design]) -> str:
    """Return the text of ``design.csv``, a row for each sensor of each design.

    If several robots have designs of their own, the last column has the name of the robot.
    """
    rows = [[name, *row] for name, design in designs.items() for row in sensor_rows(design)]
    return table_by_robot(DESIGN_COLUMNS, rows, designs.values())


def sensor_rows(design: Design) -> Iterator[list[object]]:
    """Yield the cells of a design's sensors that follow its name, and the robot's name last.

    A robot without sensors has one row, whose other cells are empty.
    """
    for robot, part in design.parts.items():
        for index, mount in enumerate(part.mounts):
            pose = (getattr(mount, name) for name in POSE_COLUMNS)
            yield [index, mount.sensor, mount.link, *pose, robot]
        if not part.mounts:
            yield [*(None for _ in DESIGN_COLUMNS[1:]), robot]


def table_by_robot(
    columns: Sequence[str], rows: Sequence[Sequence[object]], designs: Iterable[Design]
) -> str:
    """Return the text of a table of designs; the last cell of each row is the name of the robot.

    The table has it only if there are several robots with a design of their own.
    """
    if any(len(design.parts) > 1 for design in designs):
        return to_csv([(*columns, AGENT), *rows])
    return to_csv([columns, *(row[:-1] for row in rows)])


def gene_table(designs: Mapping[int, Design], names: Mapping[str, Mapping[str, str]]) -> str:
    """Return the text of ``genes.csv``, a row for each evolved value of designs that is no mount.

    ``names`` maps the keys of each robot's values to the names of their genes. The robots are named
    as in ``design_table``.
    """
    rows = [
        [individual, names[robot][key], key, value, robot]
        for individual, design in designs.items()
        for robot, part in design.parts.items()
        for key, value in part.values.items()
    ]
    return table_by_robot(GENE_COLUMNS, rows, designs.values())


def score_table(scores: Mapping[int, Mapping[str, float]]) -> str:
    """Return the text of ``scores.csv``, a row for each design."""
    columns = list(next(iter(scores.values()), {}))
    return to_csv([("id", *columns), *([key, *row.values()] for key, row in scores.items())])
