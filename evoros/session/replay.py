"""Recomputes the designs of a run, and reruns single recorded missions."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.evolution.trials import read_score
from evoros.files.disk import write_atomically
from evoros.files.resources import expand_home
from evoros.mission.mission import Mission, MissionKey, Outcomes
from evoros.mission.rollout import run_mission
from evoros.mission.scenario import Scenario
from evoros.session.design_tables import read_recorded_designs
from evoros.session.design_trials import GENERATION
from evoros.session.rebuilding import plan_row, rebuild
from evoros.simulator.planar import Planar
from evoros.storage import layout
from evoros.storage.layout import read_rows
from evoros.storage.reading import Run, load_run
from evoros.storage.tables import read_key, read_outcomes, trajectory_table
from evoros.storage.verdicts import Row
from evoros.world.model import World

KEY = ("generation", "design", "world", "trial")


class Replayed(NamedTuple):
    """A recorded mission that has been run again."""

    recorded: Outcomes
    outcomes: Outcomes
    trajectory: pd.DataFrame  # columns of ``champion/trajectory_WORLD.csv``
    agents: Sequence[str]


def replay(
    folder: str | Path, key: MissionKey, *, config_dir: str | Path | None = None
) -> tuple[Outcomes, pd.DataFrame]:
    """Rerun one recorded mission of a run in this process, with identical results.

    ``key`` holds the generation, design, world and trial from the mission's row in
    ``missions.csv``. Returns the outcome of each robot, and the trajectory with the columns of
    ``champion/trajectory_WORLD.csv``. This executes the code that the run's configuration names;
    ``config_dir`` is the folder that holds your own parts, as at the start of the run.

    Raises:
        InputError: the run or mission was not found, or the run's version differs.
    """
    columns = dict(zip(KEY, map(str, key), strict=True))
    replayed = replay_row(folder, columns, config_dir)
    return replayed.outcomes, replayed.trajectory


def replay_row(
    folder: str | Path, columns: Mapping[str, str], config_dir: str | Path | None = None
) -> Replayed:
    """Rerun the only recorded mission that has the values ``columns``."""
    run = load_run(expand_home(folder))
    row = _find_row(run.path, columns)
    experiment = rebuild(run.path, (), config_dir).experiment
    if run.evaluates:
        given = read_recorded_designs(run.path, experiment)
        names = [(named.source, named.name) for named in given]
        design = names.index((row["source"], row["design"]))
        designs = {index: named.design for index, named in enumerate(given)}
        key = GENERATION, design, row["world"], int(row["trial"])
    else:
        designs, key = replay_designs(run, experiment), read_key(row)
    agents = list(experiment.agents)
    outcomes, frame = _run(*plan_row(experiment, designs, key, row))
    return Replayed(read_outcomes(row, agents), outcomes, frame, agents)


def replay_in_plane(
    run: Run, keys: Sequence[MissionKey]
) -> Iterator[tuple[MissionKey, World, pd.DataFrame]]:
    """Rerun recorded missions in the planar simulator; yield each with its world and trajectory."""
    experiment = rebuild(run.path, ()).experiment
    for scenario in (experiment.scenario, experiment.confirming):
        if not isinstance(scenario.simulator, Planar) or scenario.is_live:
            raise InputError(
                f"{run.path}: the run uses a physics engine or a live controller; choose a run "
                "with simulator=planar"
            )
    designs = replay_designs(run, experiment)
    for key in keys:
        columns = dict(zip(KEY, map(str, key), strict=True))
        mission, scenario = plan_row(experiment, designs, key, _find_row(run.path, columns))
        world = scenario.world[mission.world].at(mission.draws)
        yield key, world, _run(mission, scenario)[1]


def _run(mission: Mission, scenario: Scenario) -> tuple[Outcomes, pd.DataFrame]:
    outcomes, trajectory = run_mission(scenario, mission)
    columns = scenario.name_columns(mission.design, mission.world)
    return outcomes, pd.DataFrame(trajectory, columns=columns)


def write_trajectory(file: Path, trajectory: pd.DataFrame) -> None:
    """Write a trajectory as CSV in the format of the run folder."""
    try:
        write_atomically(file, trajectory_table(trajectory.to_numpy(), list(trajectory.columns)))
    except OSError as error:
        raise InputError(
            f"{file}: cannot be written ({error.strerror}); choose another file"
        ) from error


def _find_row(path: Path, columns: Mapping[str, str]) -> Row:
    rows = read_rows(path / layout.MISSIONS)
    known = list(rows[0]) if rows else []
    unknown = [name for name in columns if name not in known]
    found = [row for row in rows if all(row.get(name) == text for name, text in columns.items())]
    typed = " with " * bool(columns) + " ".join(f"{name}={text}" for name, text in columns.items())
    if unknown or not found:
        wrong = f"column {unknown[0]}" if rows and unknown else f"mission{typed}"
        raise InputError(f"{path / layout.MISSIONS}: no {wrong}; copy the values from missions.csv")
    if len(found) > 1:
        differing = [name for name in known if len({row[name] for row in found}) > 1]
        raise InputError(
            f"{path / layout.MISSIONS}: {len(found)} missions{typed}; to choose one, add "
            f"{differing[0]}=..."
        )
    return found[0]


def replay_designs(run: Run, experiment: Experiment) -> dict[int, Design]:
    """Replay the recorded scores to the optimizer; return all proposed designs by id."""
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
