"""The simulation that scenario_execution drives: one mission of evoros, step by step."""

import math
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from py_trees.blackboard import Blackboard
from scenario_execution.scenario_execution_base import ScenarioExecutionConfig
from scenario_execution.simulation import SimulationInterface

from evoros.base.errors import EvorosError, InputError, single_line
from evoros.failure.protocol import Failure
from evoros.failure.trigger import Trigger
from evoros.files.disk import write_atomically
from evoros.mission.compiled_loop import prepare
from evoros.mission.opened import OpenMission, open_mission
from evoros.openscenario.setting import Setting, build_failure, build_setting, split_words
from evoros.preflight.onsets import find_problem
from evoros.storage.tables import (
    MISSION_COLUMNS,
    list_further_in,
    mission_row,
    name_outcome_columns,
    to_csv,
    trajectory_table,
)

MISSION, TRAJECTORY = "mission.csv", "trajectory.csv"
"""The files that a scenario leaves in the folder of its output."""


class Simulation(SimulationInterface):  # type: ignore[misc]
    """A mission of evoros as scenario_execution's option ``--simulation`` wants it.

    Parameters of a scenario give the mission: ``overrides`` as behind ``evoros evaluate``,
    ``config_dir`` and ``trial``. Another time step is a subclass with another ``dt``.
    """

    dt = 0.5  # time between two ticks of the scenario [s]; a multiple of the mission's tick

    def __init__(self) -> None:
        self.command: tuple[float, float] | None = (
            None  # speed [m/s], steering [rad]; None: its own
        )
        self.problem = ""  # why the scenario cannot go on
        self._logger: Any = None
        self._stack = ExitStack()
        self._setting: Setting | None = None
        self._mission: OpenMission | None = None
        self._config_dir: str | None = None
        self._folder: str | None = None
        self._ticks = 1

    def setup(self, **kwargs: Any) -> None:
        """Keep the tool's logger."""
        self._logger = kwargs["logger"]

    def reset(self, overrides: str = "", config_dir: str = "", trial: int = 0) -> None:
        """Open the mission of the next scenario, and run it up to its time 0."""
        self._leave()
        self.command, self.problem, self._folder = None, "", None
        try:
            self._config_dir = config_dir or None
            words = split_words("overrides", overrides)
            setting = self._setting = build_setting(words, self._config_dir, int(trial))
            members = setting.scenario.equip(setting.mission.design)
            opened = open_mission(setting.scenario, members, setting.mission, prepare)
            self._mission = self._stack.enter_context(opened)
            self._ticks = self._count_ticks(self._mission.tick_s)
            self._mission.run(1)
        except EvorosError as error:
            self.stop(error)

    def _count_ticks(self, tick: float) -> int:
        count = round(self.dt / tick)
        if count < 1 or not math.isclose(count * tick, self.dt, rel_tol=1e-9):
            raise InputError(
                f"dt: must be a multiple of the mission's tick ({tick:g} s), not {self.dt:g} s; "
                f"pass a subclass of Simulation with another dt, or change the periods"
            )
        return count

    @property
    def mission(self) -> OpenMission:
        """The mission of the scenario, which must be open."""
        assert self._mission is not None
        return self._mission

    def step(self) -> None:
        """Run the mission for ``dt``; if it has ended, only the scenario's time goes on."""
        if self._folder is None:
            self._folder = ScenarioExecutionConfig().output_directory or ""
            for name in (MISSION, TRAJECTORY) if self._folder else ():
                Path(self._folder, name).unlink(missing_ok=True)  # of an earlier scenario
        if not self.problem:
            try:
                self._run()
            except EvorosError as error:
                self.stop(error)
        if self.problem:
            fail_scenario()

    def _run(self) -> None:
        if self.command is None:
            self.mission.run(self._ticks)
            return
        for _ in range(self._ticks):
            self.mission.command(*self.command)
            self.mission.run(1)

    def stop(self, error: EvorosError) -> None:
        """Report an error in one line; the scenario fails at the next step."""
        if not self.problem:
            self.problem = single_line(error)
            self._logger.error(self.problem)

    def build_failure(self, *overrides: str) -> Failure:
        """Build a failure model with the user's own parts.

        Raises:
            InputError: there is no such failure, or a value cannot be used.
        """
        return build_failure(overrides, self._config_dir)

    def check_event(self, trigger: Trigger) -> None:
        """Require that an event can come in the mission.

        Raises:
            InputError: the route or the world does not have it.
        """
        assert self._setting is not None
        mission = self._setting.mission
        problem = find_problem(trigger, self._setting.scenario.world[mission.world])
        if problem:
            raise InputError(f"failure.onset: must be {problem}; correct it")

    def shutdown(self) -> None:
        """Record the last mission and close it."""
        self._leave()

    def _leave(self) -> None:
        """Record the mission, unless it could not go on, and close it."""
        try:
            if self._folder and self._setting and self._mission and not self.problem:
                self._record(self._setting, self._mission, Path(self._folder))
        finally:
            self._mission = None
            self._stack.close()

    def _record(self, setting: Setting, mission: OpenMission, folder: Path) -> None:
        columns = setting.scenario.name_columns(setting.mission.design, setting.mission.world)
        write_atomically(folder / TRAJECTORY, trajectory_table(mission.trajectory, columns))
        further = list_further_in(setting.scenario, mission.fails_parts)
        header = [*MISSION_COLUMNS, *name_outcome_columns(setting.agents, further)]
        row = mission_row(setting.mission, mission.outcomes(), further=further)
        write_atomically(folder / MISSION, to_csv([header, row]))


def fail_scenario() -> None:
    """Set the event ``fail`` of the scenario that runs, by the name that the tool gives it."""
    for key in list(Blackboard.storage):
        if key.endswith("/fail"):
            Blackboard.set(key, True)
