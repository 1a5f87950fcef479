"""The manifest of a run: versions, machine, and hashes of everything that it depends on."""

import hashlib
import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.controller.protocol import LiveController, VersionedController
from evoros.evolution.experiment import Experiment
from evoros.observers.protocol import FREE
from evoros.optimizer.protocol import PackagedOptimizer
from evoros.simulator.protocol import VersionedSimulator
from evoros.storage.circumstances import describe_circumstances, find_version, normalize
from evoros.storage.imports import collect_imports
from evoros.storage.layout import FORMAT_VERSION
from evoros.storage.relocation import NOWHERE, Relocation
from evoros.storage.run_key import KEY, conceal, derive_key, names_environment

COMPUTING = ("evoros", "numpy", "numba")
"""Packages whose versions can change missions in every simulator."""

CHECK_DIGITS = 2
"""Hexadecimal digits of a hash of values from the environment, by which none can be guessed. Of 256
changes, one goes unnoticed."""


def manifest(
    experiment: Experiment,
    config: str,
    values: Mapping[str, Any],
    choices: Mapping[str, str],
    command: str = "evoros",
    files: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Return the content of ``manifest.json`` for a new folder whose ``config.yaml`` is ``config``.

    ``values`` is the configuration with its references resolved; ``choices`` has the chosen file
    of each of its groups. ``command`` creates the folder from the experiment and from further
    ``files``, whose texts are given by name.
    """
    packages = (*mission_packages(experiment), *collect_imports(_modules(values)).packages)
    return {
        "format_version": FORMAT_VERSION,
        "command": command,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "working_directory": str(Path.cwd()),
        "seed": experiment.seed,
        "record": experiment.record,
        "agents": list(experiment.agents),
        "states_cases": experiment.states_cases,
        "fails_parts": experiment.fails_parts,
        "walkers": experiment.scenario.any_walkers,
        "states_shortest": experiment.scenario.states_shortest,
        "choices": dict(sorted(choices.items())),
        "simulators": _simulators(experiment),
        **describe_circumstances(packages, _program_versions(experiment)),
        "sha256": hash_sources(experiment, config, values, files or {}),
    }


def hash_sources(
    experiment: Experiment,
    config: str,
    values: Mapping[str, Any],
    files: Mapping[str, str],
    places: Relocation = NOWHERE,
) -> dict[str, str]:
    """Return the SHA-256 of everything that the experiment was built from.

    ``places`` has the folders whose paths are no part of it. The other arguments, named as those of
    ``manifest``, are without these paths already.
    """
    digits = CHECK_DIGITS if names_environment(config) else None
    named = _modules(values)
    modules = collect_imports(named).modules | {name: Path(_file(name) or "") for name in named}
    hashes = {
        "configuration": _sha256(config),
        "simulators": _sha256(json.dumps(_simulators(experiment))),
        "configuration (what its ${...} refer to)": _sha256(json.dumps(values, default=str))[
            :digits
        ],
        "robot": _sha256(places.relocate(experiment.robot.urdf)),
        **{
            f"agents.{name}.robot": _sha256(places.relocate(agent.robot.urdf))
            for name, agent in experiment.agents.items()
            if agent.robot is not None
        },
        **{f"world.{name}": world.source_sha256 for name, world in experiment.world.items()},
        **{f"module {name}": _sha256(modules[name].read_bytes()) for name in sorted(modules)},
        **_hash_controller_files(experiment, places),
        **{name: _sha256(content) for name, content in files.items()},
    }
    return {**hashes, KEY: derive_key(conceal(values, config), hashes)}


def _live_controllers(experiment: Experiment) -> list[LiveController]:
    return [
        controller
        for pair in zip(experiment.members, experiment.confirming.members, strict=True)
        for controller in (member.controller for member in pair)
        if isinstance(controller, LiveController)
    ]


def _program_versions(experiment: Experiment) -> dict[str, str]:
    """Return the versions of live controllers' programs, by file, and of simulators' libraries."""
    programs = {
        controller.files[0]: controller.version
        for controller in _live_controllers(experiment)
        if isinstance(controller, VersionedController)
    }
    return programs | _library_versions(experiment)


def _library_versions(experiment: Experiment) -> dict[str, str]:
    """Return the versions of the simulators' libraries that pip does not know, by name."""
    versions: dict[str, str] = {}
    for simulator in (experiment.simulator, experiment.confirming.simulator):
        if isinstance(simulator, VersionedSimulator):
            versions |= simulator.versions
    return versions


def _hash_controller_files(experiment: Experiment, places: Relocation) -> dict[str, str]:
    """Return the hashes of the files of live controllers."""
    hashes = {}
    for path in chain.from_iterable(live.files for live in _live_controllers(experiment)):
        try:
            hashes[f"file {places.relocate(str(path))}"] = _sha256(Path(path).read_bytes())
        except OSError as error:
            raise InputError(
                f"{path}: must be a file that can be read ({error.strerror}), because the "
                f"controller depends on it; correct the path in the controller's command or files"
            ) from error
    return hashes


def check_unchanged(folder: Path, recorded: Mapping[str, Any], changes: Iterable[str]) -> None:
    """Require that there are no ``changes`` of what a run that is resumed was made.

    Raises:
        InputError: a file has changed, or the run is of another format.
    """
    if recorded.get("format_version") != FORMAT_VERSION:
        raise InputError(
            f"{folder / 'manifest.json'}: format_version must be {FORMAT_VERSION}, not "
            f"{recorded.get('format_version')!r}; resume with the version of evoros that made it"
        )
    for name in changes:
        raise InputError(
            f"{folder}: {name} must be as it was when the run began, and it has changed; "
            f"restore it, or start a new run"
        )


def find_changes(
    recorded: Mapping[str, Any],
    experiment: Experiment,
    config: str,
    values: Mapping[str, Any],
    files: Mapping[str, str],
    places: Relocation = NOWHERE,
) -> Iterator[str]:
    """Yield what a run was made of and is another now; see ``hash_sources``."""
    now = hash_sources(experiment, config, values, files, places)
    then = {name: value for name, value in recorded.get("sha256", {}).items() if name != KEY}
    yield from (name for name, value in then.items() if now.get(name) != value)


def _simulators(experiment: Experiment) -> list[str]:
    """List the class of the simulator, and of the confirming one if it is another."""
    simulators = (experiment.simulator, experiment.confirming.simulator)
    return list(dict.fromkeys(f"{c.__module__}.{c.__qualname__}" for c in map(type, simulators)))


def mission_packages(experiment: Experiment) -> list[str]:
    """List the packages whose versions can change missions or the search of the experiment."""
    simulators = (experiment.simulator, experiment.confirming.simulator)
    named = [name for simulator in simulators for name in simulator.packages]
    if isinstance(experiment.optimizer, PackagedOptimizer):
        named += experiment.optimizer.packages
    return list(dict.fromkeys((*COMPUTING, *named)))


def list_other_versions(
    recorded: Mapping[str, Any], experiment: Experiment, values: Mapping[str, Any]
) -> Iterator[tuple[str, str, str]]:
    """Yield what is of another version than in the manifest ``recorded``, before and now.

    They stop nothing, because the replay of the run shows whether they make a difference.
    """
    imported = sorted(collect_imports(_modules(values)).packages)
    for name in dict.fromkeys(map(normalize, (*mission_packages(experiment), *imported))):
        before, now = recorded.get("packages", {}).get(name), find_version(name)
        if before != now:
            yield name, before or "(not installed)", now or "not installed"
    programs = recorded.get("programs", {})
    for name, version in _library_versions(experiment).items():
        if programs.get(name) != version:
            yield name, programs.get(name) or "(not recorded)", version


def _modules(values: Any) -> set[str]:
    """Return the imported modules that ``values`` name, without evoros's own and built-in ones.

    Those of the executor and the observers are left out, because no result depends on them, and
    resuming may change them.
    """
    if isinstance(values, list):
        return set().union(*map(_modules, values))
    if not isinstance(values, dict):
        return set()
    inner = (_modules(value) for key, value in values.items() if key not in FREE)
    modules: set[str] = set().union(*inner)
    name = str(values.get("_target_", ""))
    while name and name not in sys.modules:  # from the class up to its module
        name = name.rpartition(".")[0]
    if name.partition(".")[0] != "evoros" and _file(name):
        modules.add(name)
    return modules


def _file(module: str) -> str | None:
    """Return the source file of an imported module, if it has one."""
    return getattr(sys.modules.get(module), "__file__", None)


def _sha256(content: str | bytes) -> str:
    return hashlib.sha256(content.encode() if isinstance(content, str) else content).hexdigest()
