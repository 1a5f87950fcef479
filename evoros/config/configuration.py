"""A composed configuration, the classes it may name, and the experiment built from it."""

import logging
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.machinery import PathFinder
from inspect import Parameter, signature
from pathlib import Path
from typing import Any

from hydra.utils import get_object, instantiate
from omegaconf import DictConfig, OmegaConf

from evoros.base.errors import InputError
from evoros.config.messages import describe_build_error, name_owners
from evoros.config.own_files import NAMED_FOLDERS, find_key
from evoros.config.references import IS_LATER, settle
from evoros.evolution.experiment import Experiment
from evoros.files.plugins import conf_folders
from evoros.formats.notes import WORLD_KEYS

# Hydra 1.4 and later have only these defaults
VERSION_BASE: Mapping[str, Any] = {} if IS_LATER else {"version_base": "1.3"}


@dataclass(frozen=True)
class Configuration:
    """The composed configuration of a run, without the section ``hydra``.

    ``choices`` has entries such as ``failure: spatial``; if a group is placed in another package,
    the key names it, as in ``filter@failure.effect: stuck``.
    """

    text: str  # content of config.yaml; references to keys and secrets are unresolved
    values: Mapping[str, Any] = field(repr=False)  # references resolved; may contain secrets
    choices: Mapping[str, str] = field(default_factory=dict)  # option chosen in each group
    overrides: Sequence[str] = ()  # typed overrides with unresolved references
    designs: Any = None  # key ``designs`` of an evaluation; not in ``text`` or ``values``
    like: str | None = None  # key ``like`` of an evaluation
    evaluates: bool = False  # whether the run evaluates given designs
    config_dir: str | None = None  # the user's configuration folder
    sweep: str | None = None  # folder of this job's sweep

    def build(self) -> Experiment:
        """Build the experiment by importing and calling the classes named in the configuration."""
        experiment = build(self.values, self.choices)
        if not isinstance(experiment, Experiment):
            raise InputError(
                f"_target_: must be evoros.evolution.experiment.Experiment, not "
                f"{self.values.get('_target_')!r}; restore the value in conf/config.yaml"
            )
        return experiment

    def rebuild(self, experiment: Experiment, keys: Sequence[str]) -> Experiment:
        """Build the experiment from ``experiment``, which differs only in ``keys``."""
        parts = {key: self.values[key] for key in keys if key in self.values}
        built = {
            key: build(part, {}) if isinstance(part, Mapping) and TARGET in part else part
            for key, part in parts.items()
        }
        return replace(experiment, **built)


def build(values: Mapping[str, Any], choices: Mapping[str, str]) -> Any:
    """Instantiate the classes named in ``values``; ``choices`` is for error messages."""
    targets = check_classes(values, choices)
    worlds = values.get("world")
    names = [*worlds] if isinstance(worlds, Mapping) else []
    # the world's configuration may lack the suggested keys, hence ``++``
    token = WORLD_KEYS.set(f"++world.{names[0]}." if len(names) == 1 else WORLD_KEYS.get())
    try:
        return instantiate(dict(values), _convert_="all", **allow(targets))
    except (Exception, SystemExit) as error:
        raise InputError(describe_build_error(error)) from error
    finally:
        WORLD_KEYS.reset(token)


def check_classes(values: Mapping[str, Any], choices: Mapping[str, str]) -> tuple[str, ...]:
    """Check the classes in a configuration without instantiating any; return their names."""
    targets = check_targets(values, NAMED_FOLDERS)
    _check_arguments(values, "", choices)
    return targets


def _check_arguments(node: Any, key: str, choices: Mapping[str, str]) -> None:
    inner = enumerate(node) if isinstance(node, list) else ()
    for name, value in node.items() if isinstance(node, Mapping) else inner:
        _check_arguments(value, f"{key}.{name}" if key else str(name), choices)
    if not isinstance(node, Mapping) or TARGET not in node:
        return
    where = f"{key}: " if key else ""
    parameters = signature(get_object(node[TARGET])).parameters
    kinds = {parameter.kind for parameter in parameters.values()}
    names = node if Parameter.VAR_KEYWORD not in kinds else ()
    unknown = [name for name in names if name not in parameters and not name.startswith("_")]
    if unknown:
        raise InputError(f"{where}{_describe_unknown(key, unknown, choices)}")
    for name, parameter in parameters.items() if not node.get("_partial_") else ():
        is_named = parameter.kind in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)
        if is_named and parameter.default is Parameter.empty and not {name, "_args_"} & node.keys():
            raise InputError(_describe_missing(key, name))


def _describe_unknown(key: str, names: Sequence[str], choices: Mapping[str, str]) -> str:
    """Describe the first unknown key, and how to drop all keys of the other options."""
    files = find_key(key, names[0], choices)
    place = f" in {' or '.join(map(str, files))}" if files else ""
    fix = f"remove it or correct its spelling{place}"
    if owners := name_owners(key, names[0]):
        drops = " ".join(f"~{key}.{name}" for name in names if name_owners(key, name))
        fix = f"{owners}; remove it{place}, or type {drops}"
    return f"unknown key {names[0]!r}; {fix}"


def _describe_missing(key: str, name: str) -> str:
    files = (file for folder in conf_folders() for file in folder.glob(f"{name}/*.yaml"))
    choices = sorted(file.stem for file in files)
    if choices and not key:
        return (
            f"{name}: no choice was made; type {name}=NAME, where NAME is one of: "
            f"{', '.join(choices)}"
        )
    return f"{key}: missing key {name!r}; add it" if key else f"missing key {name!r}; add it"


def freeze(config: DictConfig, evaluates: bool = False) -> Configuration:
    """Resolve the references of a configuration, and drop the section ``hydra``."""
    hidden = ("hydra", "designs", "like") if evaluates else ("hydra",)
    shown = OmegaConf.masked_copy(config, [str(key) for key in config if key not in hidden])
    designs = config.get("designs") if evaluates else None
    if OmegaConf.is_config(designs):
        designs = OmegaConf.to_container(designs, resolve=True)
    text, values = settle(shown)
    # recorded configurations have no section ``hydra``
    typed = OmegaConf.select(config, "hydra.overrides.task")
    listed: Any = OmegaConf.to_container(typed, resolve=False) if typed else ()
    choices = OmegaConf.select(config, "hydra.runtime.choices") or {}
    places = OmegaConf.select(config, "hydra.searchpath") or ()
    return Configuration(
        text,
        values,
        {
            str(k): str(v)
            for k, v in choices.items()
            if v is not None and not str(k).startswith("hydra/")
        },
        tuple(map(str, listed)),
        designs,
        config.get("like") if evaluates else None,
        evaluates,
        next((str(place).removeprefix("file://") for place in places), None),
    )


def allow(targets: Sequence[str]) -> Mapping[str, Any]:
    """Return the argument that restricts ``instantiate`` to these classes; empty in Hydra 1.3."""
    return {"_execution_whitelist_": tuple(targets)} if IS_LATER else {}


# keeps Hydra from printing errors
logging.getLogger(get_object.__module__).addHandler(logging.NullHandler())
TARGET = "_target_"
OWN = "evoros"
ROOMS = (
    *("allocation", "certificate", "controller", "design", "drive", "evolution", "executor"),
    *("failure", "field", "filter", "fitness", "measure", "observers", "optimizer"),
    *("requirement", "robot", "sensor", "simulator", "world"),
)
"""Packages with parts that configurations may name; creating a part has no side effects."""


def check_targets(
    values: Mapping[str, Any], folders: Sequence[Path], where: Path | None = None
) -> tuple[str, ...]:
    """Check that each named class is in evoros or in one of the folders; return the names."""
    named = dict(_list_targets(values, ""))
    for key, target in named.items():
        problem = _find_problem(target, folders)
        if problem:
            place = key if where is None else f"{where}: {key}"
            raise InputError(f"{place}: {problem}")
    return tuple(dict.fromkeys(named.values()))


def _list_targets(node: Any, key: str) -> Iterator[tuple[str, Any]]:
    if isinstance(node, Mapping):
        for name, value in node.items():
            inner = f"{key}.{name}" if key else str(name)
            if name == TARGET:
                yield inner, value
            else:
                yield from _list_targets(value, inner)
    elif isinstance(node, list | tuple):
        for index, value in enumerate(node):
            yield from _list_targets(value, f"{key}[{index}]")


def _find_problem(target: Any, folders: Sequence[Path]) -> str:
    """Return why ``target`` must not be instantiated; empty if it may be."""
    if not isinstance(target, str):
        return f"must be the name of a class, not {target!r}; type MODULE.CLASS"
    first = target.partition(".")[0]
    is_bundled = target in _list_bundled()
    if first != OWN and not is_bundled and not _is_in(first, folders):
        return (
            f"must be a class in evoros or in a folder given with --config-dir, not {target}: "
            "instantiating a class runs its code. If you trust the code, add --config-dir with "
            f"the folder that contains the module {first}"
        )
    try:
        named = get_object(target)
    except (Exception, SystemExit) as error:  # importing a user's module may raise any exception
        return describe_build_error(error)
    package, room = (*str(getattr(named, "__module__", "")).split("."), "")[:2]
    if package == OWN:
        is_part = isinstance(named, type) and room in ROOMS
    else:
        is_part = first != OWN and _is_in(package, folders)
    if is_part or is_bundled:
        return ""
    return f"{target} is not the class of a part; name the class of a part"


def _is_in(module: str, folders: Sequence[Path]) -> bool:
    spec = PathFinder.find_spec(module) if module else None
    origins = [spec.origin, *(spec.submodule_search_locations or ())] if spec else []
    paths = [Path(origin).resolve() for origin in origins if origin]
    return any(path.is_relative_to(folder) for path in paths for folder in folders)


@cache
def _list_bundled() -> frozenset[str]:
    files = (file for folder in conf_folders() for file in folder.rglob("*.yaml"))
    texts = (file.read_text(encoding="utf-8") for file in files)
    pattern = rf"{TARGET}: *([\w.]+)"
    return frozenset(name for text in texts for name in re.findall(pattern, text))
