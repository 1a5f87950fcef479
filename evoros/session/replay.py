"""Recomputes the designs of a run, and reruns single recorded missions."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import chdir, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from evoros.base.errors import InputError
from evoros.config.compose import add_config_dir
from evoros.config.configuration import Configuration, check_targets
from evoros.config.own_files import NAMED_FOLDERS
from evoros.config.recorded import override_recorded, read_recorded
from evoros.design.design import Design
from evoros.evolution.experiment import STATED, Experiment
from evoros.evolution.trials import read_score
from evoros.failure.protocol import Case
from evoros.files.disk import require_no_links, write_atomically
from evoros.files.resources import expand_home
from evoros.mission.mission import Mission, MissionKey, Outcomes
from evoros.mission.plan import GENERATIONS, MOST_REPEATS, find_growing
from evoros.mission.rollout import run_mission
from evoros.mission.scenario import Scenario
from evoros.session.design_tables import read_recorded_designs
from evoros.session.design_trials import GENERATION
from evoros.simulator.planar import Planar
from evoros.storage import layout
from evoros.storage.archives import NOWHERE, Relocation
from evoros.storage.creation import require_whole
from evoros.storage.digests import read_original
from evoros.storage.file_reading import read_rows, read_sealed
from evoros.storage.manifest import (
    check_unchanged,
    find_changes,
    list_other_versions,
    list_unrecorded,
)
from evoros.storage.reading import Run, load_run
from evoros.storage.tables import CASE, read_key, read_outcomes, trajectory_table
from evoros.storage.verdicts import Row
from evoros.terminal.log import LOGGER, read_again
from evoros.world.model import World


class Rebuilt(NamedTuple):
    """The rebuilt experiment of a run."""

    experiment: Experiment
    number: int | None
    """Number of generations or trials in the overrides; None if not given."""
    config: Configuration
    """Recorded configuration with the overrides."""


def rebuild(
    folder: Path,
    overrides: Sequence[str] = (),
    config_dir: str | Path | None = None,
    *,
    warns: bool = True,
    places: Relocation = NOWHERE,
    mends: bool = False,
) -> Rebuilt:
    """Rebuild the experiment of a run with overrides that resuming allows.

    This executes the code named by its configuration. ``warns`` reports different versions of
    packages. ``places`` has the folders whose paths an archive's record does not contain. ``mends``
    accepts changed parts if the run has recorded no result of them.

    Raises:
        InputError: the folder has no run, an override is not allowed, or an input of the run has
            changed.
    """
    if config_dir is not None:
        add_config_dir(config_dir)
    manifest = _read_manifest(folder)
    given = layout.evaluates(folder)
    names = layout.ORIGINALS if given else (layout.CONFIG,)
    contents = {name: read_original(folder, name, manifest).decode() for name in names}
    recorded = read_recorded(folder / layout.CONFIG)
    growing = find_growing(recorded.values) if given else GENERATIONS
    config, number = override_recorded(recorded, overrides, config_dir, growing)
    check_targets(config.values, NAMED_FOLDERS, folder / layout.CONFIG)
    with change_to_origin(manifest), read_again(folder.absolute() / layout.LOG):
        experiment = config.build()
    contents.pop(layout.CONFIG)
    texts = recorded.text, recorded.values, contents
    mended = list_unrecorded(folder) if mends else ()
    changes = find_changes(manifest, experiment, *texts, places)
    check_unchanged(folder, manifest, (name for name in changes if name not in mended))
    if warns:
        for name, before, now in list_other_versions(manifest, experiment, recorded.values):
            LOGGER.warning(
                "%s: made with %s %s; now %s; new missions may differ from recorded ones",
                *(folder, name, before, now),
            )
    typed = manifest.get(layout.OVERRIDES, ())
    choices, own = manifest.get("choices", {}), manifest.get(layout.CONFIG_DIR)
    config = replace(config, choices=choices, overrides=typed, config_dir=own)
    return Rebuilt(experiment, number, config)


@contextmanager
def change_to_origin(manifest: Mapping[str, Any]) -> Iterator[None]:
    """Change to the folder in which the run was started, where relative paths begin."""
    origin = Path(str(manifest.get("working_directory", ".")))
    with chdir(origin if origin.is_dir() else Path.cwd()):
        yield


def _read_manifest(folder: Path) -> Mapping[str, Any]:
    if folder.is_dir():
        require_no_links(folder)
    require_whole(folder)
    if not (folder / layout.CONFIG).is_file() or not (folder / layout.MANIFEST).is_file():
        swept = any(layout.folders_below(folder, lambda _: None))
        fix = "repeat the command of its sweep, which continues unfinished jobs"
        raise InputError(
            f"{folder}: must be the folder of a run, with {layout.CONFIG} and {layout.MANIFEST}; "
            f"{fix if swept else 'give such a folder'}"
        )
    return read_sealed(folder, layout.MANIFEST)


def plan_row(
    experiment: Experiment, designs: Mapping[int, Design], key: MissionKey, row: Mapping[str, str]
) -> tuple[Mission, Scenario]:
    """Plan the mission ``key`` of a row of ``missions.csv``; return it with its scenario.

    ``designs`` has the designs of the run by id.
    """
    generation, design, world, trial = key
    purpose = row.get("purpose", experiment.evaluation_draws)
    setting = experiment.conditions.get(row.get(CASE, ""))
    case = Case.parse(row[CASE]) if row.get(CASE) and setting is None else None
    scenario = experiment.scenario_for(purpose)
    if setting is not None or trial >= MOST_REPEATS:
        scenario = experiment.scenario_under(setting or STATED)
    text = "" if setting is None else setting.text
    place = (generation, design, designs[design], world, trial)
    return Mission(*place, purpose, row["draws"], case, text), scenario


KEY = ("generation", "design", "world", "trial")


class Replayed(NamedTuple):
    """A rerun of a recorded mission."""

    recorded: Outcomes
    outcomes: Outcomes
    trajectory: pd.DataFrame  # columns of ``champion/trajectory_WORLD.csv``
    agents: Sequence[str]


def replay(
    folder: str | Path, key: MissionKey, *, config_dir: str | Path | None = None
) -> tuple[Outcomes, pd.DataFrame]:
    """Rerun one recorded mission of a run in this process, with the same result.

    ``key`` has the generation, design, world and trial of its row in ``missions.csv``. Return the
    outcome of each robot, and the trajectory with the columns of ``champion/trajectory_WORLD.csv``.
    This executes the code named by the run's configuration; ``config_dir`` is the folder of your
    own parts, as when the run was started.

    Raises:
        InputError: run or mission not found, or the run is of a different version.
    """
    columns = dict(zip(KEY, map(str, key), strict=True))
    replayed = replay_row(folder, columns, config_dir)
    return replayed.outcomes, replayed.trajectory


def replay_row(
    folder: str | Path, columns: Mapping[str, str], config_dir: str | Path | None = None
) -> Replayed:
    """Rerun the mission of the only row with these ``columns``.

    Raises:
        InputError: no or several rows match, or an error of ``replay``.
    """
    run = load_run(expand_home(folder))
    row = _find_row(run.path, columns)
    experiment = rebuild(run.path, (), config_dir).experiment
    if run.evaluates:
        designs, key = _find_given(run, experiment, row)
    else:
        designs, key = replay_designs(run, experiment), read_key(row)
    agents = list(experiment.agents)
    outcomes, frame = _run(*plan_row(experiment, designs, key, row))
    return Replayed(read_outcomes(row, agents), outcomes, frame, agents)


def _find_given(run: Run, experiment: Experiment, row: Row) -> tuple[dict[int, Design], MissionKey]:
    """Return the given designs of an evaluation by id, and the key of the row's mission."""
    given = read_recorded_designs(run.path, experiment)
    names = [(named.source, named.name) for named in given]
    design = names.index((row["source"], row["design"]))
    designs = {index: named.design for index, named in enumerate(given)}
    return designs, (GENERATION, design, row["world"], int(row["trial"]))


def replay_in_plane(
    run: Run, keys: Sequence[MissionKey]
) -> Iterator[tuple[MissionKey, World, pd.DataFrame]]:
    """Rerun recorded missions of the planar simulator; yield their worlds and trajectories.

    Raises:
        InputError: the run has an engine or a live controller, or an error of ``replay``.
    """
    experiment = rebuild(run.path, ()).experiment
    for scenario in (experiment.scenario, experiment.confirming):
        if not isinstance(scenario.simulator, Planar) or scenario.is_live:
            raise InputError(
                f"{run.path}: must use simulator=planar and no live controllers; choose another run"
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
    """Write a trajectory in the format of the run folder.

    Raises:
        InputError: the file cannot be written.
    """
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
        raise InputError(
            f"{path / layout.MISSIONS}: has no {wrong}; take the values from missions.csv"
        )
    if len(found) > 1:
        differing = [name for name in known if len({row[name] for row in found}) > 1]
        raise InputError(
            f"{path / layout.MISSIONS}: has {len(found)} missions{typed}; to choose one, add "
            f"{differing[0]}=..."
        )
    return found[0]


def replay_designs(run: Run, experiment: Experiment) -> dict[int, Design]:
    """Return the designs proposed so far by id; the optimizer repeats them from recorded scores."""
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
