"""Computes parts of a recorded run again from its folder: designs and single missions."""

from pathlib import Path

import pandas as pd

from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.evolution.measuring import read_score
from evoros.failure.case import Case
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import Outcomes
from evoros.mission.rollout import run_mission
from evoros.session.run import rebuild_experiment
from evoros.storage.reading import Run, load_run
from evoros.storage.tables import CASE


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
    run = load_run(folder)
    rows = run.missions.set_index(["generation", "design", "world", "trial"])
    generation, design, world, trial = key
    if key not in rows.index:
        raise InputError(
            f"{folder}: must have a mission of design {design} in {world}, generation "
            f"{generation}, trial {trial}, and has none; take the values from missions.csv"
        )
    experiment = rebuild_experiment(run.path, config_dir)
    row = rows.loc[[key]].iloc[0]
    purpose, draws, case = str(row["purpose"]), str(row["draws"]), row.get(CASE)
    stated = Case.parse(case) if isinstance(case, str) else None
    decoded = replay_designs(run, experiment)[design]
    mission = Mission(generation, design, decoded, world, trial, purpose, draws, stated)
    scenario = experiment.scenario_for(purpose)
    outcomes, trajectory = run_mission(scenario, mission)
    return outcomes, pd.DataFrame(trajectory, columns=scenario.name_columns(decoded))


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
