"""Turns overrides into the jobs of a command or a sweep, each with its folder.

Hydra composes, but does not run: its own runner makes the folder before the input is checked,
and one job of a sweep that cannot be composed would take the others with it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import product
from pathlib import Path

from hydra.core.override_parser.types import Override
from hydra.types import RunMode
from omegaconf import DictConfig, read_write

from evoros.base.errors import EvorosError, InputError
from evoros.config.compose import compose_with_hydra, job_name, list_choices, parse, text_of
from evoros.config.configuration import Configuration, freeze
from evoros.config.like import EVALUATE, LIKE, ReadRun, choose_primary
from evoros.config.sweep_values import check_count, expand_values

PLUGINS = LAUNCHER, SWEEPER = "launcher", "sweeper"
"""The groups of Hydra's plugins that start and choose jobs."""


@dataclass(frozen=True)
class Job:
    """One run or evaluation: its configuration, its folder and the overrides that were typed."""

    config: Configuration
    folder: Path
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class RefusedJob:
    """A job of a sweep that cannot be composed, and the folder that it would have had."""

    folder: Path
    error: EvorosError


class Jobs:
    """The jobs of one command: one, or the product of all values of a sweep.

    ``primary`` is the command's own file of conf/; ``sweep`` is the folder of the sweep, None for a
    single job. ``read_run`` reads the run that ``like=`` names; without it there is no such key.
    ``plugins`` has the launcher and the sweeper that take evoros's place, if any.

    Raises:
        InputError: what all jobs have in common cannot be composed.
    """

    def __init__(
        self,
        overrides: Sequence[str],
        multirun: bool,
        config_dir: str | Path | None,
        primary: str = "config",
        read_run: ReadRun | None = None,
    ) -> None:
        self.typed, self.config_dir, self.primary = tuple(overrides), config_dir, primary
        self._read_run = None if read_run is None else cache(read_run)
        parsed = parse(overrides)
        swept = [text_of(override) for override in parsed if override.is_sweep_override()]
        common = [text_of(override) for override in parsed if not override.is_sweep_override()]
        likes = [override for override in parsed if override.key_or_group == LIKE]
        swept_likes = [self._expand_values(like)[0] for like in likes if like.is_sweep_override()]
        self._base = self._compose_base([*common, *swept_likes])
        self.plugins = _find_plugins(self._base)
        if self.plugins and likes:
            raise InputError(
                f"{text_of(likes[0])}: does not go with a launcher or a sweeper of Hydra; leave "
                f"out one of the two"
            )
        if not self.plugins and self._base.hydra.get("callbacks"):
            raise InputError(
                "hydra.callbacks: evoros runs its jobs without Hydra and calls none; leave them out"
            )
        self._overrides: list[tuple[str, ...]] = []
        self.sweep: Path | None = None
        if multirun or self._base.hydra.mode == RunMode.MULTIRUN:
            if SWEEPER not in self.plugins:
                self._overrides = self._expand(parsed)
            self.sweep = _shorten(Path(self._base.hydra.sweep.dir))
        elif swept:
            raise InputError(f"{swept[0]}: several values make a sweep, which needs -m; add -m")

    def _compose_base(self, common: Sequence[str]) -> DictConfig:
        """Compose what all jobs have in common."""
        try:
            return self._compose(common, 0)
        except InputError:
            for text in common:
                if text.lstrip("+~").startswith("hydra.sweeper.params"):
                    raise InputError(
                        f"{text}: belongs into the file of an experiment; here, sweep over the "
                        f"key itself, as in seed=0,1"
                    ) from None
            raise

    def _compose(self, overrides: Sequence[str], index: int) -> DictConfig:
        """Compose a job of the primary file, or of the configuration that ``like=`` names."""
        primary, kept = self.primary, dict[str, str]()
        if self._read_run is not None:
            primary, kept = choose_primary(primary, overrides, self.config_dir, self._read_run)
        config = compose_with_hydra(overrides, self.config_dir, index, primary)
        with read_write(config.hydra):
            config.hydra.runtime.choices = {**kept, **config.hydra.runtime.choices}
        return config

    def _expand(self, parsed: Sequence[Override]) -> list[tuple[str, ...]]:
        """List the overrides of each job: typed ones replace an experiment's of the same key."""
        lists = {typed.get_key_element(): self._expand_values(typed) for typed in parsed}
        params = (self._base.hydra.sweeper.get("params") or {}).items()
        for override in parse([f"{key}={value}" for key, value in params]):
            lists.setdefault(override.get_key_element(), self._expand_values(override))
        check_count([len(values) for values in lists.values()])
        return list(product(*lists.values()))

    def _expand_values(self, override: Override) -> list[str]:
        return expand_values(override, partial(list_choices, config_dir=self.config_dir))

    def __len__(self) -> int:
        return 1 if self.sweep is None else len(self._overrides)

    @property
    def minimizes(self) -> bool:
        """Whether the chosen sweeper looks for the lowest value."""
        direction = self._base.hydra.sweeper.get("direction")
        return str(getattr(direction, "name", direction)) == "minimize"

    def __iter__(self) -> Iterator[Job | RefusedJob]:
        """Yield each job when it is composed, or its error."""
        if self.sweep is None:
            yield compose_job(self._base, Path(self._base.hydra.run.dir), (), self.primary)
            return
        used: set[str] = set()
        for index, overrides in enumerate(self._overrides):
            job: Job | RefusedJob
            try:
                config = self._compose(overrides, index)
                name = str(config.hydra.sweep.subdir)
                if name.casefold() in used:  # different values can look alike as names
                    name = f"{name}_{index}"
                used.add(name.casefold())
                job = compose_job(config, self.sweep / name, overrides, self.primary, in_sweep=True)
            except EvorosError as error:
                job = RefusedJob(self.sweep / job_name(list_task_overrides(overrides)), error)
            yield job


def compose_job(
    config: DictConfig,
    folder: Path,
    overrides: tuple[str, ...],
    primary: str,
    *,
    in_sweep: bool = False,
) -> Job:
    """Make a job of a composed configuration, maybe one of several in the folder of a sweep."""
    sweep = str(folder.absolute().parent) if in_sweep else None
    frozen = freeze(config, evaluates=primary == EVALUATE)
    return Job(replace(frozen, sweep=sweep), _shorten(folder), overrides)


def list_task_overrides(overrides: Sequence[str]) -> list[str]:
    """List the overrides of a job that are not Hydra's own."""
    return [text for text in overrides if not text.startswith("hydra")]


def _find_plugins(config: DictConfig) -> dict[str, str]:
    """Return the names of a launcher and a sweeper that are none of Hydra's own."""
    chosen = {kind: config.hydra.runtime.choices.get(f"hydra/{kind}") for kind in PLUGINS}
    return {kind: str(name) for kind, name in chosen.items() if name not in (None, "basic")}


def _shorten(path: Path) -> Path:
    """Return a path below the current folder relative to it, because users type it again."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path
