"""Starts jobs through a Hydra launcher or sweeper, such as ``hydra/launcher=joblib``."""

import copy
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from hydra._internal.callbacks import Callbacks  # required by HydraContext, which is public
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn
from hydra.types import HydraContext, RunMode
from omegaconf import DictConfig, open_dict

from evoros.base.errors import EvorosError, RunStopped, override, single_line
from evoros.config.compose import add_config_dir, initialize, search_path
from evoros.config.configuration import freeze
from evoros.config.jobs import Job, Jobs, place_job
from evoros.config.like import EVALUATE
from evoros.terminal.log import LOGGER

RunJob = Callable[[Job], float]  # runs a job in a launcher's process; returns the job's fitness


@dataclass(frozen=True)
class _Task:
    run: RunJob
    primary: str
    config_dir: Path | None

    def __call__(self, config: DictConfig) -> float:
        if self.config_dir is not None:
            add_config_dir(self.config_dir)
        hydra = HydraConfig.get()
        whole = copy.deepcopy(config)
        with open_dict(whole):
            whole.hydra = hydra
        folder = Path(hydra.runtime.output_dir)
        overrides = tuple(map(str, hydra.overrides.task))
        frozen = freeze(whole, evaluates=self.primary == EVALUATE)
        return self.run(place_job(frozen, folder, overrides, in_sweep=True))


def launch(jobs: Jobs, ready: Sequence[Job], run: RunJob) -> dict[Path, EvorosError | None]:
    """Run the ``ready`` jobs with the chosen launcher; return the error (or None) by folder."""
    with _start(jobs, "launcher") as hydra:
        typed = [text for text in jobs.typed if text.startswith("hydra")]
        config = hydra.compose_config(
            jobs.primary,
            [*typed, *_places(jobs)],
            run_mode=RunMode.MULTIRUN,
            with_log_configuration=False,
        )
        launcher = Plugins.instance().instantiate_launcher(
            hydra_context=HydraContext(hydra.config_loader, Callbacks(config)),
            task_function=_create_task(jobs, run),
            config=config,
        )
        returned = launcher.launch([_overrides_of(job) for job in ready], 0)
    errors = map(_find_error, returned)
    return dict(zip((job.folder for job in ready), errors, strict=True))


def search(jobs: Jobs, run: RunJob) -> None:
    """Let the sweeper choose and run jobs; raise RunStopped if it gives up."""
    if jobs.minimizes:
        LOGGER.warning(
            "hydra.sweeper.direction=minimize: searches for the lowest fitness; for the highest, "
            "add hydra.sweeper.direction=maximize"
        )
    with _start(jobs, "sweeper") as hydra:
        hydra.multirun(jobs.primary, _create_task(jobs, run), [*jobs.typed, *_places(jobs)], False)


@contextmanager
def _start(jobs: Jobs, plugin: str) -> Iterator[Any]:
    try:
        with initialize():
            hydra = GlobalHydra.instance().hydra
            assert hydra is not None
            yield hydra
    except EvorosError:
        raise
    except Exception as error:  # a plugin may raise any exception
        raise RunStopped(
            f"hydra/{plugin}={jobs.plugins[plugin]}: {type(error).__name__}: {single_line(error)}; "
            f"correct the keys below hydra.{plugin}, or run the sweep without the plugin"
        ) from error


def _create_task(jobs: Jobs, run: RunJob) -> _Task:
    folder = None if jobs.config_dir is None else add_config_dir(jobs.config_dir)
    return _Task(run, jobs.primary, folder)


def _places(jobs: Jobs) -> list[str]:
    places = [override("hydra.sweep.dir", str(jobs.sweep))]
    if jobs.config_dir is not None:
        places.append(search_path(jobs.config_dir))
    return places


def _overrides_of(job: Job) -> list[str]:
    task = [text for text in job.overrides if not text.startswith("hydra")]
    return [*task, override("hydra.sweep.subdir", job.folder.name)]


def _find_error(result: JobReturn) -> EvorosError | None:
    try:
        with redirect_stderr(StringIO()):  # Hydra also prints the job
            _ = result.return_value
    except EvorosError as error:
        return error
    except Exception as error:
        return RunStopped(f"{type(error).__name__}: {single_line(error)}")
    return None
