"""The files of the champion of a run, and of all designs of a search that finds several."""

from collections.abc import Mapping

from evoros.base.arrays import Array
from evoros.evolution.journal import Champion, Champions
from evoros.robot.model import Robot
from evoros.robot.self_sight import find_self_sights
from evoros.storage.design_files import design_table, gene_table, score_table
from evoros.storage.layout import ROBOT_AS_LOADED, SELF_SIGHT
from evoros.storage.tables import to_csv, trajectory_table

CHAMPION = "champion"
CHAMPIONS = "champions"  # of a search that finds several
ROBOT = "robot.urdf"  # as it was described
SELF_SIGHT_COLUMNS = ("sensor", "seen_link", "distance_m", "hidden_share")


def champion_files(champion: Champion) -> dict[str, bytes]:
    """Return the files without trajectories: content by name, ``design.csv`` last."""
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
    """Return the name of the champion's trajectory in a world."""
    return f"{CHAMPION}/trajectory_{world}.csv"


def track_files(champion: Champion, trajectories: Mapping[str, Array]) -> dict[str, bytes]:
    """Return the files of trajectories, which are given by world."""
    return {
        track_file(world): trajectory_table(trajectory, champion.columns[world]).encode()
        for world, trajectory in trajectories.items()
    }


def champions_files(champions: Champions) -> dict[str, bytes]:
    """Return the tables of several designs."""
    scores = dict(zip(champions.designs, champions.scores, strict=True))
    tables = {
        "scores.csv": score_table(scores),
        "genes.csv": gene_table(champions.designs, champions.gene_names),
        "design.csv": design_table(champions.designs),
    }
    return {f"{CHAMPIONS}/{name}": text.encode() for name, text in tables.items()}


def self_sight_table(robot: Robot) -> str:
    """Return the text of ``self_sight.csv``, a row for each sensor that sees its own robot."""
    rows = [
        [sight.name, sight.link, sight.distance_m, sight.hidden_share]
        for sight in find_self_sights(robot)
    ]
    return to_csv([SELF_SIGHT_COLUMNS, *rows])
