"""What a recorded run did, computed again from its folder: designs and single missions."""

from pathlib import Path

import pandas as pd

from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcome
from evoros.mission.rollout import run_mission
from evoros.session import run as session
from evoros.storage.reading import Run, load_run
from evoros.storage.tables import trajectory_columns


def replay(
    folder: str | Path,
    generation: int,
    design: int,
    world: str,
    trial: int,
    config_dir: str | Path | None = None,
) -> tuple[Outcome, pd.DataFrame]:
    """Fly one recorded mission of a run again, in this process; its result is the same.

    The four numbers and names are those of its row in ``missions.csv``. Returns its outcome and
    its trajectory, with the columns of ``champion/trajectory_WORLD.csv``. This builds the run's
    experiment, so it runs the code that its configuration names; ``config_dir`` is the folder of
    your own parts, as with ``compose`` when the run was started.

    Raises:
        InputError: no such run or mission, or the run was made by another version.
    """
    run = load_run(folder)
    rows = run.missions.set_index(["generation", "design", "world", "trial"])
    place = (generation, design, world, trial)
    if place not in rows.index:
        raise InputError(
            f"{folder}: must have a mission of design {design} in {world}, generation "
            f"{generation}, trial {trial}, and has none; take the values from missions.csv"
        )
    experiment = session.rebuild_experiment(run.path, config_dir)
    row = rows.loc[[place]].iloc[0]
    flown = replay_designs(run, experiment)[design]
    purpose, draws = str(row["purpose"]), str(row["draws"])
    mission = Mission(generation, design, flown, world, trial, purpose, draws)
    outcome, track = run_mission(experiment.scenario_for(purpose), mission)
    return outcome, pd.DataFrame(track, columns=trajectory_columns(track))


def replay_designs(run: Run, experiment: Experiment) -> dict[int, Design]:
    """Every design that the run has proposed so far, by its id.

    The optimizer proposes them again, told the fitness that the tables have.
    """
    search = experiment.start_search()
    found = {one.id: experiment.space.decode(one.genome) for one in search.ask()}
    if run.generations.empty:
        return found
    for _, table in run.generations.groupby("generation"):
        fitness = table.drop_duplicates("id").set_index("id").fitness
        search.tell([float(fitness[one.id]) for one in search.ask()])
        found |= {one.id: experiment.space.decode(one.genome) for one in search.ask()}
    return found
