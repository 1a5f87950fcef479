"""Composes an evaluation from a recorded run, which replaces the primary file."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from hydra.core.config_store import ConfigStore
from hydra.core.override_parser.types import Override
from omegaconf import DictConfig, OmegaConf

from evoros.base.errors import InputError
from evoros.config.compose import parse, text_of
from evoros.config.references import resolve
from evoros.files.plugins import conf_folders
from evoros.files.resources import bundled_folder, expand_home

EVALUATE = "evaluate"  # primary file of evaluations; only it has the keys ``designs`` and ``like``
LIKE = "like"
NAME = "recorded"  # name of the recorded values in Hydra's store


@dataclass(frozen=True)
class RecordedRun:
    """The content of a run's ``config.yaml``, and the option chosen in each group."""

    text: str
    choices: Mapping[str, str]


ReadRun: TypeAlias = Callable[[str, frozenset[str]], RecordedRun]
"""Reads a run, or a sweep whose runs may differ in the keys of the second argument."""


def choose_primary(
    primary: str, overrides: Sequence[str], config_dir: str | Path | None, read: ReadRun
) -> tuple[str, dict[str, str]]:
    """Return the primary file (the recorded one with ``like=``), and recorded choices to keep."""
    if primary != EVALUATE or not any(text.startswith(f"{LIKE}=") for text in overrides):
        return primary, {}
    like = next(override for override in parse(overrides) if override.key_or_group == LIKE)
    return NAME, store_recorded(like, overrides, config_dir, read)


def store_recorded(
    like: Override, overrides: Sequence[str], config_dir: str | Path | None, read: ReadRun
) -> dict[str, str]:
    """Store a recorded configuration as the primary file ``NAME``; return remaining choices."""
    source = resolve(OmegaConf.create({LIKE: like.value()}))[LIKE]
    if not isinstance(source, str) or not source:
        raise InputError(f"{text_of(like)}: must be the folder of a run; correct the path")
    typed = [given for given in parse(overrides) if not given.key_or_group.startswith("hydra")]
    _refuse_experiments(typed)
    recorded = read(source, frozenset(_place(given) for given in typed))
    folders = [*conf_folders(), *([] if config_dir is None else [expand_home(config_dir)])]
    groups = [given for given in typed if any((f / given.key_or_group).is_dir() for f in folders)]
    replaced = {_place(given) for given in groups if not given.is_add()}
    config = OmegaConf.create(recorded.text)
    for place in replaced:
        _drop(config, place)
    values = OmegaConf.to_container(config, resolve=False)
    assert isinstance(values, dict)
    defaults: list[Any] = ["_self_"]
    for given in groups:  # the file of an outer group lists the inner groups
        place = _place(given)
        if place in replaced and not is_below(place, replaced - {place}):
            defaults.append({given.get_key_element().lstrip("~"): None})
    primary = _read_primary(defaults)
    ConfigStore.instance().store(NAME, values | primary | {"designs": source, LIKE: source})
    kept = recorded.choices.items()
    return {key: file for key, file in kept if not is_below(find_place(key), replaced)}


def is_below(key: str, places: Iterable[str]) -> bool:
    """Return True if a dotted key equals one of ``places`` or is below one."""
    return any(key == place or key.startswith(f"{place}.") for place in places)


def _refuse_experiments(typed: Collection[Override]) -> None:
    for given in typed:
        if given.key_or_group == "experiment":
            raise InputError(
                f"{text_of(given)}: cannot be combined with like=, which gives the whole "
                f"configuration; leave out one of the two"
            )


def _place(given: Override) -> str:
    """Return the dotted key that an override sets, or at which its file is placed."""
    return given.package or given.key_or_group.replace("/", ".")


def find_place(key: str) -> str:
    """Return the dotted key of a recorded choice, such as ``filter@failure.effect``."""
    group, _, place = key.partition("@")
    return place or group.replace("/", ".")


def _drop(config: Any, place: str) -> None:
    outer, _, last = place.rpartition(".")
    parent = OmegaConf.select(config, outer) if outer else config
    if isinstance(parent, DictConfig):
        parent.pop(last, None)


def _read_primary(defaults: Sequence[Any]) -> dict[str, Any]:
    files = [bundled_folder("conf") / f"{name}.yaml" for name in ("config", "evaluate")]
    base, own = map(OmegaConf.load, files)
    hydra = [entry for entry in base.defaults if any("hydra/" in str(key) for key in entry)]
    own.hydra = base.hydra
    own.defaults = [*defaults, *hydra]
    content = OmegaConf.to_container(own, resolve=False)
    assert isinstance(content, dict)
    return {str(key): value for key, value in content.items()}
