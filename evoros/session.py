"""Runs: starting one, resuming one, and what the commands and scripts call to do so."""

import json
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import chdir, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from logging import LogRecord
from pathlib import Path
from typing import Any, Protocol

from hydra.core.override_parser.types import OverrideType
from omegaconf import DictConfig, OmegaConf

from evoros import config as configuration
from evoros.errors import InputError, is_whole
from evoros.evaluation import describe
from evoros.evolution import Evolution, Generation, Observer
from evoros.experiment import Experiment
from evoros.folder import CONFIG, LOG, MANIFEST, require_unused, require_whole
from evoros.log import LOGGER, logging_to_file, remembering
from evoros.manifest import check_unchanged, manifest
from evoros.mission import Mission
from evoros.outcome import Outcome
from evoros.record import RunFolder

RUNNING, FINISHED, STOPPED = "running", "finished", "stopped"


class Display(Observer, Protocol):
    """An observer that is told when the run starts."""

    def start(self, generations: int) -> None:
        """The run is built and recorded; it starts now, with so many generations."""
        ...


class Silent:
    """Shows nothing."""

    def start(self, generations: int) -> None:
        """The run starts."""

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Missions are wanted."""

    def mission(self, mission: Mission, outcome: Outcome) -> None:
        """A mission was flown."""

    def generation(self, generation: Generation) -> None:
        """A generation is over."""


@dataclass
class Recorder:
    """Keeps ``status.json`` and the log true and passes everything on to a display."""

    folder: RunFolder
    display: Display
    generations: int
    started: float
    missions: int = 0
    simulated: float = 0.0
    last: Generation | None = None

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Missions are wanted."""
        self.display.begin(generation, missions, known)

    def mission(self, mission: Mission, outcome: Outcome) -> None:
        """A mission was flown and is on disk."""
        self.missions += 1
        self.simulated += outcome.time_s
        if outcome.reason:
            LOGGER.warning("%s: %s: %s", describe(mission), outcome.ended, outcome.reason)
        self.display.mission(mission, outcome)

    def generation(self, generation: Generation) -> None:
        """A generation is over and on disk."""
        self.last = generation
        self.write(RUNNING)
        LOGGER.info(
            "generation %d/%d: %s", generation.number, self.generations - 1, generation.standing
        )
        self.display.generation(generation)

    def write(self, state: str, reason: str = "") -> None:
        """The status of the run; wall-clock figures are of this session alone."""
        last = self.last
        self.folder.write_status(
            {
                "state": state,
                "reason": reason,
                "generations": self.generations,
                "generations_done": 0 if last is None else last.number + 1,
                "best_fitness": None if last is None else last.best.fitness,
                "best_validated_fitness": None if last is None else last.validated,
                "best_loss": None if last is None else last.loss,
                "mean_loss": None if last is None else last.mean_loss,
                "confirmed": 0 if last is None else len(last.losses),
                "missions": len(self.folder.outcomes),
                "session_missions": self.missions,
                "session_simulated_s": round(self.simulated, 1),
                "session_wall_s": round(time.monotonic() - self.started, 1),
                "updated": datetime.now(UTC).isoformat(timespec="seconds"),
            }
        )


def start(config: DictConfig, folder: Path, display: Display) -> Generation:
    """Run the configured experiment in a new folder; returns its last generation.

    Raises:
        InputError: something cannot be used; the folder is then as it was.
        RunStopped: a mission was lost; the run can be resumed.
    """
    require_unused(folder)  # before anything is built, which may take seconds
    with remembering() as said:
        experiment = configuration.build(config)
        content = configuration.to_text(config)
        described = manifest(experiment, content, configuration.to_values(config))
    generations = experiment.optimizer.generations
    with RunFolder.create(folder, content, described) as record:
        return _evolve(experiment, record, generations, display, said)


def rebuild(folder: Path, config_dir: str | Path | None = None) -> Experiment:
    """The experiment of a recorded run. This runs the code that its configuration names.

    ``config_dir`` has the modules of the user's own parts, as when the run was started.

    Raises:
        InputError: no run there, or what it is made of has changed.
    """
    return _rebuilt(folder, (), config_dir)[0]


def resume(
    folder: Path,
    overrides: Sequence[str],
    display: Display,
    config_dir: str | Path | None = None,
) -> Generation:
    """Go on with the run in the folder; a finished one is verified, and extended if asked to.

    ``overrides`` may change the executor and raise ``optimizer.generations``; ``config_dir`` has
    the modules of the user's own parts.

    Raises:
        InputError: no run there, another override, or what the run is made of has changed.
        RunStopped: as in ``start``.
    """
    with remembering() as said:
        experiment, asked = _rebuilt(folder, overrides, config_dir)
    with RunFolder(folder) as record:
        reached = record.read_status().get("generations")
        known = reached if isinstance(reached, int) else experiment.optimizer.generations
        if asked is not None and asked < known:
            raise InputError(
                f"optimizer.generations: must be at least {known}, which the run already has, "
                f"not {asked}; a run can only be extended"
            )
        return _evolve(experiment, record, asked or known, display, said)


def _evolve(
    experiment: Experiment,
    record: RunFolder,
    generations: int,
    display: Display,
    said: Sequence[LogRecord],
) -> Generation:
    recorder = Recorder(record, display, generations, time.monotonic())
    with logging_to_file(record.path / LOG, said):
        LOGGER.info(
            "%s: %d generations, seed %d, worlds %s, %d workers",
            record.path,
            generations,
            experiment.seed,
            ", ".join(experiment.world),
            experiment.executor.workers,
        )
        display.start(generations)
        recorder.write(RUNNING)
        try:
            last = Evolution(experiment, record, recorder, generations).run()
        except BaseException as error:
            LOGGER.debug("stopped", exc_info=True)  # the traceback goes into the file alone
            interrupted = isinstance(error, KeyboardInterrupt)
            recorder.write(STOPPED, "interrupted" if interrupted else str(error))
            raise
        recorder.write(FINISHED)
    return last


def _rebuilt(
    folder: Path, overrides: Sequence[str], config_dir: str | Path | None
) -> tuple[Experiment, int | None]:
    """The unchanged experiment of a run, with what may change; and the generations asked for."""
    if config_dir is not None:
        configuration.own_folder(config_dir)
    recorded, config = _read_manifest(folder), configuration.read(folder / CONFIG)
    text = (folder / CONFIG).read_text()
    changed, asked = _overridden(config.copy(), overrides, config_dir)
    with _where_it_began(recorded):
        experiment = configuration.build(changed)
    check_unchanged(folder, recorded, experiment, text, configuration.to_values(config))
    return experiment, asked


@contextmanager
def _where_it_began(recorded: Mapping[str, Any]) -> Iterator[None]:
    """Paths in a configuration may be relative to the folder where the run was started."""
    origin = Path(str(recorded.get("working_directory", ".")))
    with chdir(origin if origin.is_dir() else Path.cwd()):
        yield


def _read_manifest(folder: Path) -> Mapping[str, Any]:
    require_whole(folder)
    if not (folder / CONFIG).is_file() or not (folder / MANIFEST).is_file():
        raise InputError(
            f"resume={folder}: must be the folder of a run, with {CONFIG} and {MANIFEST}; "
            f"give such a folder"
        )
    try:
        content = json.loads((folder / MANIFEST).read_text())
    except ValueError as error:
        raise InputError(
            f"{folder / MANIFEST}: must be valid JSON ({error}); restore the file"
        ) from error
    return content if isinstance(content, Mapping) else {}


def _overridden(
    config: DictConfig, overrides: Sequence[str], config_dir: str | Path | None
) -> tuple[DictConfig, int | None]:
    """The run's own configuration with what resuming may change; and the generations asked for."""
    asked = None
    for override in configuration.parse(overrides):
        key, value = override.key_or_group, override.value()
        plain = override.type is OverrideType.CHANGE and not override.is_sweep_override()
        if plain and key == "executor":
            config.executor = configuration.compose(
                [configuration.typed(override)], config_dir
            ).executor
        elif plain and key.startswith("executor."):
            OmegaConf.update(config, key, value, force_add=True)
        elif plain and key == "optimizer.generations":
            least = OmegaConf.select(config, key)
            if not (isinstance(value, int) and is_whole(value)) or value < least:
                raise InputError(
                    f"{key}: must be a whole number of at least {least}, which the run already "
                    f"has, not {value!r}; a run can only be extended"
                )
            config.optimizer.generations = asked = value
        else:
            raise InputError(
                f"{configuration.typed(override)}: only executor, executor.* and a larger "
                f"optimizer.generations go with resume=; the rest is the run's own; start a new "
                f"run to change it"
            )
    return config, asked
