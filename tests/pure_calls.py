"""Makes costly pure calls once in a process of tests or of injected faults.

Most tests fly whole runs with the robots, worlds and configuration files that evoros bundles, which
no test changes. What is read or composed from these alone is kept: configurations as bytes, so that
each caller gets its own copy, and robots and worlds as they are, because they are frozen. Fonts of
figures are kept with them.
"""

import json
import pickle
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import Any

import pytest
from hydra._internal import config_loader_impl
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra._internal.config_repository import ConfigRepository, IConfigRepository
from hydra._internal.defaults_list import DefaultsList, Overrides
from hydra.core.config_store import ConfigNode, ConfigStore
from hydra.core.object_type import ObjectType
from hydra.core.override_parser.types import Override
from hydra.plugins.config_source import ConfigResult
from matplotlib.backends import _backend_pdf_ps
from omegaconf import DictConfig, OmegaConf

from evoros.config import compose
from evoros.design import outline_region, region
from evoros.design.region import FreePlaces
from evoros.files.resources import PACKAGE, bundled_folder
from evoros.formats.urdf import xacro_expansion
from evoros.robot import loading as robot_loading
from evoros.robot.model import Robot
from evoros.world import loading as world_loading

Call = Callable[..., Any]


@contextmanager
def share_pure_calls() -> Iterator[None]:
    """Make costly pure calls once until the context is left."""
    with pytest.MonkeyPatch.context() as patch:
        for owner, name, share in (
            (xacro_expansion, "_run_child", _share_expansions),
            (ConfigRepository, "load_config", _share_files),
            (config_loader_impl, "create_defaults_list", _share_defaults),
            (ConfigLoaderImpl, "_compose_config_from_defaults_list", _share_merges),
            (compose, "hydra_compose", _share_configurations),
            (_backend_pdf_ps, "get_glyphs_subset", _share_fonts),
            (robot_loading, "load_robot", _share_bundled("robots")),
            (world_loading, "load_world", _share_bundled("worlds")),
        ):
            patch.setattr(owner, name, share(getattr(owner, name)))
        find = _share_free_places(region.find_free_places)
        for module in (region, outline_region):
            patch.setattr(module, "find_free_places", find)
        yield


def _share_expansions(expand: Call) -> Call:
    """Expand bundled robots once: the process for it takes an eighth of a second each time."""
    robots = bundled_folder("robots")
    answers: dict[str, tuple[int, str, str]] = {}

    def expand_once(request: str, folder: Path, patience_s: float) -> tuple[int, str, str]:
        if not folder.is_relative_to(robots):
            answer: tuple[int, str, str] = expand(request, folder, patience_s)
            return answer
        key = json.dumps({**json.loads(request), "path": None})
        if key not in answers:
            answers[key] = expand(request, folder, patience_s)
        return answers[key]

    return expand_once


def _share_files(load: Call) -> Call:
    """Read bundled configuration files once: a third of the time in which Hydra composes."""
    bundled = (str(bundled_folder("conf")), "hydra.conf")
    results: dict[str, bytes] = {}

    def load_once(self: ConfigRepository, config_path: str) -> ConfigResult | None:
        source = self._find_object_source(config_path, ObjectType.CONFIG)
        if source is None or source.path not in bundled:
            result: ConfigResult | None = load(self, config_path)
            return result
        if config_path not in results:
            results[config_path] = pickle.dumps(load(self, config_path))
        kept: ConfigResult | None = pickle.loads(results[config_path])
        return kept

    return load_once


def _share_defaults(create: Call) -> Call:
    """List the files of equal choices of groups once, whatever other values are given."""
    kept: dict[object, DefaultsList] = {}

    def create_once(
        repo: IConfigRepository,
        config_name: str | None,
        overrides_list: list[Override],
        **options: bool,
    ) -> DefaultsList:
        values = Overrides(repo, overrides_list).config_overrides
        chosen = [given.input_line for given in overrides_list if given not in values]
        folders = [source.full_path() for source in repo.get_sources()]
        key = (
            config_name,
            _read_stored(config_name),
            *chosen,
            *options.items(),
            *folders,
            *_list_files(folders),
        )
        if key not in kept:
            kept[key] = create(repo, config_name, overrides_list, **options)
        return replace(kept[key], config_overrides=values)

    return create_once


def _read_stored(primary: str | None) -> str:
    """Return the configuration that ``like`` has stored as the primary file."""
    stored = ConfigStore.instance().repo.get(f"{primary}.yaml")
    return OmegaConf.to_yaml(stored.node) if isinstance(stored, ConfigNode) else ""


def _share_merges(merge: Call) -> Call:
    """Merge the files of a list once, which with the listing is two thirds of a composition."""
    kept: dict[int, tuple[object, bytes]] = {}

    def merge_once(self: ConfigLoaderImpl, defaults: list[Any], repo: IConfigRepository) -> Any:
        key = id(defaults)
        if key not in kept:  # the list lives on, so that no other has its id
            kept[key] = defaults, pickle.dumps(merge(self, defaults, repo))
        return pickle.loads(kept[key][1])

    return merge_once


_PLACE = re.compile(r"hydra\.(run|sweep)\.dir=(/[\w./-]+)")
"""The override that names a folder, which differs in each test and changes nothing else."""


_SEARCHED = "hydra.searchpath="


def _share_configurations(composed: Call) -> Call:
    """Compose each configuration once, wherever its run is to be."""
    kept: dict[object, bytes] = {}

    def compose_once(primary: str, overrides: Sequence[str], **options: bool) -> DictConfig:
        places = {text: match for text in overrides if (match := _PLACE.fullmatch(text))}
        placed = [_describe_place(places.get(text), text) for text in overrides]
        folders = [text.partition("=")[2].strip('["]') for text in overrides if _SEARCHED in text]
        key = (primary, _read_stored(primary), *placed, *options.items(), *_list_files(folders))
        if key not in kept:
            kept[key] = pickle.dumps(composed(primary, overrides=placed, **options))
        config: DictConfig = pickle.loads(kept[key])
        OmegaConf.clear_cache(config)  # of the time, which names folders
        _put_places(config, places)
        return config

    return compose_once


def _describe_place(match: re.Match[str] | None, text: str) -> str:
    return f"hydra.{match[1]}.dir=/" if match else text


def _put_places(config: DictConfig, places: dict[str, re.Match[str]]) -> None:
    """Write the folders into a configuration that was composed for another place."""
    if not places:
        return
    OmegaConf.set_readonly(config.hydra, False)
    listed = config.hydra.overrides.hydra
    for text, match in places.items():
        config.hydra[match[1]].dir = match[2]
        listed[listed.index(_describe_place(match, text))] = text
    OmegaConf.set_readonly(config.hydra, None)


def _list_files(folders: Sequence[str]) -> list[tuple[str, int, int]]:
    """List the files of the user's folders, which tests change."""
    files = []
    for folder in folders:
        place = Path(folder.removeprefix("file://"))
        if folder.startswith("file://") and not place.is_relative_to(PACKAGE):
            for file in sorted(place.rglob("*.yaml")):
                status = file.stat()
                files.append((str(file), status.st_mtime_ns, status.st_size))
    return files


def _share_fonts(subset: Call) -> Call:
    """Subset a font once for the same characters: half of the time that a PDF takes."""
    kept: dict[object, Any] = {}
    opened = ExitStack()  # for as long as it is kept by the function

    def subset_once(font: object, glyphs: Iterable[int]) -> AbstractContextManager[Any]:
        key = (font, frozenset(glyphs))
        if key not in kept:
            kept[key] = opened.enter_context(subset(font, glyphs))
        return nullcontext(kept[key])

    return subset_once


def _share_bundled(kind: str) -> Callable[[Call], Call]:
    """Load a bundled robot or world once for each set of options, and each route."""
    bundled = bundled_folder(kind)

    def share(load: Call) -> Call:
        kept: dict[bytes, object] = {}

        @wraps(load)
        def load_once(*args: Any, **options: Any) -> Any:
            file, *others = args or (options.get("description") or options.get("sdf"),)
            elsewhere = others or options.get("packages") or options.get("model_paths")
            course = options.get("course")
            route = {"course": (course.home, course.waypoints)} if course else {}
            key = _pickle((file, options | route))
            if elsewhere or key is None or not _is_bundled(file, bundled):
                return load(*args, **options)
            if key not in kept:
                kept[key] = load(*args, **options)
            loaded: Any = kept[key]
            return replace(loaded, course=course) if route and loaded.course != course else loaded

        return load_once

    return share


def _is_bundled(file: object, bundled: Path) -> bool:
    """Whether a path is relative to a bundled folder, as nearly all configurations have it."""
    return isinstance(file, str) and not Path(file).exists() and (bundled / file).is_file()


def _pickle(value: object) -> bytes | None:
    """Return a value as bytes; None for one that tests have made and that has none."""
    try:
        return pickle.dumps(value)
    except Exception:
        return None


def _share_free_places(find: Call) -> Call:
    """Look once for the places at which a robot hides no sensor, which takes many rays."""
    kept: dict[object, tuple[object, FreePlaces | None]] = {}

    def find_once(robot: Robot, *args: Any) -> FreePlaces | None:
        arguments = _pickle(args)
        if arguments is None:
            places: FreePlaces | None = find(robot, *args)
            return places
        key = (id(robot), arguments)
        if key not in kept:
            kept[key] = robot, find(robot, *args)  # the robot lives on, so that no other has its id
        return kept[key][1]

    return find_once
