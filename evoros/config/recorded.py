"""The recorded configuration in a run folder, and the overrides allowed on resuming."""

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
from evoros.config.configuration import Configuration, freeze
from evoros.config.messages import describe_error
from evoros.config.references import map_texts, resolve
from evoros.files.nested import read_yaml
from evoros.mission.plan import GENERATIONS, VALIDATION_TRIALS, count_growing
from evoros.observers.protocol import FREE


def read_recorded(path: Path) -> Configuration:
    """Read a recorded ``config.yaml``, without ``choices``; ``text`` is the content of the file."""
    tree, text = _load(path)
    return Configuration(text, resolve(_create(tree)))


def relocate_recorded(path: Path, relocate: Callable[[str], str]) -> Configuration:
    """Read a recorded ``config.yaml``, and relocate all strings, including resolved references."""
    recorded = read_recorded(path)
    tree = _parse(recorded.text)
    moved = map_texts(tree, relocate)
    text = recorded.text if moved == tree else OmegaConf.to_yaml(_create(moved), resolve=False)
    values: dict[str, Any] = map_texts(recorded.values, relocate)
    return replace(recorded, text=text, values=values)


def replace_recorded(recorded: Configuration, changes: Mapping[str, Any]) -> Configuration:
    """Return the configuration with new values for some top-level keys."""
    return freeze(_create({**_parse(recorded.text), **changes}))


def flatten_recorded(path: Path) -> dict[str, Any]:
    """Read the values of a recorded ``config.yaml`` by dotted key, without resolving references."""
    return _flatten(_load(path)[0])


def _load(path: Path) -> tuple[dict[str, Any], str]:
    try:
        tree, text = read_yaml(path)
        tree = _parse(text) if isinstance(tree, dict) else None
    except ValueError as error:
        raise InputError(
            f"{path}: not valid YAML ({single_line(error)}); restore the file"
        ) from error
    except Exception as error:
        raise InputError(f"{path}: {describe_error(error)}") from error
    if not isinstance(tree, dict):
        raise InputError(f"{path}: must be a mapping of keys to values; restore the file")
    return tree, text


@lru_cache(maxsize=8)
def _parse(text: str) -> Any:
    """Parse YAML with OmegaConf (0.1 s); callers must not modify the cached result."""
    config = OmegaConf.create(text)
    return OmegaConf.to_container(config, resolve=False)


def _create(tree: dict[str, Any]) -> DictConfig:
    return OmegaConf.create(tree)


def find_difference(
    recorded: Configuration, wanted: Configuration, free: Sequence[str] = FREE
) -> str:
    """Describe the first difference outside ``free`` parts; empty if there is none."""
    before, now = flatten(recorded), flatten(wanted)
    for key in list_differences(before, now, free):
        return f"{key} is {now.get(key)!r}, but was {before.get(key)!r}"
    return ""


def list_differences(
    one: Mapping[str, Any], other: Mapping[str, Any], free: Sequence[str]
) -> list[str]:
    """List the keys outside ``free`` parts whose values differ between two flat mappings."""
    return [
        key
        for key in dict.fromkeys((*other, *one))
        if key.partition(".")[0] not in free and one.get(key) != other.get(key)
    ]


def flatten(config: Configuration) -> dict[str, Any]:
    """Return the values of a configuration by dotted key, without resolving references."""
    return _flatten(_parse(config.text))


def _flatten(value: Any, above: str = "") -> dict[str, Any]:
    if not isinstance(value, dict) or not value:
        return {above: value}
    flat: dict[str, Any] = {}
    for key, inner in value.items():
        flat |= _flatten(inner, f"{above}.{key}" if above else str(key))
    return flat


def override_recorded(
    recorded: Configuration, overrides: Sequence[str], config_dir: str | Path | None, growing: str
) -> tuple[Configuration, int | None]:
    """Apply overrides to a recorded configuration; return it and the new value of ``growing``.

    Overrides may change the executor and the observers of a search, and increase the key
    ``growing``. The returned value is None if this key is not overridden.
    """
    if not overrides:
        return recorded, None
    config = _create(_parse(recorded.text))
    free = FREE if growing == GENERATIONS else FREE[:1]  # otherwise only the first key can change
    number = None
    for override in parse(overrides):
        key, value = override.key_or_group, override.value()
        changes = override.type is OverrideType.CHANGE and not override.is_sweep_override()
        if changes and key in free:
            config[key] = compose_with_hydra([text_of(override)], config_dir)[key]
        elif changes and key.partition(".")[0] in free:
            OmegaConf.update(config, key, value, force_add=True)
        elif changes and key == growing:
            number = _check_number(key, value, count_growing(recorded.values, key))
            _check_maximum(key, number, recorded.values)
            OmegaConf.update(config, key, number)
        else:
            raise _refused(override, free, growing)
    return freeze(config), number


def _check_number(key: str, value: object, recorded: int) -> int:
    if not isinstance(value, int) or not is_whole(value) or value < recorded:
        raise InputError(
            f"{key}: must be an integer >= {recorded} (the run already has "
            f"{recorded}), not {value!r}; a run can be extended but not shortened"
        )
    return value


def _check_maximum(key: str, number: int, values: Mapping[str, Any]) -> None:
    maximum = values["validation"]["max_trials"] if key == VALIDATION_TRIALS else number
    if number > maximum:
        raise InputError(
            f"{key}: must be at most validation.max_trials ({maximum}), not {number}; start a new "
            f"evaluation with {key}={number} validation.max_trials={number}"
        )


def _refused(override: Override, free: Sequence[str], growing: str) -> InputError:
    allowed = ", ".join(f"{key}, {key}.*" for key in free)
    return InputError(
        f"{text_of(override)}: resume accepts only {allowed} and a larger {growing}; to change "
        f"other keys, start a new run"
    )
