"""Jobs of a sweep that is typed again: what is complete is kept, and what is begun goes on."""

from collections.abc import Sequence
from pathlib import Path

from evoros.base.errors import InputError
from evoros.config.configuration import Configuration
from evoros.config.recorded import find_difference, read_recorded
from evoros.files.disk import require_no_links
from evoros.session.design_tables import write_designs
from evoros.session.evaluation import Evaluation, open_evaluation, read_sources
from evoros.session.figures import has_figure
from evoros.session.overview import survey
from evoros.session.run import Session, open_run
from evoros.storage.file_reading import read_sealed
from evoros.storage.layout import CONFIG, EVALUATE, FINISHED, MANIFEST, RUN, SCORES, command_of
from evoros.storage.originals import read_original
from evoros.storage.verification import is_complete, verify_folder


def reopen_run(
    config: Configuration, folder: Path, overrides: Sequence[str], config_dir: str | None
) -> Session | None:
    """Open the run in a job's folder to resume it; None if it is complete, with its figures.

    A run whose tables or digests are damaged is not complete.

    ``overrides`` may change the executor and the observers.

    Raises:
        InputError: the folder has another run than the job's, or it cannot be resumed.
    """
    _require_same(folder, config, RUN)
    figures = config.values.get("figures") or ()
    drawn = all(has_figure(folder, name) for name in figures)
    if survey(folder).state == FINISHED and drawn and not _is_damaged(folder):
        return None
    return open_run(folder, overrides, config_dir)


def reopen_evaluation(
    config: Configuration, folder: Path, overrides: Sequence[str], config_dir: str | None
) -> Evaluation | None:
    """Open the evaluation in a job's folder to resume it; None if it is complete.

    ``overrides`` may change the executor.

    Raises:
        InputError: the folder has another evaluation than the job's, or it cannot be resumed.
    """
    _require_same(folder, config, EVALUATE)
    evaluation = open_evaluation(folder, overrides, config_dir)
    designs = read_sources(config.designs, evaluation.experiment)
    if write_designs(designs) != write_designs(evaluation.designs):
        raise InputError(
            f"designs: must be those that are evaluated in {folder}, and they have changed; choose "
            f"another hydra.sweep.dir"
        )
    complete = survey(folder).state == FINISHED and (folder / SCORES).is_file()
    return None if complete else evaluation


def _is_damaged(folder: Path) -> bool:
    try:
        verify_folder(folder)
        return not is_complete(folder)
    except InputError:  # to resume the run says what is damaged, and mends it or refuses
        return True


def _require_same(folder: Path, config: Configuration, command: str) -> None:
    """Require that a command made a folder from a job's configuration, whatever the executor.

    A damaged configuration is not taken for another job's.
    """
    require_no_links(folder)
    read_original(folder, CONFIG, read_sealed(folder, MANIFEST))
    problem = f"be of {command}, and {command_of(folder)} made it"
    if command_of(folder) == command:
        difference = find_difference(read_recorded(folder / CONFIG), config)
        if not difference:
            return
        problem = f"be of the configuration of its job, and {difference}"
    raise InputError(f"{folder}: must {problem}; choose another hydra.sweep.dir")
