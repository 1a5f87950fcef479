"""Trajectory files, written before the row of their mission, and files of robots and worlds."""

import csv
import io
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.mission.mission import Mission, MissionKey
from evoros.storage.digests import DigestLog
from evoros.storage.layout import TRAJECTORIES, read_bytes
from evoros.storage.tables import trajectory_table

if TYPE_CHECKING:  # reading must not import the code of missions
    from evoros.mission.scenario import Scenario

ROBOTS, WORLDS = f"{TRAJECTORIES}/robots/", f"{TRAJECTORIES}/worlds/"

_PARTS = {"robots": r"_.*$", "worlds": r"_\d+$"}  # suffix pattern of file names in each folder


def trajectory_file(key: MissionKey) -> Path:
    """Return the path of a mission's trajectory; paths sort like the keys of missions."""
    generation, design, world, trial = key
    return Path(TRAJECTORIES, f"{generation:05d}", f"{design:06d}_{world}_{trial:04d}.csv")


def robot_file(design: int, agent: str = "") -> Path:
    """Return the path of the URDF of the first robot, or an agent, with a design's sensors."""
    return Path(ROBOTS, f"{design:06d}{agent and '_'}{agent}.urdf")


def loaded_robot_file(design: int, agent: str = "") -> Path:
    """Return the path of a design's URDF for engines, stored only if unlike ``robot_file``."""
    robot = robot_file(design, agent)
    return robot.with_name(f"{robot.stem}_as_loaded.urdf")


def world_file(world: str, draws: str | None) -> Path:
    """Return a world's path; ``draws`` is the mission's key of draws if the world is random."""
    name = world if draws is None else f"{world}_{draws.replace('/', '_')}"
    return Path(WORLDS, f"{name}.sdf")


@dataclass
class TrajectoryFiles:
    """The trajectories in a folder; ``write`` receives name, content, and whether to hash lines."""

    folder: Path
    digests: DigestLog
    write: Callable[[str, bytes, bool], None]
    _whole: set[str] = field(default_factory=set)  # names of verified trajectories

    def has(self, mission: Mission) -> bool:
        """Return True if the trajectory, robot and world of a mission are undamaged."""
        name = str(trajectory_file(mission.key))
        if self._lost and not self._lost.isdisjoint(_list_needs(mission)):
            return False
        if name not in self._whole and self._is_whole(name):
            self._whole.add(name)
        return name in self._whole

    @cached_property
    def _lost(self) -> set[str]:
        # name prefixes of robots and worlds with a missing or damaged file
        folders = (self.folder / ROBOTS, self.folder / WORLDS)
        files = (file for folder in folders for file in folder.glob("[!.]*"))
        names = {str(file.relative_to(self.folder)) for file in files}
        names |= {n for n in self.digests.entries if n.startswith((ROBOTS, WORLDS))}
        worlds = [name.removesuffix(".sdf") for name in names if name.startswith(WORLDS)]
        lost = [name for name in names if not self._is_whole(name)]
        matches = (re.match(rf"{ROBOTS}\d+", name) for name in lost)
        robots = {match[0] for match in matches if match}
        return robots.union(world for world in worlds for name in lost if name.startswith(world))

    def retain(self, missions: Sequence[Mission]) -> None:
        """Delete the trajectories, robots and worlds of all other missions."""
        needed = {str(trajectory_file(mission.key).with_suffix("")) for mission in missions}
        needed |= {name for mission in missions for name in _list_needs(mission)}
        folder = self.folder / TRAJECTORIES
        for file in [file for file in folder.rglob("*") if file.is_file()]:
            place = file.relative_to(self.folder)
            owner = re.sub(_PARTS.get(place.parent.name, "$"), "", str(place.with_suffix("")))
            if needed.isdisjoint((owner, str(place.with_suffix("")))):
                self.digests.reopen([str(place)])
                file.unlink()

    def _is_whole(self, name: str) -> bool:
        path = self.folder / name
        return path.is_file() and self.digests.is_whole(name, read_bytes(path))

    def keep(self, scenario: "Scenario", mission: Mission, trajectory: Array) -> None:
        """Write a mission's trajectory, and its robot and world unless already written."""
        self._keep_robot(scenario, mission)
        self._keep_world(scenario, mission)
        columns = scenario.name_columns(mission.design, mission.world)
        table = trajectory_table(trajectory, columns)
        self._write(trajectory_file(mission.key), table.encode())

    def read(self, mission: Mission) -> Array:
        """Read a mission's trajectory (rows, columns)."""
        path = self.folder / trajectory_file(mission.key)
        try:
            header, *rows = csv.reader(io.StringIO(read_bytes(path).decode()))
            values = [[float(cell) if cell else np.nan for cell in row] for row in rows]
            return np.array(values, dtype=np.float64).reshape(len(rows), len(header))
        except (OSError, ValueError) as error:
            raise InputError(
                f"{path}: cannot be read ({error}); delete the file and resume the run, which "
                "reruns the mission"
            ) from error

    def _keep_robot(self, scenario: "Scenario", mission: Mission) -> None:
        place = robot_file(mission.design_id)
        if self._is_kept(place, _name_robot(mission.design_id)):
            return
        with suppress(InputError):  # missions of rejected designs were not run
            # The first robot is written last, because its file marks all files as written.
            for member in reversed(scenario.equip(mission.design)):
                robot = member.robot
                if robot.engine_urdf is not None:
                    loaded = loaded_robot_file(mission.design_id, member.name)
                    self._write(loaded, robot.loaded_urdf.encode())
                self._write(robot_file(mission.design_id, member.name), robot.urdf.encode())
            self._lost.discard(_name_robot(mission.design_id))

    def _keep_world(self, scenario: "Scenario", mission: Mission) -> None:
        world = scenario.world[mission.world]
        place = world_file(mission.world, None if world.sampler is None else mission.draws)
        if self._is_kept(place, str(place.with_suffix(""))):
            return
        files = world.at(mission.draws).files(place.stem)
        for name in reversed(files):  # the SDF, which refers to all other files, comes last
            self._write(place.with_name(name), files[name])
        self._lost.discard(str(place.with_suffix("")))

    def _is_kept(self, place: Path, begin: str) -> bool:
        return str(place) in self.digests.entries and begin not in self._lost

    def _write(self, place: Path, content: bytes) -> None:
        self.write(str(place), content, False)


def _name_robot(design: int) -> str:
    return f"{ROBOTS}{design:06d}"


def _list_needs(mission: Mission) -> list[str]:
    worlds = (world_file(mission.world, draws) for draws in (None, mission.draws))
    return [_name_robot(mission.design_id), *(str(world.with_suffix("")) for world in worlds)]
