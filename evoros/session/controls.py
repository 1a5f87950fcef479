"""Runs a search's controls: a random search, and an evaluation of designs on the same draws."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.certificate.controls import NO_SENSORS, RANDOM, Controls
from evoros.config.configuration import Configuration
from evoros.config.recorded import read_recorded, replace_recorded
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.evolution.stop_after import StopAfter
from evoros.optimizer.random_search import RandomSearch
from evoros.preflight.preflight import preflight
from evoros.session import work
from evoros.session.design_tables import NamedDesign
from evoros.session.given_designs import read_given
from evoros.session.rebuilding import change_to_origin
from evoros.session.run import Session, open_run, record_run
from evoros.session.search import Search, build_search
from evoros.session.status import Display, survey
from evoros.storage import layout
from evoros.storage.champion_files import CHAMPION
from evoros.storage.layout import CONTROLS, EVALUATION, read_sealed
from evoros.terminal.log import LOGGER, collect_messages

# configuration values that all controls use
PLAIN: Mapping[str, Any] = {
    **{"controls": None, "observers": {}, "figures": [], "record": "none"},
    "stop_after": {"_target_": f"{StopAfter.__module__}.{StopAfter.__qualname__}"},
}


def run(
    session: Session,
    display: Display,
    draw: work.DrawFigures,
    opener: work.PoolOpener = work.open_pool,
) -> None:
    """Run a search or an evaluation, as ``Session.run`` does, and then the search's controls."""
    session.run(display, draw, opener)
    task = session.task
    if isinstance(task, Search) and task.experiment.controls is not None:
        for control in open_controls(task.folder.path, task.experiment.controls):
            control.run(display, draw, opener)


def open_controls(run: Path, controls: Controls) -> Iterator[Session]:
    """Yield a session for each unfinished control of a finished run; the caller runs them."""
    run = run.absolute()
    parts: dict[str, Callable[[Path, Controls, Path], Session]] = {}
    if RANDOM in controls.designs:
        parts[RANDOM] = _record_random
    parts[EVALUATION] = _record_evaluation
    for name, record in parts.items():
        folder = run / CONTROLS / name
        if not (folder / layout.MISSIONS).exists():
            yield record(run, controls, folder)
        elif survey(folder).state != layout.FINISHED:
            yield open_run(folder)
    _require_current(run)


def _require_current(run: Path) -> None:
    """Raise an error if the controls are for another champion or another number of generations."""
    evaluation, random = (run / CONTROLS / name for name in (EVALUATION, RANDOM))
    files = {"design.csv": layout.DESIGN_FILE, "genes.csv": layout.GENE_FILE}
    same = [
        _read_champion(run / CHAMPION / name) == _read_champion(evaluation / file)
        for name, file in files.items()
    ]
    if random.is_dir():
        same.append(survey(random).done == survey(run).done)
    if not all(same):
        raise InputError(
            f"{run / CONTROLS}: made before the run was extended; delete the folder and type: "
            f"{layout.resume_command(run)}"
        )


def _read_champion(file: Path) -> list[dict[str, str]]:
    rows = (row for row in layout.read_rows(file) if row.get("source", CHAMPION) == CHAMPION)
    return [{key: row[key] for key in row if key not in ("source", "gene")} for row in rows]


def has_controls(run: Path) -> bool:
    """Return True if the controls of a run have finished."""
    return survey(run / CONTROLS / EVALUATION).state == layout.FINISHED


def _configure(run: Path, changes: Mapping[str, Any]) -> Configuration:
    manifest = read_sealed(run, layout.MANIFEST)
    changed = replace_recorded(read_recorded(run / layout.CONFIG), {**PLAIN, **changes})
    choices = {key: file for key, file in manifest["choices"].items() if key not in changes}
    return replace(changed, choices=choices, config_dir=manifest.get(layout.CONFIG_DIR))


def _record_random(run: Path, controls: Controls, folder: Path) -> Session:
    from evoros.storage.reading import load_run  # imports pandas, which is slow

    recorded, table = read_recorded(run / layout.CONFIG).values, load_run(run).generations
    number, designs = int(table["generation"].max()) + 1, table["id"].nunique()
    optimizer = {
        "_target_": f"{RandomSearch.__module__}.{RandomSearch.__qualname__}",
        "population_size": -(-designs // number),
        "generations": number,
        "validation_trials": recorded["optimizer"]["validation_trials"],
    }
    config = _configure(run, {"optimizer": optimizer})
    with collect_messages() as messages, change_to_origin(read_sealed(run, layout.MANIFEST)):
        LOGGER.info("%s: running the control, a random search of %d designs", folder, designs)
        return record_run(build_search(config), config, folder, messages)


def _record_evaluation(run: Path, controls: Controls, folder: Path) -> Session:
    config = replace(_configure(run, {"trials": controls.trials}), evaluates=True)
    with collect_messages() as messages, change_to_origin(read_sealed(run, layout.MANIFEST)):
        experiment = config.build()
        preflight(experiment)
        designs = list(_list_designs(run, controls, experiment))
        return record_run(experiment, config, folder, messages, designs=designs)


def _list_designs(run: Path, controls: Controls, experiment: Experiment) -> Iterator[NamedDesign]:
    (champion,) = read_given([str(run)], experiment)
    yield replace(champion, source=CHAMPION)
    for name in controls.designs:
        if name == NO_SENSORS:
            bare = {robot: Design((), part.values) for robot, part in champion.design.parts.items()}
            yield NamedDesign(name, champion.name, Design.join(bare))
        else:
            random = str(run / CONTROLS / RANDOM)
            given = read_given([random if name == RANDOM else name], experiment)
            yield from (replace(design, source=name) for design in given)
