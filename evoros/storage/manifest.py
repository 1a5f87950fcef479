"""The manifest of a run: versions, machine and digests of all inputs, found by parsing sources."""

import ast
import hashlib
import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from importlib.machinery import ModuleSpec
from importlib.metadata import packages_distributions
from importlib.util import find_spec, resolve_name
from itertools import chain
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.controller.protocol import LiveController
from evoros.evolution.experiment import Experiment
from evoros.files.disk import LONGEST_LINE, write_atomically
from evoros.files.nested import parse_yaml
from evoros.mission.plan import FINAL
from evoros.observers.protocol import FREE
from evoros.requirement.claim import OWN as OWN_CONDITION
from evoros.storage import circumstances, layout, tables
from evoros.storage.archives import NOWHERE, Relocation
from evoros.storage.layout import read_sealed, seal_json
from evoros.storage.run_folder import GENERATIONS
from evoros.storage.run_key import KEY, conceal, derive_key, hash_secrets, list_other_secrets

_map_distributions = cache(packages_distributions)


def manifest(
    experiment: Experiment,
    config: str,
    values: Mapping[str, Any],
    choices: Mapping[str, str],
    command: str = "evoros",
    files: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Return the content of ``manifest.json`` of a new folder; ``config`` is the YAML.

    ``values`` are resolved. ``choices`` holds the option chosen in each group. ``files`` holds the
    contents of other files in the folder, by name.
    """
    packages = (*mission_packages(experiment), *_collect_imports(_modules(values)).packages)
    return {
        "format_version": layout.FORMAT_VERSION,
        "command": command,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "working_directory": str(Path.cwd()),
        "seed": experiment.seed,
        "record": experiment.record,
        layout.AGENTS: list(experiment.agents),
        layout.COLUMNS: list_columns(experiment, command == layout.EVALUATE),
        "choices": dict(sorted(choices.items())),
        "simulators": _simulators(experiment),
        **circumstances.describe_circumstances(packages, _program_versions(experiment)),
        "sha256": hash_sources(experiment, config, values, files or {}),
        layout.SECRETS: hash_secrets(values, config),
    }


def list_columns(experiment: Experiment, given: bool) -> list[str]:
    """List the columns of ``missions.csv`` of an evaluation if ``given``, else of a search."""
    conditions = (OWN_CONDITION, *experiment.conditions.values())
    scenarios = map(experiment.scenario_under, conditions)
    further = dict.fromkeys(name for one in scenarios for name in tables.list_further_in(one))
    outcomes = tables.name_outcome_columns(experiment.agents, list(further))
    case = [tables.CASE] if experiment.states_cases else []
    return [*(tables.GIVEN_COLUMNS if given else tables.MISSION_COLUMNS), *outcomes, *case]


def hash_sources(
    experiment: Experiment,
    config: str,
    values: Mapping[str, Any],
    files: Mapping[str, str],
    places: Relocation = NOWHERE,
) -> dict[str, str]:
    """Return the SHA-256 digests of all inputs of the experiment, by name.

    ``places`` replaces folder paths that depend on the machine. The other arguments are as in
    ``manifest``, with these paths replaced.
    """
    named = _modules(values)
    modules = _collect_imports(named).modules | {name: Path(_file(name) or "") for name in named}
    hashes = {
        "configuration": _sha256(config),
        "simulators": _sha256(json.dumps(_simulators(experiment))),
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
    programs = {
        controller.files[0]: controller.version
        for controller in _live_controllers(experiment)
        if controller.version is not None
    }
    return programs | _library_versions(experiment)


def _library_versions(experiment: Experiment) -> dict[str, str]:
    """Return the versions of simulator libraries unknown to pip, by name."""
    return {**experiment.simulator.versions, **experiment.confirming.simulator.versions}


def _hash_controller_files(experiment: Experiment, places: Relocation) -> dict[str, str]:
    hashes = {}
    for path in chain.from_iterable(live.files for live in _live_controllers(experiment)):
        try:
            hashes[f"file {places.relocate(str(path))}"] = _sha256(Path(path).read_bytes())
        except OSError as error:
            raise InputError(
                f"{path}: cannot be read ({error.strerror}), but the controller depends on it; "
                f"change the path in the controller's command or files"
            ) from error
    return hashes


def check_unchanged(folder: Path, recorded: Mapping[str, Any], changes: Iterable[str]) -> None:
    """Raise an error if there are ``changes`` to the inputs of a resumed run."""
    if recorded.get("format_version") != layout.FORMAT_VERSION:
        raise InputError(
            f"{folder / 'manifest.json'}: format_version must be {layout.FORMAT_VERSION}, not "
            f"{recorded.get('format_version')!r}; resume with the version of evoros that made the "
            "run"
        )
    for name in changes:
        raise InputError(
            f"{folder}: {name} has changed since the run began; restore it, or start a new run"
        )


def find_changes(
    recorded: Mapping[str, Any],
    experiment: Experiment,
    config: str,
    values: Mapping[str, Any],
    files: Mapping[str, str],
    places: Relocation = NOWHERE,
) -> Iterator[str]:
    """Yield the names of all inputs of a run that have changed; see ``hash_sources``."""
    now = hash_sources(experiment, config, values, files, places)
    then = {name: value for name, value in recorded.get("sha256", {}).items() if name != KEY}
    yield from (name for name, value in then.items() if now.get(name) != value)
    secrets = recorded.get(layout.SECRETS, {}), hash_secrets(values, config)
    yield from (f"configuration ({key})" for key in list_other_secrets(*secrets))


_UNTIL_SCORED = {"fitness", "objectives", "descriptors"}  # keys that affect tables, not missions


def _has_final_choice(missions: Path) -> bool:
    with missions.open("rb") as file:
        while 0 < len(line := file.readline(LONGEST_LINE)) < LONGEST_LINE:
            if f",{FINAL},".encode() in line:
                return True
    return False


def list_unrecorded(folder: Path) -> dict[str, Path]:
    """Return the source files of parts without effect on recorded results, by manifest key."""
    if layout.evaluates(folder) or not (folder / layout.MISSIONS).is_file():
        return {}
    free = set() if any((folder / GENERATIONS).glob("*.csv")) else set(_UNTIL_SCORED)
    if not _has_final_choice(folder / layout.MISSIONS):
        free.add("final_choice")
    values = parse_yaml((folder / layout.CONFIG).read_text(encoding="utf-8"))
    kept, freed = ({k: v for k, v in values.items() if (k in free) is own} for own in (False, True))
    bound = _collect_imports(_modules(kept)).modules
    modules = _collect_imports(_modules(freed)).modules | {
        name: Path(_file(name) or "") for name in _modules(freed)
    }
    return {
        f"module {name}": path
        for name, path in modules.items()
        if name not in bound and name not in _modules(kept)
    }


def record_modules(folder: Path, modules: Mapping[str, Path]) -> None:
    """Record the digests of changed modules; the key for row digests is unchanged."""
    recorded = read_sealed(folder, layout.MANIFEST)
    hashes = {name: _sha256(path.read_bytes()) for name, path in modules.items()}
    content = {**recorded, "sha256": {**recorded["sha256"], **hashes}}
    if content != recorded:
        write_atomically(folder / layout.MANIFEST, seal_json(layout.MANIFEST, content))


def _simulators(experiment: Experiment) -> list[str]:
    simulators = (experiment.simulator, experiment.confirming.simulator)
    return list(dict.fromkeys(f"{c.__module__}.{c.__qualname__}" for c in map(type, simulators)))


def mission_packages(experiment: Experiment) -> list[str]:
    """List packages whose versions can change missions or the search."""
    simulators = (experiment.simulator, experiment.confirming.simulator)
    named = [name for simulator in simulators for name in simulator.packages]
    return list(dict.fromkeys((*circumstances.COMPUTING, *named, *experiment.optimizer.packages)))


def list_other_versions(
    recorded: Mapping[str, Any], experiment: Experiment, values: Mapping[str, Any]
) -> Iterator[tuple[str, str, str]]:
    """Yield (name, recorded version, current version) of changed packages and programs."""
    imported = sorted(_collect_imports(_modules(values)).packages)
    for name in dict.fromkeys(
        map(circumstances.normalize, (*mission_packages(experiment), *imported))
    ):
        before, now = recorded.get("packages", {}).get(name), circumstances.find_version(name)
        if before != now:
            yield name, before or "not installed", now or "not installed"
    programs = recorded.get("programs", {})
    for name, version in _library_versions(experiment).items():
        if programs.get(name) != version:
            yield name, programs.get(name) or "of unknown version", version


def _modules(values: Any) -> set[str]:
    """Return the user's modules in ``values``, except modules of executor and observers."""
    if isinstance(values, list):
        return set().union(*map(_modules, values))
    if not isinstance(values, dict):
        return set()
    inner = (_modules(value) for key, value in values.items() if key not in FREE)
    modules: set[str] = set().union(*inner)
    name = str(values.get("_target_", ""))
    while name and name not in sys.modules:  # walk from the class up to its module
        name = name.rpartition(".")[0]
    if name.partition(".")[0] != "evoros" and _file(name):
        modules.add(name)
    return modules


def _file(module: str) -> str | None:
    return getattr(sys.modules.get(module), "__file__", None)


def _sha256(content: str | bytes) -> str:
    return hashlib.sha256(content.encode() if isinstance(content, str) else content).hexdigest()


@dataclass
class Imports:
    """The packages and modules imported by some modules."""

    packages: set[str] = field(default_factory=set)  # names of distributions
    modules: dict[str, Path] = field(default_factory=dict)  # source file of each module


def _collect_imports(modules: Iterable[str]) -> Imports:
    """Collect the imports of modules, also through other modules outside packages."""
    imports = Imports()
    pending = list(modules)
    seen: set[str] = set()
    while pending:
        name = pending.pop()
        top = name.partition(".")[0]
        if name in seen or top in (circumstances.OWN, *sys.stdlib_module_names):
            continue
        seen.add(name)
        distributions = _map_distributions().get(top)
        if distributions:
            imports.packages.update(distributions)
            continue
        spec = _find_spec(name)
        if spec is None or not spec.origin or not Path(spec.origin).is_file():
            continue
        imports.modules[name] = Path(spec.origin)
        pending += _list_imported(spec, Path(spec.origin))
    return imports


def _find_spec(name: str) -> ModuleSpec | None:
    # imports the parent packages but not the module
    try:
        return find_spec(name)
    except Exception:  # importing a user's package may raise any exception
        return None


def _list_imported(spec: ModuleSpec, file: Path) -> Iterator[str]:
    """Yield all names that a module imports, either modules or members of modules."""
    if file.suffix != ".py":
        return
    package = spec.name if spec.submodule_search_locations else spec.parent
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError):  # importing the module will report the error
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            try:
                base = resolve_name(f"{'.' * node.level}{node.module or ''}", package)
            except ImportError:  # a relative import above the top-level package
                continue
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names if alias.name != "*")
