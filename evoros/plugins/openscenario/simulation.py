"""The simulation for scenario_execution: a mission of evoros, advanced step by step."""

import math
import shlex
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from py_trees.blackboard import Blackboard
from scenario_execution.scenario_execution_base import ScenarioExecutionConfig
from scenario_execution.simulation import SimulationInterface

from evoros.base.errors import EvorosError, InputError, single_line
from evoros.config.jobs import Job, Jobs
from evoros.config.like import EVALUATE
from evoros.evolution.experiment import Experiment
from evoros.failure.protocol import Failure, Trigger
from evoros.files.disk import write_atomically
from evoros.mission.mission import Mission
from evoros.mission.rollout import OpenMission, open_mission
from evoros.mission.scenario import Scenario
from evoros.preflight.scene import find_problem
from evoros.session.evaluation import read_sources
from evoros.session.given_designs import read_like
from evoros.storage import tables

MISSION, TRAJECTORY = "mission.csv", "trajectory.csv"  # files in a scenario's output folder


@dataclass(frozen=True)
class Setting:
    """The inputs of a scenario's mission."""

    scenario: Scenario
    mission: Mission
    agents: Sequence[str]


@cache
def build_setting(overrides: tuple[str, ...], config_dir: str | None, trial: int) -> Setting:
    """Build the mission that ``evoros evaluate`` would run for a trial with the same overrides."""
    experiment, designs = _build(overrides, config_dir)
    if designs is None and not experiment.space.size:
        design = experiment.space.decode(np.empty(0))
    else:
        named = read_sources(designs, experiment)
        if len(named) != 1:
            raise InputError(f"designs: must be a single design, not {len(named)}; select one")
        design = named[0].design
    if len(experiment.world) != 1:
        raise InputError(
            f"world: must be a single world, not {', '.join(experiment.world)}; choose one, as in "
            f"world=maze"
        )
    missions = experiment.plan.evaluation(0, 0, design)
    if not 0 <= trial < len(missions):
        raise InputError(
            f"trial: must be from 0 to {len(missions) - 1}, not {trial}; lower trial, or raise "
            "trials"
        )
    scenario = experiment.scenario_for(experiment.evaluation_draws)
    return Setting(scenario, missions[trial], list(experiment.agents))


@cache
def build_failure(overrides: tuple[str, ...], config_dir: str | None) -> Failure:
    """Build the failure model that the overrides select."""
    return _build(overrides, config_dir)[0].failure


def _build(overrides: tuple[str, ...], config_dir: str | None) -> tuple[Experiment, object]:
    jobs = Jobs(overrides, False, config_dir, EVALUATE, read_like)
    (job,) = (job for job in jobs if isinstance(job, Job))
    return job.config.build(), job.config.designs


def split_words(key: str, text: str) -> tuple[str, ...]:
    """Split a parameter into words as a shell would."""
    try:
        return tuple(shlex.split(text))
    except ValueError as error:
        raise InputError(f"{key}: {error} in {text!r}; close the quote") from None


class Simulation(SimulationInterface):  # type: ignore[misc]
    """A mission of evoros for the option ``--simulation`` of scenario_execution.

    The scenario parameters are ``overrides`` for ``evoros evaluate``, ``config_dir`` and ``trial``.
    """

    dt = 0.5  # time [s] between scenario ticks, a multiple of the mission's tick

    def __init__(self) -> None:
        # Speed [m/s] and steering [rad] set by an action; None while the controller drives.
        self.command: tuple[float, float] | None = None
        self.problem = ""  # why the scenario cannot continue
        self._logger: Any = None
        self._stack = ExitStack()
        self._setting: Setting | None = None
        self._mission: OpenMission | None = None
        self._config_dir: str | None = None
        self._folder: str | None = None
        self._ticks = 1

    def setup(self, **kwargs: Any) -> None:
        """Store the logger of scenario_execution."""
        self._logger = kwargs["logger"]

    def reset(self, overrides: str = "", config_dir: str = "", trial: int = 0) -> None:
        """Open the mission of the next scenario, and run its first tick at time 0."""
        self.shutdown()
        self.command, self.problem, self._folder = None, "", None
        try:
            self._config_dir = config_dir or None
            words = split_words("overrides", overrides)
            setting = self._setting = build_setting(words, self._config_dir, int(trial))
            opened = open_mission(setting.scenario, setting.mission)
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
        """The open mission of the scenario."""
        assert self._mission is not None
        return self._mission

    def step(self) -> None:
        """Advance the mission by ``dt``; after its end, only the scenario's time advances."""
        if self._folder is None:
            self._folder = ScenarioExecutionConfig().output_directory or ""
            for name in (MISSION, TRAJECTORY) if self._folder else ():
                Path(self._folder, name).unlink(missing_ok=True)  # left by an earlier scenario
        if not self.problem:
            try:
                self._run()
            except EvorosError as error:
                self.stop(error)
        if self.problem:
            for key in list(Blackboard.storage):
                if key.endswith("/fail"):  # name of a scenario's failure event
                    Blackboard.set(key, True)

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
        """Build a failure model, which may contain the user's parts."""
        return build_failure(overrides, self._config_dir)

    def check_event(self, trigger: Trigger) -> None:
        """Check that the trigger of a fault can occur in the mission."""
        assert self._setting is not None
        mission = self._setting.mission
        problem = find_problem(trigger, self._setting.scenario.world[mission.world])
        if problem:
            raise InputError(f"failure.onset: must be {problem}")

    def shutdown(self) -> None:
        """Record and close the last mission."""
        try:
            if self._folder and self._setting and self._mission and not self.problem:
                self._record(self._setting, self._mission, Path(self._folder))
        finally:
            self._mission = None
            self._stack.close()

    def _record(self, setting: Setting, mission: OpenMission, folder: Path) -> None:
        columns = setting.scenario.name_columns(setting.mission.design, setting.mission.world)
        write_atomically(folder / TRAJECTORY, tables.trajectory_table(mission.trajectory, columns))
        further = tables.list_further_in(setting.scenario, mission.fails_parts)
        header = [*tables.MISSION_COLUMNS, *tables.name_outcome_columns(setting.agents, further)]
        row = tables.mission_row(setting.mission, mission.outcomes(), further=further)
        write_atomically(folder / MISSION, tables.to_csv([header, row]))
