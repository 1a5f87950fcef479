"""A composed configuration, and the experiment that is built from it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf

from evoros.base.errors import InputError
from evoros.config.hydra_versions import allow
from evoros.config.messages import describe_build_error, describe_error, find_unresolved
from evoros.config.own_files import NAMED_FOLDERS, find_key
from evoros.config.targets import check_targets
from evoros.evolution.experiment import Experiment


@dataclass(frozen=True)
class Configuration:
    """A composed configuration of a run or an evaluation, without Hydra's own part.

    ``choices`` has entries such as ``failure: spatial``; a group that is placed elsewhere has the
    place in its name, as in ``filter@failure.effect: stuck``.
    """

    text: str  # content of config.yaml: YAML, references ``${...}`` unresolved
    values: Mapping[str, Any] = field(repr=False)  # references resolved; may hold secrets
    choices: Mapping[str, str] = field(default_factory=dict)  # the chosen file of each group
    overrides: Sequence[str] = ()  # as typed, references unresolved
    designs: Any = None  # the key ``designs`` of an evaluation; not in ``text`` and ``values``
    like: str | None = None  # likewise the key ``like``
    config_dir: str | None = None  # the user's folder that it was composed with
    sweep: str | None = None  # the folder of the sweep that it is a job of

    def build(self) -> Experiment:
        """Build the experiment. This imports and calls the classes that the configuration names.

        Raises:
            InputError: a value or a file cannot be used, or a class is neither of evoros nor of a
                folder that was named as ``config_dir``.
        """
        experiment = build(self.values, self.choices)
        if not isinstance(experiment, Experiment):
            raise InputError(
                f"_target_: must be evoros.evolution.experiment.Experiment, not "
                f"{self.values.get('_target_')!r}; keep the one of conf/config.yaml"
            )
        return experiment


def build(values: Mapping[str, Any], choices: Mapping[str, str]) -> Any:
    """Build the class that ``values`` name, and those in them. ``choices`` are for messages.

    Raises:
        InputError: a value or a file cannot be used, or a class is neither of evoros nor of a
            folder that was named as ``config_dir``.
    """
    targets = check_targets(values, NAMED_FOLDERS)
    try:
        return instantiate(dict(values), _convert_="all", **allow(targets))
    except Exception as error:
        message = describe_build_error(error)
        unknown = re.match(r"(\S*?):? ?unknown key '(\w+)'", message)
        files = find_key(unknown[1], unknown[2], choices) if unknown else []
        place = f" in {' or '.join(map(str, files))}" if files else ""
        raise InputError(f"{message}{place}") from error


def freeze(config: DictConfig, evaluates: bool = False) -> Configuration:
    """Resolve the references of a configuration and drop Hydra's own part of it.

    If it ``evaluates``, the keys ``designs`` and ``like`` become the fields of these names. The
    text keeps the references, so that no secret of the environment reaches the disk.
    """
    hidden = ("hydra", "designs", "like") if evaluates else ("hydra",)
    shown = OmegaConf.masked_copy(config, [str(key) for key in config if key not in hidden])
    designs = config.get("designs") if evaluates else None
    if OmegaConf.is_config(designs):
        designs = OmegaConf.to_container(designs, resolve=True)
    return Configuration(
        OmegaConf.to_yaml(shown, resolve=False),
        resolve(shown),
        _choices(config),
        _list_overrides(config),
        designs,
        config.get("like") if evaluates else None,
        _find_config_dir(config),
    )


def resolve(config: DictConfig) -> dict[str, Any]:
    """Return the values of a configuration with its references resolved.

    Raises:
        InputError: a reference leads nowhere.
    """
    try:
        values = OmegaConf.to_container(config, resolve=True)
    except Exception as error:  # resolvers raise anything
        key = find_unresolved(config)
        raise InputError(
            f"{key}: {describe_error(error)}" if key else describe_error(error)
        ) from error
    assert isinstance(values, dict)
    return {str(key): value for key, value in values.items()}


def _list_overrides(config: DictConfig) -> tuple[str, ...]:
    """Return the overrides as typed; nothing if ``config`` was not composed."""
    typed = OmegaConf.select(config, "hydra.overrides.task")
    listed = OmegaConf.to_container(typed, resolve=False) if OmegaConf.is_config(typed) else []
    return tuple(map(str, listed)) if isinstance(listed, list) else ()


def _find_config_dir(config: DictConfig) -> str | None:
    """Return the user's folder; None if there was none, or ``config`` was not composed."""
    places = [str(place) for place in OmegaConf.select(config, "hydra.searchpath") or ()]
    return places[0].removeprefix("file://") if places else None


def _choices(config: DictConfig) -> dict[str, str]:
    """Return the chosen file of each group that is not Hydra's; none if it was not composed.

    A group without a choice (null) is left out.
    """
    choices = OmegaConf.select(config, "hydra.runtime.choices") or {}
    return {
        str(group): str(choice)
        for group, choice in choices.items()
        if choice is not None and not str(group).startswith("hydra/")
    }
