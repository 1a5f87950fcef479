"""The trajectories of all missions, each a file, with the robots and the worlds of the missions.

A trajectory is written when its mission was run, and before its row in the table of missions.
"""

import csv
import io
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evoros.base.arrays import Array
from evoros.base.disk import make_folder, write_atomically
from evoros.base.errors import InputError
from evoros.mission.mission import Mission, MissionKey
from evoros.storage.tables import trajectory_table

if TYPE_CHECKING:  # reading must not load what runs missions
    from evoros.mission.scenario import Scenario

TRAJECTORIES = "trajectories"


def trajectory_file(key: MissionKey) -> Path:
    """Return the path of a mission's trajectory in the folder of its run.

    Sorted by their paths, trajectories are in the order of generation, design, world and trial.
    """
    generation, design, world, trial = key
    return Path(TRAJECTORIES, f"{generation:05d}", f"{design:06d}_{world}_{trial:04d}.csv")


def robot_file(design: int, agent: str = "") -> Path:
    """Return the path of the first robot, or of an agent, with the sensors of a design."""
    return Path(TRAJECTORIES, "robots", f"{design:06d}{agent and '_'}{agent}.urdf")


def loaded_robot_file(design: int, agent: str = "") -> Path:
    """Return the path of what engines load for a design, which is there if it differs."""
    robot = robot_file(design, agent)
    return robot.with_name(f"{robot.stem}_as_loaded.urdf")


def world_file(world: str, draws: str | None) -> Path:
    """Return the path of a world; ``draws`` is the key of the mission if each has its own."""
    name = world if draws is None else f"{world}_{draws.replace('/', '_')}"
    return Path(TRAJECTORIES, "worlds", f"{name}.sdf")


@dataclass(frozen=True)
class TrajectoryFiles:
    """The trajectories in the folder of a run or an evaluation."""

    path: Path  # the folder

    def has(self, mission: Mission) -> bool:
        """Whether the trajectory of the mission is there."""
        return (self.path / trajectory_file(mission.key)).is_file()

    def keep(self, scenario: "Scenario", mission: Mission, trajectory: Array) -> None:
        """Write the trajectory of a mission, and its robot and world unless they are there."""
        self._keep_robot(scenario, mission)
        self._keep_world(scenario, mission)
        table = trajectory_table(trajectory, scenario.name_columns(mission.design))
        self._write(trajectory_file(mission.key), table.encode())

    def read(self, mission: Mission) -> Array:
        """Read the trajectory of a mission, (rows, columns + channels).

        Raises:
            InputError: the file is missing or damaged.
        """
        path = self.path / trajectory_file(mission.key)
        try:
            header, *rows = csv.reader(io.StringIO(path.read_text()))
            values = [[float(cell) if cell else np.nan for cell in row] for row in rows]
            return np.array(values, dtype=np.float64).reshape(len(rows), len(header))
        except (OSError, ValueError) as error:
            raise InputError(
                f"{path}: cannot be read ({error}); delete it, and resuming runs its mission again"
            ) from error

    def _keep_robot(self, scenario: "Scenario", mission: Mission) -> None:
        place = robot_file(mission.design_id)
        if (self.path / place).exists():
            return
        with suppress(InputError):  # a part refuses the design, and the mission was not run
            team = scenario.equip(mission.design)
            for agent in reversed(team):  # the first robot last, because it shows that all are kept
                robot = team[agent].robot
                if robot.engine_urdf is not None:
                    loaded = loaded_robot_file(mission.design_id, agent)
                    self._write(loaded, robot.loaded_urdf.encode())
                self._write(robot_file(mission.design_id, agent), robot.urdf.encode())

    def _keep_world(self, scenario: "Scenario", mission: Mission) -> None:
        world = scenario.world[mission.world]
        place = world_file(mission.world, None if world.sampler is None else mission.draws)
        if (self.path / place).exists():
            return
        files = world.at(mission.draws).files(place.stem)
        for name in reversed(files):  # the SDF, which names the others, last
            self._write(place.with_name(name), files[name])

    def _write(self, place: Path, content: bytes) -> None:
        path = self.path / place
        make_folder(path.parent)
        write_atomically(path, content)
