"""From configuration to an experiment: the only module that builds objects from YAML.

Whatever is wrong becomes an InputError of one line (``messages.py``).
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import InstantiationException
from hydra.utils import instantiate
from omegaconf import DictConfig, ListConfig, OmegaConf, open_dict

from evoros.base.errors import EvorosError, InputError
from evoros.base.resources import bundled_folder
from evoros.config.folder_names import job_name
from evoros.config.messages import about_instantiation, one_line, unresolved
from evoros.evolution.experiment import Experiment

_HYDRA_VERSION = "1.3"  # whose defaults we rely on


def _name(overrides: ListConfig) -> str:
    """Unresolved, so that no secret of the environment gets into the name of a folder."""
    return job_name([str(each) for each in OmegaConf.to_container(overrides) or ()])


OmegaConf.register_new_resolver("evoros.name", _name, replace=True)


def compose(overrides: Sequence[str] = (), config_dir: str | Path | None = None) -> DictConfig:
    """The configuration that the command would use with the same overrides.

    ``config_dir`` is a folder of your own groups and experiments, as with ``--config-dir``.

    Raises:
        InputError: an unknown key, group or option; malformed YAML.
    """
    return without_hydra(compose_whole(overrides, config_dir))


def compose_whole(
    overrides: Sequence[str],
    config_dir: str | Path | None = None,
    number: int = 0,
    primary: str = "config",
) -> DictConfig:
    """As ``compose``, with Hydra's own part; ``number`` is that of the job in a sweep.

    ``primary`` is the file of conf/ that everything else is composed into.

    The interpolation ``${hydra:...}`` refers to the configuration that was composed last.
    """
    extra = []
    if config_dir is not None:
        own = str(own_folder(config_dir)).replace("\\", "\\\\").replace("'", "\\'")
        extra = [f"hydra.searchpath=['file://{own}']"]
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(
            str(bundled_folder("conf")), "evoros", version_base=_HYDRA_VERSION
        ):
            config = hydra_compose(
                primary, overrides=[*extra, *overrides], return_hydra_config=True
            )
        with open_dict(config):
            config.hydra.job.num = number
        HydraConfig.instance().set_config(config)
    except Exception as error:  # Hydra also raises ValueError, TypeError, AssertionError ...
        raise InputError(one_line(error)) from error
    return config


def without_hydra(config: DictConfig) -> DictConfig:
    """The configuration of the experiment alone."""
    return OmegaConf.masked_copy(config, [str(key) for key in config if key != "hydra"])


def parse(overrides: Sequence[str]) -> list[Override]:
    """What was typed, by Hydra's grammar.

    Raises:
        InputError: it breaks the grammar.
    """
    try:
        parsed = OverridesParser.create().parse_overrides(list(overrides))
    except Exception as error:
        raise InputError(one_line(error)) from error
    for each in parsed:
        value = each.value()
        named = value if isinstance(value, list) else [value]
        group = (bundled_folder("conf") / each.key_or_group).is_dir() and not each.is_delete()
        if group and not each.is_sweep_override() and not all(isinstance(v, str) for v in named):
            raise InputError(
                f"{each.key_or_group}: must be one of its choices, not {value}; evoros --help "
                f"lists them"
            )
    return parsed


def typed(override: Override) -> str:
    """An override as it was typed."""
    return override.input_line or ""


def build(config: DictConfig) -> Experiment:
    """The experiment that the configuration describes. It may import any class that it names.

    Raises:
        InputError: a value, a file or a class cannot be used.
    """
    try:
        experiment = instantiate(without_hydra(config), _convert_="all")
    except EvorosError:
        raise
    except InstantiationException as error:
        raise InputError(about_instantiation(error)) from error
    except Exception as error:
        key = unresolved(config)
        raise InputError(f"{key}: {one_line(error)}" if key else one_line(error)) from error
    if not isinstance(experiment, Experiment):
        raise InputError(
            f"_target_: must be evoros.evolution.experiment.Experiment, not "
            f"{config.get('_target_')!r}; keep the one of conf/config.yaml"
        )
    return experiment


def own_folder(path: str | Path) -> Path:
    """A user's configuration folder, whose own Python modules can be imported from now on.

    Raises:
        InputError: there is no such folder.
    """
    own = Path(path).expanduser().resolve()
    if not own.is_dir():
        raise InputError(
            f"--config-dir {path}: must be a folder with configuration groups, and there is none; "
            f"create it or correct the path"
        )
    if str(own) not in sys.path:
        sys.path.append(str(own))  # spawned workers inherit the path
    return own


def read(path: Path) -> DictConfig:
    """The ``config.yaml`` of a run.

    Raises:
        InputError: no such file, or it cannot be read.
    """
    try:
        config = OmegaConf.load(path)
    except Exception as error:
        raise InputError(f"{path}: {one_line(error)}") from error
    if not isinstance(config, DictConfig):
        raise InputError(f"{path}: must be a mapping of keys to values; restore the file")
    return config


def to_values(config: DictConfig) -> str:
    """All values with their references resolved, to be compared and not to be kept."""
    return json.dumps(OmegaConf.to_container(without_hydra(config), resolve=True), default=str)


def to_text(config: DictConfig) -> str:
    """What a run keeps: unresolved, so that no secret of the environment reaches the disk."""
    return OmegaConf.to_yaml(without_hydra(config), resolve=False)
