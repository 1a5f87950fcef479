"""From configuration to an experiment: the only module that builds objects from YAML.

Whatever is wrong becomes an InputError of one line that says where, the rule, the value, the cure.
"""

import re
import sys
from collections.abc import Sequence
from pathlib import Path

import yaml
from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException, InstantiationException
from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from evoros.assets import folder
from evoros.errors import EvorosError, InputError
from evoros.experiment import Experiment
from evoros.naming import job_name

CONFIG_ERRORS = (HydraException, OmegaConfBaseException, yaml.YAMLError, OSError)
_HYDRA_VERSION = "1.3"  # whose defaults we rely on

OmegaConf.register_new_resolver("evoros.name", job_name, replace=True)


def compose(overrides: Sequence[str] = (), config_dir: str | Path | None = None) -> DictConfig:
    """The configuration that the command would use with the same overrides.

    ``config_dir`` is a folder of your own groups and experiments, as with ``--config-dir``.

    Raises:
        InputError: an unknown key, group or option; malformed YAML.
    """
    extra = [] if config_dir is None else [f"hydra.searchpath=[file://{own_folder(config_dir)}]"]
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(str(folder("conf")), version_base=_HYDRA_VERSION):
            return hydra_compose("config", overrides=[*extra, *overrides])
    except CONFIG_ERRORS as error:
        raise InputError(one_line(error)) from error


def build(config: DictConfig) -> Experiment:
    """The experiment that the configuration describes. It may import any class that it names.

    Raises:
        InputError: a value, a file or a class cannot be used.
    """
    try:
        experiment = instantiate(config, _convert_="all")
    except InstantiationException as error:
        raise InputError(_instantiation(error)) from error
    except EvorosError:
        raise
    except CONFIG_ERRORS as error:
        raise InputError(one_line(error)) from error
    if not isinstance(experiment, Experiment):
        raise InputError(
            f"_target_: must be evoros.experiment.Experiment, not {config.get('_target_')!r}; "
            f"keep the one of conf/config.yaml"
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
    """A ``config.yaml`` of a run.

    Raises:
        InputError: no such file, or it cannot be read.
    """
    try:
        config = OmegaConf.load(path)
    except CONFIG_ERRORS as error:
        raise InputError(f"{path}: {one_line(error)}") from error
    if not isinstance(config, DictConfig):
        raise InputError(f"{path}: must be a mapping of keys to values; restore the file")
    return config


def group_file(group: str, name: str) -> Path:
    """The bundled YAML of one choice of a group.

    Raises:
        InputError: there is no such choice.
    """
    path = folder("conf") / group / f"{name}.yaml"
    if not re.fullmatch(r"\w+", name) or not path.is_file():
        choices = ", ".join(sorted(file.stem for file in path.parent.glob("*.yaml")))
        raise InputError(f"{group}: must be one of {choices}, not {name!r}; choose one of these")
    return path


def to_text(config: DictConfig) -> str:
    """What a run keeps: unresolved, so that no secret of the environment reaches the disk."""
    own = OmegaConf.masked_copy(config, [str(key) for key in config if key != "hydra"])
    return OmegaConf.to_yaml(own, resolve=False)


def one_line(error: BaseException) -> str:
    """What an error of Hydra, OmegaConf, YAML or the system says, in one line with a cure."""
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark:
        mark = error.problem_mark
        return (
            f"{mark.name}: line {mark.line + 1}, column {mark.column + 1}: must be valid YAML: "
            f"{error.problem}; correct the file"
        )
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror or error}; correct the path or its permissions"
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    text = re.sub(r"\s+", " ", " ".join(line for line in lines if not _noise(line)))
    return f"{text.rstrip('.')}; see evoros --help for groups and keys"


def _noise(line: str) -> bool:
    """Lines of Hydra's messages that repeat or decorate."""
    start = ("Config search path", "provider=", "Set the environment", "full_key:", "object_type=")
    return line.startswith(start)


def _instantiation(error: InstantiationException) -> str:
    """The cause of a failed instantiation, behind the key where it happened."""
    key = ""
    found = re.search(r"full_key: (\S+)", str(error))
    if found:
        key = found[1]
    cause = _cause(error)
    if isinstance(cause, EvorosError):
        return f"{key}: {cause}" if key else str(cause)
    where = key or "the configuration"
    if isinstance(cause, TypeError):
        return f"{where}: {_signature(str(cause))}"
    if isinstance(cause, ImportError | AttributeError | ValueError):
        return (
            f"{where}: {cause}; correct _target_, or put the module into the folder given with "
            f"--config-dir"
        )
    text = one_line(cause if cause is not None else error)
    return f"{where}: {text}"


def _cause(error: BaseException) -> BaseException | None:
    """The innermost cause; one of ours ends the search."""
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, EvorosError) and cause.__cause__ is not None:
        cause = cause.__cause__
    return cause


def _signature(message: str) -> str:
    """A readable line from Python's complaint about arguments."""
    unknown = re.search(r"unexpected keyword argument '(\w+)'", message)
    if unknown:
        return f"unknown key {unknown[1]!r}; remove it or correct its spelling"
    missing = re.search(r"missing \d+ required .*?argument[s]?: (.*)", message)
    if missing:
        return f"missing key {missing[1]}; add it"
    return f"{message}; correct the values"
