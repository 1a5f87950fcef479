"""Composes configurations from ``conf/``, the user's folder and overrides. Runs nothing.

Every error is an InputError of one line (``messages.py``).
"""

import copyreg
import hashlib
import logging
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.object_type import ObjectType
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from omegaconf import DictConfig, ListConfig, OmegaConf, open_dict

from evoros.base.errors import InputError
from evoros.config.configuration import Configuration, freeze
from evoros.config.hydra_versions import VERSION_BASE, register_resolver
from evoros.config.messages import describe_error
from evoros.config.own_files import NAMED_FOLDERS, list_hidden
from evoros.files.resources import PACKAGE, bundled_folder, expand_home

_LOG = logging.getLogger(__name__)
_PATH = re.compile(r"[^][\s,'\"]*/([^][\s,'\"/]+)/*")
MAX_LENGTH = 100  # characters; file systems allow 255 bytes


def job_name(overrides: Sequence[str]) -> str:
    """Make a readable name for a folder: ``failure=random seed=0`` -> failure-random_seed-0.

    A key is represented by its last part, as is a path, followed by a hash of the whole value:
    ``designs=outputs/study/a`` -> designs-a-2cffc1. The name has letters, digits, ``-``, ``_`` and
    ``.`` only; it is ``baseline`` without overrides. A longer name is cut and ends in a hash of
    the whole.
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
    """Name a folder by unresolved overrides: no secret of the environment gets into the name."""
    return job_name([str(override) for override in OmegaConf.to_container(overrides) or ()])


register_resolver("evoros.name", _name_folder)


def _reduce_store(_: ConfigStore) -> tuple[Callable[[], ConfigStore], tuple[()]]:
    return ConfigStore.instance, ()


# Hydra copies what it searches for each list of choices. Its store is the only one of the process,
# and its copies take more than half of the time of --help.
copyreg.pickle(ConfigStore, _reduce_store)


def compose(
    overrides: Sequence[str] = (), *, config_dir: str | Path | None = None
) -> Configuration:
    """Compose the configuration that the command would use with the same overrides.

    ``config_dir`` is a folder of your own groups and experiments, as with ``--config-dir``.

    Raises:
        InputError: an unknown key, group or option; malformed YAML; a reference to nothing.
    """
    return freeze(compose_with_hydra(overrides, config_dir))


def compose_with_hydra(
    overrides: Sequence[str],
    config_dir: str | Path | None = None,
    index: int = 0,
    primary: str = "config",
) -> DictConfig:
    """Compose a configuration that still has Hydra's own part.

    ``index`` is the job's in a sweep; ``primary`` is the file of conf/ into which everything else
    is composed. The interpolation ``${hydra:...}`` refers to the configuration that was
    composed last.
    """
    extra = [] if config_dir is None else [search_path(config_dir)]
    try:
        with initialize():
            config = hydra_compose(
                primary, overrides=[*extra, *overrides], return_hydra_config=True
            )
        with open_dict(config):
            config.hydra.job.num = index
        HydraConfig.instance().set_config(config)
    except Exception as error:  # Hydra also raises ValueError, TypeError, AssertionError ...
        raise InputError(describe_error(error)) from error
    return config


def list_choices(group: str, config_dir: str | Path | None = None) -> list[str]:
    """List the bundled files of a group and the user's; none if there is no such group."""
    added = [] if config_dir is None else (add_config_dir(config_dir) / group).glob("*.yaml")
    with initialize():
        bundled = GlobalHydra.instance().config_loader().get_group_options(group, ObjectType.CONFIG)
    return sorted({*bundled, *(file.stem for file in added)})


def initialize() -> AbstractContextManager[None]:
    """Make ``conf/`` the folder of Hydra's global state until the context is left."""
    GlobalHydra.instance().clear()
    context: AbstractContextManager[None] = initialize_config_dir(
        str(bundled_folder("conf")), "evoros", **VERSION_BASE
    )
    return context


def search_path(config_dir: str | Path) -> str:
    """Return the override that adds a user's folder, whose modules become importable.

    It warns of files in the folder that bundled ones of the same name hide.
    """
    folder = add_config_dir(config_dir)
    for bundled, hidden in list_hidden(folder):
        _LOG.warning("%s: is not used, because %s wins; rename it", hidden, bundled)
    return f"hydra.searchpath=[{quote(f'file://{folder}')}]"


def quote(text: str) -> str:
    """Quote a text for Hydra's grammar of overrides."""
    escaped = text.replace("\\", "\\\\").replace("'", "\\'")
    return f"'{escaped}'"


def parse(overrides: Sequence[str]) -> list[Override]:
    """Parse overrides by Hydra's grammar."""
    try:
        parsed = OverridesParser.create().parse_overrides(list(overrides))
    except Exception as error:
        raise InputError(describe_error(error)) from error
    for override in parsed:
        if override.is_sweep_override():
            continue
        value = override.value()
        names = value if isinstance(value, list) else [value]
        group = (bundled_folder("conf") / override.key_or_group).is_dir()
        selects = group and not override.is_delete()
        if selects and not all(isinstance(name, str) for name in names):
            raise InputError(
                f"{override.key_or_group}: must be one of its choices, not {value}; evoros --help "
                f"lists them"
            )
    return parsed


def text_of(override: Override) -> str:
    """Return the override as the user typed it."""
    return override.input_line or ""


def add_config_dir(path: str | Path) -> Path:
    """Make the modules in a user's configuration folder importable, and return its full path."""
    folder = expand_home(path).resolve()
    if not folder.is_dir():
        raise InputError(
            f"--config-dir {path}: must be a folder with configuration groups, and there is none; "
            f"create it or correct the path"
        )
    if str(folder) not in sys.path:  # spawned workers inherit the path
        # Before evoros's neighbours, such as analysis/ of a checkout, which would hide its modules.
        places = [Path(entry).resolve() for entry in sys.path]
        index = places.index(PACKAGE.parent) if PACKAGE.parent in places else len(places)
        sys.path.insert(index, str(folder))
    if folder not in NAMED_FOLDERS:
        NAMED_FOLDERS.append(folder)
    return folder
