"""Tables of designs, and the files of a run's champions (``docs/run_folder.md``)."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

from evoros.base.arrays import Array
from evoros.design.design import Design
from evoros.evolution.journal import Champion, Champions
from evoros.robot.model import Robot
from evoros.robot.self_sight import find_self_sights
from evoros.storage.layout import ROBOT_AS_LOADED, SELF_SIGHT
from evoros.storage.tables import AGENT, to_csv, trajectory_table

_POSE_COLUMNS = ("x_m", "y_m", "z_m", "yaw_deg", "pitch_deg")
DESIGN_COLUMNS = ("design", "sensor", "type", "link", *_POSE_COLUMNS)
GENE_COLUMNS = ("design", "gene", "key", "value")
CHAMPION = "champion"
CHAMPIONS = "champions"  # folder for the champions of a search that returns several
ROBOT = "robot.urdf"  # original description
SELF_SIGHT_COLUMNS = ("sensor", "seen_link", "distance_m", "hidden_share")


def champion_files(champion: Champion) -> dict[str, bytes]:
    """Return the champion's files by name, except trajectories; ``design.csv`` comes last."""
    genes = gene_table({champion.id: champion.design}, champion.gene_names)
    files = {"certificate.json": champion.certificate.text.encode(), "genes.csv": genes.encode()}
    for robot_name, robot in champion.robots.items():
        folder = f"agents/{robot_name}/" if robot_name else ""
        files[folder + ROBOT] = robot.urdf.encode()
        files[folder + SELF_SIGHT] = self_sight_table(robot).encode()
        if robot.engine_urdf is not None:
            files[folder + ROBOT_AS_LOADED] = robot.loaded_urdf.encode()
    for name, world in champion.worlds.items():
        files |= world.files(f"world_{name}")
    files["design.csv"] = design_table({champion.id: champion.design}).encode()
    return {f"{CHAMPION}/{name}": content for name, content in files.items()}


def track_file(world: str) -> str:
    """Return the file name of the champion's trajectory in a world."""
    return f"{CHAMPION}/trajectory_{world}.csv"


def track_files(champion: Champion, trajectories: Mapping[str, Array]) -> dict[str, bytes]:
    """Return a trajectory file for each world in ``trajectories``, by name."""
    return {
        track_file(world): trajectory_table(trajectory, champion.columns[world]).encode()
        for world, trajectory in trajectories.items()
    }


def champions_files(champions: Champions) -> dict[str, bytes]:
    """Return the tables of several champions, by file name."""
    rows = [
        (key, *row.values()) for key, row in zip(champions.designs, champions.scores, strict=True)
    ]
    tables = {
        "scores.csv": to_csv([("id", *(champions.scores or [{}])[0]), *rows]),
        "genes.csv": gene_table(champions.designs, champions.gene_names),
        "design.csv": design_table(champions.designs),
    }
    return {f"{CHAMPIONS}/{name}": text.encode() for name, text in tables.items()}


def self_sight_table(robot: Robot) -> str:
    """Return ``self_sight.csv``, with a row for each sensor that sees the robot itself."""
    rows = [
        [sight.name, sight.link, sight.distance_m, sight.hidden_share]
        for sight in find_self_sights(robot)
    ]
    return to_csv([SELF_SIGHT_COLUMNS, *rows])


def design_table(designs: Mapping[int, Design]) -> str:
    """Return ``design.csv``, with a row for each sensor of each design."""
    rows = [[name, *row] for name, design in designs.items() for row in sensor_rows(design)]
    return table_by_robot(DESIGN_COLUMNS, rows, designs.values())


def sensor_rows(design: Design) -> Iterator[list[object]]:
    """Yield the cells of each sensor, from its number to the robot's name."""
    for robot, part in design.parts.items():
        for index, mount in enumerate(part.mounts):
            pose = (getattr(mount, name) for name in _POSE_COLUMNS)
            yield [index, mount.sensor, mount.link, *pose, robot]
        if not part.mounts:
            yield [*(None for _ in DESIGN_COLUMNS[1:]), robot]


def table_by_robot(
    columns: Sequence[str], rows: Sequence[Sequence[object]], designs: Iterable[Design]
) -> str:
    """Return a table of designs; drop the last cell, the robot, if there is only one robot."""
    if any(len(design.parts) > 1 for design in designs):
        return to_csv([(*columns, AGENT), *rows])
    return to_csv([columns, *(row[:-1] for row in rows)])


def gene_table(designs: Mapping[int, Design], names: Mapping[str, Mapping[str, str]]) -> str:
    """Return ``genes.csv`` for the evolved values; ``names`` maps robot and key to gene name."""
    rows = [
        [individual, names[robot][key], key, value, robot]
        for individual, design in designs.items()
        for robot, part in design.parts.items()
        for key, value in part.values.items()
    ]
    return table_by_robot(GENE_COLUMNS, rows, designs.values())
