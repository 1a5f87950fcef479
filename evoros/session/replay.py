"""Computes parts of recorded folders again: the designs of a run, and single missions."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.evolution.measuring import read_score
from evoros.files.disk import write_atomically
from evoros.files.resources import expand_home
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import Outcomes
from evoros.mission.rollout import run_mission
from evoros.mission.scenario import Scenario
from evoros.session.design_tables import read_recorded_designs
from evoros.session.recorded_rows import Row, plan_row, read_case, read_rows
from evoros.session.resume import rebuild
from evoros.session.run import rebuild_experiment
from evoros.simulator.planar import Planar
from evoros.storage.layout import EVALUATE, MISSIONS, command_of
from evoros.storage.reading import Run, load_run
from evoros.storage.tables import read_outcomes, trajectory_table
from evoros.storage.verification import verify_folder
from evoros.world.model import World

KEY = ("generation", "design", "world", "trial")


class Replayed(NamedTuple):
    """A recorded mission that was run again."""

    recorded: Outcomes
    outcomes: Outcomes
    trajectory: pd.DataFrame  # with the columns of ``champion/trajectory_WORLD.csv``
    agents: Sequence[str]


def replay(
    folder: str | Path, key: MissionKey, *, config_dir: str | Path | None = None
) -> tuple[Outcomes, pd.DataFrame]:
    """Run one recorded mission of a run again in this process. Its result is the same.

    ``key`` has the generation, design, world and trial of its row in ``missions.csv``. Returns the
    outcome of each robot, and the trajectory with the columns of
    ``champion/trajectory_WORLD.csv``. This builds the run's experiment, so it runs the code that
    its configuration names; ``config_dir`` is the folder of your own parts, as when the run was
    started.

    Raises:
        InputError: no such run or mission, or the run was made by another version.
    """
    columns = dict(zip(KEY, map(str, key), strict=True))
    replayed = replay_row(folder, columns, config_dir)
    return replayed.outcomes, replayed.trajectory


def replay_row(
    folder: str | Path, columns: Mapping[str, str], config_dir: str | Path | None = None
) -> Replayed:
    """Run the mission of a run or an evaluation again whose row alone has these ``columns``.

    Raises:
        InputError: there is no such folder, or not one such row; or see ``replay``.
    """
    path = expand_home(folder)
    if command_of(path) == EVALUATE:
        verify_folder(path)
        row = _find_row(path, columns)
        mission, scenario, agents = _plan_of_evaluation(path, row, config_dir)
    else:
        run = load_run(path)
        row = _find_row(path, columns)
        experiment = rebuild_experiment(run.path, config_dir)
        mission, scenario = _plan_of_run(replay_designs(run, experiment), experiment, row)
        agents = list(experiment.agents)
    outcomes, frame = _run(scenario, mission)
    return Replayed(read_outcomes(row, agents), outcomes, frame, agents)


def replay_in_plane(
    run: Run, keys: Sequence[MissionKey]
) -> Iterator[tuple[MissionKey, World, pd.DataFrame]]:
    """Run some recorded missions again, which cost little: yield their worlds and trajectories.

    Raises:
        InputError: an engine or a live controller would take long; or see ``replay``.
    """
    experiment = rebuild_experiment(run.path)
    for scenario in (experiment.scenario, experiment.confirming):
        if not isinstance(scenario.simulator, Planar) or scenario.is_live:
            raise InputError(f"{run.path}: must be in the plane, without live controllers")
    designs = replay_designs(run, experiment)
    for key in keys:
        columns = dict(zip(KEY, map(str, key), strict=True))
        mission, scenario = _plan_of_run(designs, experiment, _find_row(run.path, columns))
        world = scenario.world[mission.world].at(mission.draws)
        yield key, world, _run(scenario, mission)[1]


def _run(scenario: Scenario, mission: Mission) -> tuple[Outcomes, pd.DataFrame]:
    outcomes, trajectory = run_mission(scenario, mission)
    columns = scenario.name_columns(mission.design, mission.world)
    return outcomes, pd.DataFrame(trajectory, columns=columns)


def write_trajectory(file: Path, trajectory: pd.DataFrame) -> None:
    """Write a trajectory as the run folder has those that it keeps.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        write_atomically(file, trajectory_table(trajectory.to_numpy(), list(trajectory.columns)))
    except OSError as error:
        raise InputError(f"{file}: cannot be written ({error.strerror}); choose another") from error


def _find_row(path: Path, columns: Mapping[str, str]) -> Row:
    """Find the only row of the table of missions that has these values."""
    rows = read_rows(path)
    known = list(rows[0]) if rows else []
    unknown = [name for name in columns if name not in known]
    found = [row for row in rows if all(row.get(name) == text for name, text in columns.items())]
    typed = " with " * bool(columns) + " ".join(f"{name}={text}" for name, text in columns.items())
    if unknown or not found:
        wrong = f"has no column {unknown[0]}" if rows and unknown else "has none"
        raise InputError(
            f"{path / MISSIONS}: must have a mission{typed}, and {wrong}; take the values "
            f"from missions.csv"
        )
    if len(found) > 1:
        differing = [name for name in known if len({row[name] for row in found}) > 1]
        raise InputError(
            f"{path / MISSIONS}: must have one mission{typed}, and has "
            f"{len(found)}; add {differing[0]}=..."
        )
    return found[0]


def _plan_of_run(
    designs: Mapping[int, Design], experiment: Experiment, row: Row
) -> tuple[Mission, Scenario]:
    design = designs[int(row["design"])]
    key = (int(row["generation"]), int(row["design"]), design, row["world"], int(row["trial"]))
    mission = Mission(*key, row["purpose"], row["draws"], read_case(row))
    return mission, experiment.scenario_for(row["purpose"])


def _plan_of_evaluation(
    path: Path, row: Row, config_dir: str | Path | None
) -> tuple[Mission, Scenario, list[str]]:
    experiment = rebuild(path, (), config_dir, EVALUATE).experiment
    mission, scenario = plan_row(experiment, read_recorded_designs(path, experiment), row)
    return mission, scenario, list(experiment.agents)


def replay_designs(run: Run, experiment: Experiment) -> dict[int, Design]:
    """Return every design that the run has proposed so far, by its id.

    The optimizer proposes them again, because it is told the recorded scores.
    """
    space = experiment.space
    search = experiment.start_search()
    designs = {individual.id: space.decode(individual.genome) for individual in search.ask()}
    if run.generations.empty:
        return designs
    for _, table in run.generations.groupby("generation"):
        rows = table.drop_duplicates("id").to_dict("records")
        told = [{str(name): value for name, value in row.items()} for row in rows]
        search.tell({row["id"]: read_score(experiment, row) for row in told})
        designs |= {individual.id: space.decode(individual.genome) for individual in search.ask()}
    return designs
