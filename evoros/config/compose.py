"""Composes configurations from ``conf/``, the user's folder and overrides."""

import hashlib
import logging
import re
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.object_type import ObjectType
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, OverrideType
from hydra.core.plugins import Plugins
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import DictConfig, ListConfig, OmegaConf, open_dict

from evoros.base.errors import InputError, quote_value
from evoros.config.configuration import VERSION_BASE, Configuration, build, freeze
from evoros.config.messages import describe_error, describe_unknown
from evoros.config.own_files import NAMED_FOLDERS, list_hidden
from evoros.config.references import register_resolver
from evoros.files.plugins import conf_folders
from evoros.files.resources import PACKAGE, bundled_folder, find_config_dir
from evoros.observers.protocol import Observer

_LOG = logging.getLogger(__name__)
_PATH = re.compile(r"[^][\s,'\"]*/([^][\s,'\"/]+)/*")
MAX_LENGTH = 100  # maximum length before the hash; file systems allow 255 bytes


def job_name(overrides: Sequence[str]) -> str:
    """Return a folder name such as failure-random_seed-0 for ``failure=random seed=0``.

    Only the last part of a key or path is used, followed by a digest for paths:
    ``designs=outputs/study/a`` -> designs-a-2cffc1. Without overrides, the name is ``baseline``.
    """
    parts = [_part(override) for override in overrides]
    name = "_".join(part for part in parts if part)
    if len(name) > MAX_LENGTH:
        name = f"{name[:MAX_LENGTH]}-{_hash(name, 8)}"
    return name or "baseline"


def _part(override: str) -> str:
    key, _, value = override.partition("=")
    key = re.split(r"[./]", key.lstrip("+~").split("@")[0])[-1]
    ends = _PATH.sub(r"\1", value)
    end = "" if ends == value else f"-{_hash(value, 6)}"
    value = re.sub(r"[^A-Za-z0-9._+-]+", "-", ends).strip("-.") + end
    key = re.sub(r"[^A-Za-z0-9._]+", "-", key).strip("-.")
    return f"{key}-{value}" if value else key


def _hash(text: str, digits: int) -> str:
    return hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()[:digits]


def _name_folder(overrides: ListConfig) -> str:
    # unresolved references reveal no secrets
    return job_name([str(override) for override in OmegaConf.to_container(overrides) or ()])


register_resolver("evoros.name", _name_folder)


class PluginFolders(SearchPathPlugin):
    """Adds the configuration groups of plug-ins to Hydra's search path."""

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        """Add the folders."""
        for folder in conf_folders()[1:]:
            search_path.append("evoros", f"file://{folder}")


Plugins.instance().register(PluginFolders)


def compose(
    overrides: Sequence[str] = (), *, config_dir: str | Path | None = None
) -> Configuration:
    """Compose the configuration that the command ``evoros`` would use for these overrides.

    ``config_dir`` is a folder with your groups and experiments, as with ``--config-dir``. Unknown
    keys, groups and options, malformed YAML and unresolved references raise an InputError.
    """
    return freeze(compose_with_hydra(overrides, config_dir))


def compose_with_hydra(
    overrides: Sequence[str],
    config_dir: str | Path | None = None,
    index: int = 0,
    primary: str = "config",
) -> DictConfig:
    """Compose with the section ``hydra`` of a job; ``${hydra:...}`` refers to the last result."""
    extra = [] if config_dir is None else [search_path(config_dir)]
    try:
        with initialize():
            config = hydra_compose(
                primary, overrides=[*extra, *overrides], return_hydra_config=True
            )
        with open_dict(config):
            config.hydra.job.num = index
        HydraConfig.instance().set_config(config)
    except Exception as error:  # Hydra also raises ValueError, TypeError, AssertionError and others
        unknown = _find_unknown(extra, overrides, primary)
        raise InputError(unknown or describe_error(error)) from error
    return config


def _find_unknown(extra: Sequence[str], overrides: Sequence[str], primary: str) -> str:
    """Describe the first overridden key that does not exist; empty if all exist."""
    try:
        parsed = OverridesParser.create().parse_overrides(list(overrides))
        folders = [*conf_folders(), *NAMED_FOLDERS]
        changes = [
            given
            for given in parsed
            if given.type is OverrideType.CHANGE
            and "/" not in given.key_or_group
            and not any((folder / given.key_or_group).is_dir() for folder in folders)
        ]
        others = [text_of(given) for given in parsed if given not in changes]
        with initialize():
            config = hydra_compose(primary, [*extra, *others], return_hydra_config=True)
    except Exception:  # the error is not about a key
        return ""
    faults = (describe_unknown(config, given.key_or_group) for given in changes)
    return next(filter(None, faults), "")


def list_choices(group: str, config_dir: str | Path | None = None) -> list[str]:
    """List the options of a group, bundled or the user's; empty if the group is unknown."""
    added = [] if config_dir is None else (add_config_dir(config_dir) / group).glob("*.yaml")
    with initialize():
        bundled = GlobalHydra.instance().config_loader().get_group_options(group, ObjectType.CONFIG)
    return sorted({*bundled, *(file.stem for file in added)})


def initialize() -> AbstractContextManager[None]:
    """Return a context in which ``conf/`` is the folder of Hydra's global state."""
    GlobalHydra.instance().clear()
    context: AbstractContextManager[None] = initialize_config_dir(
        str(bundled_folder("conf")), "evoros", **VERSION_BASE
    )
    return context


def search_path(config_dir: str | Path) -> str:
    """Return the override that adds a user's folder; make the modules in it importable."""
    folder = add_config_dir(config_dir)
    for bundled, hidden in list_hidden(folder):
        _LOG.warning(
            "%s: not used, because %s has the same name; rename your file", hidden, bundled
        )
    return f"hydra.searchpath=[{quote_value(f'file://{folder}')}]"


def parse(overrides: Sequence[str]) -> list[Override]:
    """Parse overrides with Hydra's grammar."""
    try:
        parsed = OverridesParser.create().parse_overrides(list(overrides))
    except Exception as error:
        raise InputError(describe_error(error)) from error
    for override in parsed:
        if override.is_sweep_override():
            continue
        value = override.value()
        names = value if isinstance(value, list) else [value]
        group = any((folder / override.key_or_group).is_dir() for folder in conf_folders())
        selects = group and not override.is_delete()
        if selects and not all(isinstance(name, str) for name in names):
            raise InputError(
                f"{override.key_or_group}: must be one of the group's choices, not {value}; "
                "evoros --help lists them"
            )
    return parsed


def text_of(override: Override) -> str:
    """Return an override as typed."""
    return override.input_line or ""


def add_config_dir(path: str | Path) -> Path:
    """Make the modules in a user's configuration folder importable; return its full path."""
    folder = find_config_dir(path)
    if str(folder) not in sys.path:  # spawned workers inherit sys.path
        # The folder must precede the checkout, where packages such as analysis/ would hide its
        # modules.
        places = [Path(entry).resolve() for entry in sys.path]
        index = places.index(PACKAGE.parent) if PACKAGE.parent in places else len(places)
        sys.path.insert(index, str(folder))
    if folder not in NAMED_FOLDERS:
        NAMED_FOLDERS.append(folder)
    return folder


def build_observer(name: str, overrides: Sequence[str], config_dir: str | Path | None) -> Observer:
    """Build the observer ``name``; ``overrides`` are relative to its key."""
    typed = [f"observers.{name}.{text}" for text in overrides]
    config = compose([f"observers={name}", *typed], config_dir=config_dir)
    observer = build(config.values["observers"], config.choices).get(name)
    if not isinstance(observer, Observer):
        raise InputError(
            f"observers/{name}.yaml: must have the key {name} with an observer's class; choose "
            f"another tracker, or change the file"
        )
    return observer
