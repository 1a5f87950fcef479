"""Reads the configuration that a folder has recorded, and applies what resuming may change."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from hydra.core.override_parser.types import Override, OverrideType
from omegaconf import DictConfig, OmegaConf

from evoros.base.checks import is_whole
from evoros.base.errors import InputError, single_line
from evoros.config.compose import compose_with_hydra, parse, text_of
from evoros.config.configuration import Configuration, freeze, resolve
from evoros.config.messages import describe_error
from evoros.files.nested import read_yaml
from evoros.observers.protocol import FREE

GENERATIONS = "optimizer.generations"


def read_recorded(path: Path) -> Configuration:
    """Read a recorded ``config.yaml``, without ``choices``. ``text`` is the text of the file."""
    tree, text = _load(path)
    return Configuration(text, resolve(_create(tree)))


def relocate_recorded(path: Path, relocate: Callable[[str], str]) -> Configuration:
    """Read a recorded ``config.yaml`` with each text in it, and in what it refers to, relocated."""
    recorded = read_recorded(path)
    tree = _parse(recorded.text)
    moved = map_texts(tree, relocate)
    text = recorded.text if moved == tree else OmegaConf.to_yaml(_create(moved), resolve=False)
    values: dict[str, Any] = map_texts(recorded.values, relocate)
    return replace(recorded, text=text, values=values)


def map_texts(node: Any, change: Callable[[str], str]) -> Any:
    """Return a tree of values with each text in it changed."""
    if isinstance(node, Mapping):
        return {key: map_texts(value, change) for key, value in node.items()}
    if isinstance(node, list | tuple):
        return [map_texts(value, change) for value in node]
    return change(node) if isinstance(node, str) else node


def flatten_recorded(path: Path) -> dict[str, Any]:
    """Read the values of a recorded ``config.yaml`` by dotted key; its references stay as text."""
    return _flatten(_load(path)[0])


def _load(path: Path) -> tuple[dict[str, Any], str]:
    try:
        tree, text = read_yaml(path)
        tree = _parse(text) if isinstance(tree, dict) else None
    except ValueError as error:
        raise InputError(
            f"{path}: must be YAML as evoros wrote it ({single_line(error)}); restore the file"
        ) from error
    except Exception as error:
        raise InputError(f"{path}: {describe_error(error)}") from error
    if not isinstance(tree, dict):
        raise InputError(f"{path}: must be a mapping of keys to values; restore the file")
    return tree, text


@lru_cache(maxsize=8)
def _parse(text: str) -> Any:
    """Parse by OmegaConf's rules, which takes a tenth of a second; nobody changes the result."""
    config = OmegaConf.create(text)
    return OmegaConf.to_container(config, resolve=False)


def _create(tree: dict[str, Any]) -> DictConfig:
    config = OmegaConf.create(tree)
    assert isinstance(config, DictConfig)
    return config


def find_difference(recorded: Configuration, wanted: Configuration) -> str:
    """Describe the first key whose value is another one in a wanted configuration; or ''.

    The executor and the observers do not count, because no result depends on them.
    """
    before, now = flatten(recorded), flatten(wanted)
    for key in list_differences(before, now, FREE):
        return f"{key} is {now.get(key)!r}, which was {before.get(key)!r}"
    return ""


def list_differences(
    one: Mapping[str, Any], other: Mapping[str, Any], free: Sequence[str]
) -> list[str]:
    """List the keys with different values in two flat configurations, but for ``free`` parts."""
    return [
        key
        for key in dict.fromkeys((*other, *one))
        if key.partition(".")[0] not in free and one.get(key) != other.get(key)
    ]


def flatten(config: Configuration) -> dict[str, Any]:
    """Return the values of a configuration by dotted key; its references stay as text."""
    return _flatten(_parse(config.text))


def _flatten(value: Any, above: str = "") -> dict[str, Any]:
    """Return the values of nested mappings by their keys, as in ``optimizer.generations``."""
    if not isinstance(value, dict) or not value:
        return {above: value}
    flat: dict[str, Any] = {}
    for key, inner in value.items():
        flat |= _flatten(inner, f"{above}.{key}" if above else str(key))
    return flat


def override_recorded(
    recorded: Configuration,
    overrides: Sequence[str],
    config_dir: str | Path | None,
    extendable: bool,
) -> tuple[Configuration, int | None]:
    """Apply overrides to a recorded configuration, and return the new number of generations, too.

    Only the executor may change and, if the work is ``extendable``, so may the observers, and
    ``optimizer.generations`` may grow; the number is None if it was not overridden.
    """
    if not overrides:
        return recorded, None
    config = _create(_parse(recorded.text))
    free = FREE if extendable else FREE[:1]  # an evaluation has no observers
    generations = None
    for override in parse(overrides):
        key, value = override.key_or_group, override.value()
        changes = override.type is OverrideType.CHANGE and not override.is_sweep_override()
        if changes and key in free:
            config[key] = compose_with_hydra([text_of(override)], config_dir)[key]
        elif changes and key.partition(".")[0] in free:
            OmegaConf.update(config, key, value, force_add=True)
        elif changes and extendable and key == GENERATIONS:
            generations = _check_generations(value, OmegaConf.select(config, key))
            config.optimizer.generations = generations
        else:
            raise _refused(override, free, extendable)
    return freeze(config), generations


def _check_generations(value: object, recorded: int) -> int:
    if not isinstance(value, int) or not is_whole(value) or value < recorded:
        raise InputError(
            f"{GENERATIONS}: must be a whole number of at least {recorded}, which the run already "
            f"has, not {value!r}; a run can only be extended"
        )
    return value


def _refused(override: Override, free: Sequence[str], extendable: bool) -> InputError:
    allowed = ", ".join(f"{key}, {key}.*" for key in free)
    allowed += f" and a larger {GENERATIONS}" if extendable else ""
    return InputError(
        f"{text_of(override)}: only {allowed} go with resume; the rest is the run's own; start a "
        f"new run to change it"
    )
