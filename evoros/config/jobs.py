"""Converts overrides to the jobs of a command or sweep, each with a folder.

Hydra only composes: its runner makes folders early and ends a sweep at the first faulty job.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Glob, Override, RangeSweep, Sweep
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf, read_write
from omegaconf.errors import OmegaConfBaseException

from evoros.base.errors import EvorosError, InputError, quote_value
from evoros.config.compose import compose_with_hydra, job_name, list_choices, parse, text_of
from evoros.config.configuration import Configuration, freeze
from evoros.config.like import EVALUATE, LIKE, ReadRun, choose_primary
from evoros.config.messages import describe_error
from evoros.config.references import has_calls

_MAX_JOBS = 100_000  # maximum number of jobs, to detect mistakes such as extra zeros in range()
PLUGINS = LAUNCHER, SWEEPER = "launcher", "sweeper"  # Hydra plugins that start and choose jobs
DEFAULT_NAME = "${evoros.name:${hydra:overrides.task}}"  # ``hydra.sweep.subdir`` in config.yaml


@dataclass(frozen=True)
class Job:
    """A run or evaluation, with its configuration, folder and typed overrides."""

    config: Configuration
    folder: Path
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class RefusedJob:
    """A job of a sweep that cannot be composed or built, with its fault."""

    overrides: tuple[str, ...]
    fault: str


class Jobs:
    """The jobs of a command: a single job, or one per combination of values in a sweep.

    ``sweep`` is the folder of the sweep, None for a single job. ``read_run`` reads the run given by
    ``like=``. ``plugins`` holds the chosen launcher and sweeper of Hydra.
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
        sweeps = [override for override in parsed if likes and override.is_sweep_override()]
        firsts = [expand_values(override, config_dir)[0] for override in sweeps]
        self._base = self._compose_base([*common, *firsts])
        chosen = self._base.hydra.runtime.choices
        named = {kind: chosen.get(f"hydra/{kind}") for kind in PLUGINS}
        self.plugins = {kind: str(n) for kind, n in named.items() if n not in (None, "basic")}
        if self.plugins and likes:
            raise InputError(
                f"{text_of(likes[0])}: cannot be combined with a Hydra launcher or sweeper; "
                f"leave out one of the two"
            )
        if not self.plugins and self._base.hydra.get("callbacks"):
            raise InputError(
                "hydra.callbacks: Hydra callbacks are not supported; leave the key out"
            )
        self._overrides: list[tuple[str, ...]] = []
        # configurations of the first of the jobs that differ only in numbers, by other overrides
        self._composed: dict[tuple[str, ...], Configuration] = {}
        self.sweep: Path | None = None
        if multirun or self._base.hydra.mode == RunMode.MULTIRUN:
            if SWEEPER not in self.plugins:
                self._overrides = self._expand(parsed)
            self.sweep = _shorten(_read_path(self._base, "sweep.dir"))
        elif swept:
            raise InputError(f"{swept[0]}: several values need a sweep; add -m")

    def _compose_base(self, common: Sequence[str]) -> DictConfig:
        try:
            return self._compose(common, 0)
        except InputError:
            for text in common:
                if text.lstrip("+~").startswith("hydra.sweeper.params"):
                    raise InputError(
                        f"{text}: allowed only in an experiment's file; sweep over the key "
                        f"itself, as in seed=0,1"
                    ) from None
            raise

    def _compose(self, overrides: Sequence[str], index: int) -> DictConfig:
        primary, kept = self.primary, dict[str, str]()
        if self._read_run is not None:
            primary, kept = choose_primary(primary, overrides, self.config_dir, self._read_run)
        config = compose_with_hydra(overrides, self.config_dir, index, primary)
        with read_write(config.hydra):
            config.hydra.runtime.choices = {**kept, **config.hydra.runtime.choices}
        return config

    def _expand(self, parsed: Sequence[Override]) -> list[tuple[str, ...]]:
        """List the overrides of each job; typed values of a key replace the experiment's."""
        lists = {typed.get_key_element(): expand_values(typed, self.config_dir) for typed in parsed}
        params = (self._base.hydra.sweeper.get("params") or {}).items()
        for override in parse([f"{key}={value}" for key, value in params]):
            lists.setdefault(override.get_key_element(), expand_values(override, self.config_dir))
        count = math.prod(map(len, lists.values()))
        if count > _MAX_JOBS:
            raise InputError(
                f"the sweep has {count} jobs, more than {_MAX_JOBS}; sweep over fewer values"
            )
        return list(product(*lists.values()))

    def __len__(self) -> int:
        return 1 if self.sweep is None else len(self._overrides)

    @property
    def minimizes(self) -> bool:
        """True if the chosen sweeper minimizes the fitness."""
        direction = self._base.hydra.sweeper.get("direction")
        return str(getattr(direction, "name", direction)) == "minimize"

    def __iter__(self) -> Iterator[Job | RefusedJob]:
        if self.sweep is None:
            config = freeze(self._base, evaluates=self.primary == EVALUATE)
            yield place_job(config, _read_path(self._base, "run.dir"))
            return
        used: set[str] = set()
        for index, overrides in enumerate(self._overrides):
            try:
                config, name = self._compose_in_sweep(overrides, index)
            except EvorosError as error:
                yield RefusedJob(overrides, str(error))
                continue
            if name.casefold() in used:  # different values may have equal names
                name = f"{name}_{index}"
            used.add(name.casefold())
            yield place_job(config, self.sweep / name, overrides, in_sweep=True)

    def _compose_in_sweep(
        self, overrides: tuple[str, ...], index: int
    ) -> tuple[Configuration, str]:
        others, numbers = split_numbers(overrides)
        known = self._composed.get(others)
        config = None if known is None else change_numbers(known, numbers)
        if config is not None:
            return config, job_name(config.overrides)
        composed = self._compose(overrides, index)
        config = freeze(composed, evaluates=self.primary == EVALUATE)
        names = OmegaConf.to_yaml(composed.hydra.sweep, resolve=False)
        if numbers and f"subdir: {DEFAULT_NAME}\n" in names and not has_calls(composed):
            self._composed[others] = config
        return config, str(_read_path(composed, "sweep.subdir"))


def place_job(
    config: Configuration, folder: Path, overrides: tuple[str, ...] = (), *, in_sweep: bool = False
) -> Job:
    """Return the job of a configuration; with ``in_sweep``, its folder is in the sweep folder."""
    sweep = str(folder.absolute().parent) if in_sweep else None
    return Job(replace(config, sweep=sweep), _shorten(folder), overrides)


def _read_path(config: DictConfig, key: str) -> Path:
    try:
        return Path(OmegaConf.select(config.hydra, key))
    except OmegaConfBaseException as error:
        raise InputError(describe_error(error)) from error


def _shorten(path: Path) -> Path:
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def expand_values(override: Override, config_dir: str | Path | None) -> list[str]:
    """Return an override per value of a sweep; return other overrides unchanged."""
    typed, key = text_of(override), override.get_key_element()
    if not override.is_sweep_override():
        return [typed]
    if override.is_hydra_override():
        raise InputError(
            f"{typed}: can have only one value, because all jobs share it; type one value"
        )
    if override.is_delete():
        raise InputError(f"{typed}: removes a key, so it cannot sweep over values; type {key}")
    swept = override.value()
    if isinstance(swept, Glob):
        values = _match(swept, override, config_dir)
    elif not override.is_discrete_sweep():
        raise InputError(
            f"{typed}: only a sweeper can choose values from an interval(); write a list of values "
            f"or a range(), or choose a sweeper (hydra/sweeper=optuna)"
        )
    else:
        _check_values(typed, swept)
        values = [_write(value) for value in override.sweep_iterator()]
    if not values:
        raise InputError(f"{typed}: no values to sweep over; list at least one")
    return [f"{key}={value}" for value in values]


def _write(value: Any) -> str:
    """Write a value in Hydra's grammar, with quotes around a string such as ``1``."""
    text = Override._get_value_element_as_str(value)
    if isinstance(value, str):
        read = OverridesParser.create().parse_override(f"key={text}").value()
        return text if read == value else quote_value(value)
    return text


def _match(glob: Glob, override: Override, config_dir: str | Path | None) -> list[str]:
    typed, group = text_of(override), override.key_or_group
    choices = list_choices(group, config_dir)
    if not choices:
        raise InputError(
            f"{typed}: glob() needs a group, but {group} is not a group; write the values"
        )
    matches = glob.filter(choices)
    if not matches:
        raise InputError(
            f"{typed}: matches no choice of {group} ({', '.join(choices)}); correct the pattern"
        )
    return matches


def _check_values(typed: str, swept: object) -> None:
    if isinstance(swept, ChoiceSweep):
        if any(isinstance(value, Sweep | Glob) for value in swept.list):
            raise InputError(
                f"{typed}: nested sweeps are not supported; write all values in one sweep"
            )
    elif isinstance(swept, RangeSweep):
        start, stop, step = (float(value or 0) for value in (swept.start, swept.stop, swept.step))
        if not all(map(math.isfinite, (start, stop, step))) or step == 0:
            raise InputError(
                f"{typed}: range() must have finite ends and a nonzero step; write, for example, "
                "range(0,10,2)"
            )
        if (stop - start) / step > _MAX_JOBS:
            raise InputError(f"{typed}: must have at most {_MAX_JOBS} values; choose a larger step")


_TYPED = re.compile(r"([A-Za-z_]\w*(?:\.\w+)*)=(0|-?[1-9]\d{0,17}|-?\d{1,9}\.\d{1,20})")
_REFERENCE = re.compile(r"\$\{[^}]*")


def split_numbers(overrides: Sequence[str]) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the overrides with numeric values removed, and the original overrides by key."""
    matches = [_TYPED.fullmatch(text) for text in overrides]
    typed = {match[1]: match[0] for match in matches if match and match[1][:5] != "hydra"}
    kept = tuple(text.partition("=")[0] if text in typed.values() else text for text in overrides)
    return kept, typed


def change_numbers(config: Configuration, typed: Mapping[str, str]) -> Configuration | None:
    """Return the configuration with new numbers; None if other values may depend on these."""
    text, values = config.text, config.values
    references = _REFERENCE.findall(config.text)
    for key, override in typed.items():
        raw = override.partition("=")[2]
        number = float(raw) if "." in raw else int(raw)
        path = key.split(".")
        refers = any(part in reference for reference in references for part in (*path, "hydra"))
        changed = None if refers else _replace_line(text, path, number)
        if changed is None:
            return None
        text, values = changed, _replace_value(values, path, number)
    overrides = [typed.get(text.partition("=")[0], text) for text in config.overrides]
    return replace(config, text=text, values=values, overrides=tuple(overrides))


def _replace_line(text: str, path: Sequence[str], number: float) -> str | None:
    """Replace the number at a path in OmegaConf's YAML; None if the path holds no number."""
    begin, end, line = 0, len(text), None
    for depth, part in enumerate(path):
        indent = " " * 2 * depth
        line = re.compile(rf"(?m)^{indent}{re.escape(part)}:(.*)$").search(text, begin, end)
        if line is None:
            return None
        outside = re.compile(rf"(?m)^ {{0,{2 * depth}}}[^ -]").search(text, line.end(), end)
        begin, end = line.end(), outside.start() if outside else end
    if line is None or not re.fullmatch(r" -?\d[\d.e+-]*", line[1]):
        return None
    written = OmegaConf.to_yaml(OmegaConf.create([number])).removeprefix("- ").rstrip("\n")
    return f"{text[: line.start(1)]} {written}{text[line.end(1) :]}"


def _replace_value(values: Mapping[str, Any], path: Sequence[str], number: float) -> dict[str, Any]:
    first, *others = path
    inner = _replace_value(values[first], others, number) if others else number
    return {**values, first: inner}
