"""Runs: starting one, resuming one, and what the commands and scripts call to do so."""

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Protocol

from omegaconf import DictConfig, OmegaConf

from evoros import config as configuration
from evoros.errors import InputError, is_whole
from evoros.experiment import Evolution, Experiment, Generation, Observer
from evoros.manifest import check_unchanged, manifest
from evoros.mission import Mission
from evoros.outcome import Outcome
from evoros.record import CONFIG, MANIFEST, RunFolder, is_run

RUNNING, FINISHED, STOPPED = "running", "finished", "stopped"


class Display(Observer, Protocol):
    """An observer that is told when the run starts and where it is."""

    def start(self, folder: Path, experiment: Experiment, generations: int) -> None:
        """The run is built and recorded; it starts now."""
        ...


class Silent:
    """Shows nothing."""

    def start(self, folder: Path, experiment: Experiment, generations: int) -> None:
        """The run starts."""

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Missions are wanted."""

    def mission(self, mission: Mission, outcome: Outcome) -> None:
        """A mission was flown."""

    def generation(self, generation: Generation) -> None:
        """A generation is over."""


@dataclass
class Recorder:
    """Keeps ``status.json`` true and passes everything on to a display."""

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
        self.display.mission(mission, outcome)

    def generation(self, generation: Generation) -> None:
        """A generation is over and on disk."""
        self.last = generation
        self.write(RUNNING)
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
    if is_run(folder):  # before anything is built, which may take seconds
        RunFolder.create(folder, "", {})
    experiment = configuration.build(config)
    content = configuration.to_text(config)
    generations = experiment.optimizer.generations
    with RunFolder.create(folder, content, manifest(experiment, content)) as record:
        return _evolve(experiment, record, generations, display)


def resume(folder: Path, overrides: Sequence[str], display: Display) -> Generation:
    """Go on with the run in the folder; a finished one is verified, and extended if asked to.

    ``overrides`` may change the executor and raise ``optimizer.generations``.

    Raises:
        InputError: no run there, another override, or what the run is made of has changed.
        RunStopped: as in ``start``; or the run does not replay as it was recorded.
    """
    if not (folder / CONFIG).is_file() or not (folder / MANIFEST).is_file():
        raise InputError(
            f"resume={folder}: must be the folder of a run, with {CONFIG} and {MANIFEST}; "
            f"give such a folder"
        )
    text = (folder / CONFIG).read_text()
    experiment = configuration.build(_overridden(configuration.read(folder / CONFIG), overrides))
    check_unchanged(folder, _read_manifest(folder), experiment, text)
    with RunFolder(folder) as record:
        reached = record.read_status().get("generations")
        asked = experiment.optimizer.generations
        known = reached if isinstance(reached, int) else asked
        explicit = any(override.startswith("optimizer.generations=") for override in overrides)
        if explicit and asked < known:
            raise InputError(
                f"optimizer.generations: must be at least {known}, which the run already has, "
                f"not {asked}; a run can only be extended"
            )
        return _evolve(experiment, record, max(asked, known), display)


def _evolve(
    experiment: Experiment, record: RunFolder, generations: int, display: Display
) -> Generation:
    recorder = Recorder(record, display, generations, time.monotonic())
    display.start(record.path, experiment, generations)
    recorder.write(RUNNING)
    try:
        last = Evolution(experiment, record, recorder, generations).run()
    except KeyboardInterrupt:
        recorder.write(STOPPED, "interrupted")
        raise
    except Exception as error:
        recorder.write(STOPPED, str(error))
        raise
    recorder.write(FINISHED)
    return last


def _read_manifest(folder: Path) -> Mapping[str, Any]:
    try:
        content = json.loads((folder / MANIFEST).read_text())
    except ValueError as error:
        raise InputError(
            f"{folder / MANIFEST}: must be valid JSON ({error}); restore the file"
        ) from error
    return content if isinstance(content, Mapping) else {}


def _overridden(config: DictConfig, overrides: Sequence[str]) -> DictConfig:
    """The run's own configuration with the few overrides that resuming accepts."""
    for override in overrides:
        key, sign, value = override.partition("=")
        if sign and key == "executor":
            path = configuration.group_file("executor", value)
            config.executor = configuration.read(path)
        elif sign and key.startswith("executor."):
            OmegaConf.update(config, key, OmegaConf.from_dotlist([f"x={value}"]).x)
        elif sign and key == "optimizer.generations":
            count = OmegaConf.from_dotlist([f"x={value}"]).x
            if not is_whole(count) or count < config.optimizer.generations:
                raise InputError(
                    f"{key}: must be a whole number of at least {config.optimizer.generations}, "
                    f"which the run already has, not {value}; a run can only be extended"
                )
            config.optimizer.generations = count
        else:
            raise InputError(
                f"{override}: only executor, executor.* and a larger optimizer.generations can be "
                f"given with resume=; the rest is the run's own; start a new run to change it"
            )
    return config
