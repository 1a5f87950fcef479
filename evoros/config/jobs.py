"""From what was typed to jobs: options, overrides, sweeps, and the folder of each run.

Hydra composes, but does not run: its own runner makes the folder before the input is checked,
and one job of a sweep that cannot be composed would take the others with it.
"""

import contextlib
import io
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from hydra._internal.utils import get_args_parser
from hydra.core.override_parser.types import Override
from hydra.types import RunMode
from omegaconf import DictConfig

from evoros.base.errors import EvorosError, InputError
from evoros.config.compose import compose_whole, parse, typed


@dataclass(frozen=True)
class Job:
    """One run to be: its configuration and where it goes."""

    config: DictConfig
    folder: Path


def options_of(arguments: Sequence[str]) -> Namespace:
    """Hydra's options, and the rest as ``overrides``.

    Raises:
        InputError: there is no such option.
    """
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return get_args_parser().parse_args(list(arguments))
    except SystemExit as stop:
        reason = complaint.getvalue().strip().rpartition("error: ")[2]
        raise InputError(f"{reason}; see evoros --help") from stop


class Jobs:
    """The jobs of one command: one, or the product of all values of a sweep.

    ``primary`` is the command's own file of conf/; ``sweep`` is the folder of the sweep, None for a
    single job.

    Raises:
        InputError: what is common to all jobs cannot be composed.
    """

    def __init__(
        self,
        overrides: Sequence[str],
        multirun: bool,
        config_dir: Path | None,
        primary: str = "config",
    ) -> None:
        parsed = parse(overrides)
        swept = [typed(each) for each in parsed if each.is_sweep_override()]
        common = [typed(each) for each in parsed if not each.is_sweep_override()]
        self._base = compose_whole(common, config_dir, primary=primary)
        self._config_dir, self._primary = config_dir, primary
        self._overrides: list[tuple[str, ...]] = []
        self.sweep: Path | None = None
        if multirun or self._base.hydra.mode == RunMode.MULTIRUN:
            params = (self._base.hydra.sweeper.get("params") or {}).items()
            lists = {each.get_key_element(): _values(each) for each in parsed}
            for each in parse([f"{key}={value}" for key, value in params]):
                # What is typed takes the place of an experiment's own values of the same key.
                lists.setdefault(each.get_key_element(), _values(each))
            self._overrides = list(product(*lists.values()))
            if not self._overrides:
                empty = next(key for key, values in lists.items() if not values)
                raise InputError(f"{empty}: must have values to sweep over, not none; give one")
            self.sweep = _short(Path(self._base.hydra.sweep.dir))
        elif swept:
            raise InputError(f"{swept[0]}: several values make a sweep, which needs -m; add -m")

    def __len__(self) -> int:
        return 1 if self.sweep is None else len(self._overrides)

    def __iter__(self) -> Iterator[Job | EvorosError]:
        """Each job as it is composed, or what is wrong with it."""
        if self.sweep is None:
            yield Job(self._base, _short(Path(self._base.hydra.run.dir)))
            return
        used: set[str] = set()
        for number, overrides in enumerate(self._overrides):
            try:
                config = compose_whole(overrides, self._config_dir, number, self._primary)
                name = str(config.hydra.sweep.subdir)
            except EvorosError as error:
                yield error
                continue
            if name.casefold() in used:  # different values can look alike as names
                name = f"{name}_{number}"
            used.add(name.casefold())
            yield Job(config, self.sweep / name)


def _values(override: Override) -> list[str]:
    """The override once for each value that it sweeps over.

    Raises:
        InputError: a range of real numbers, which only an optimizer could sweep over.
    """
    key = override.get_key_element()
    if not override.is_sweep_override():
        return [typed(override)]
    if not override.is_discrete_sweep():
        raise InputError(
            f"{typed(override)}: must be a list of values or a range(); write the values"
        )
    return [f"{key}={value}" for value in override.sweep_string_iterator()]


def _short(path: Path) -> Path:
    """Relative to the current folder where the path lies below it: it is typed again."""
    try:
        return path.relative_to(Path.cwd())
    except ValueError:
        return path
