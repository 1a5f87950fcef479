"""Before work in a folder is resumed: its experiment, unchanged but for what may change."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import chdir, contextmanager
from pathlib import Path
from typing import Any

from hydra.core.override_parser.types import OverrideType
from omegaconf import DictConfig, OmegaConf

from evoros.base.checks import is_whole
from evoros.base.errors import InputError
from evoros.config import compose as configuration
from evoros.evolution.experiment import Experiment
from evoros.storage.manifest import check_unchanged
from evoros.storage.mission_log import CONFIG, MANIFEST, command_of, require_whole, resume_command

RUN = "evoros"
"""The command that evolves; it alone may extend what it resumes."""


def rebuild(
    folder: Path,
    overrides: Sequence[str],
    config_dir: str | Path | None,
    command: str = RUN,
    files: Sequence[str] = (),
) -> tuple[Experiment, int | None]:
    """The unchanged experiment of a folder, with what may change; and the generations asked for.

    ``command`` must have made the folder, from the experiment and further ``files`` in it.

    Raises:
        InputError: nothing of that command there, another override, or what it is made of has
            changed.
    """
    if config_dir is not None:
        configuration.own_folder(config_dir)
    recorded, config = _read_manifest(folder, command), configuration.read(folder / CONFIG)
    text = (folder / CONFIG).read_text()
    changed, asked = _overridden(config.copy(), overrides, config_dir, command == RUN)
    with _where_it_began(recorded):
        experiment = configuration.build(changed)
    values = configuration.to_values(config)
    more = {name: _text(folder / name) for name in files}
    check_unchanged(folder, recorded, experiment, text, values, more)
    return experiment, asked


def _text(path: Path) -> str:
    return path.read_text() if path.is_file() else ""


@contextmanager
def _where_it_began(recorded: Mapping[str, Any]) -> Iterator[None]:
    """Paths in a configuration may be relative to the folder where the run was started."""
    origin = Path(str(recorded.get("working_directory", ".")))
    with chdir(origin if origin.is_dir() else Path.cwd()):
        yield


def _read_manifest(folder: Path, command: str) -> Mapping[str, Any]:
    require_whole(folder)
    if not (folder / CONFIG).is_file() or not (folder / MANIFEST).is_file():
        raise InputError(
            f"resume={folder}: must be the folder of a run, with {CONFIG} and {MANIFEST}; "
            f"give such a folder"
        )
    try:
        content = json.loads((folder / MANIFEST).read_text())
    except ValueError as error:
        raise InputError(
            f"{folder / MANIFEST}: must be valid JSON ({error}); restore the file"
        ) from error
    if command_of(folder) != command:
        raise InputError(
            f"resume={folder}: must be a folder that {command} made, and {command_of(folder)} made "
            f"it; type: {resume_command(folder)}"
        )
    return content if isinstance(content, Mapping) else {}


def _overridden(
    config: DictConfig,
    overrides: Sequence[str],
    config_dir: str | Path | None,
    extendable: bool,
) -> tuple[DictConfig, int | None]:
    """The run's own configuration with what resuming may change; and the generations asked for."""
    asked = None
    allowed = "executor, executor.*"
    allowed += " and a larger optimizer.generations" if extendable else ""
    for override in configuration.parse(overrides):
        key, value = override.key_or_group, override.value()
        plain = override.type is OverrideType.CHANGE and not override.is_sweep_override()
        if plain and key == "executor":
            config.executor = configuration.compose(
                [configuration.typed(override)], config_dir
            ).executor
        elif plain and key.startswith("executor."):
            OmegaConf.update(config, key, value, force_add=True)
        elif plain and extendable and key == "optimizer.generations":
            least = OmegaConf.select(config, key)
            if not (isinstance(value, int) and is_whole(value)) or value < least:
                raise InputError(
                    f"{key}: must be a whole number of at least {least}, which the run already "
                    f"has, not {value!r}; a run can only be extended"
                )
            config.optimizer.generations = asked = value
        else:
            raise InputError(
                f"{configuration.typed(override)}: only {allowed} go with resume=; the rest is "
                f"the run's own; start a new run to change it"
            )
    return config, asked
